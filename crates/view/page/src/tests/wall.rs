//! Tests of the screens of a wall.

use super::*;

/// Time in which a client would have received another frame.
const SOON: Duration = Duration::from_millis(300);

#[tokio::test(flavor = "multi_thread")]
async fn screens_show_one_frame_and_the_next_one_once_all_have_shown_it() {
    let mut server = Server::with_screens(&["left", "right"]).await;
    let (mut left, mut right) = (server.page().await, server.page().await);
    let first = server.publish(0.5, (0, 0));
    let (of_left, of_right) = (left.update().await, right.update().await);
    assert_eq!([&of_left.header["frame"], &of_right.header["frame"]], [first, first]);
    // The left screen is ready for more. It receives its frame exactly, but no other frame.
    server.publish(0.4, (0, 0));
    let third = server.publish(0.3, (0, 0));
    left.shown(&of_left).await;
    let exact = left.update().await;
    assert_eq!(exact.header["frame"], first);
    left.shown(&exact).await;
    assert!(timeout(SOON, left.update()).await.is_err(), "the right screen shows the first one");
    right.shown(&of_right).await;
    let (of_left, of_right) = (left.update().await, right.update().await);
    assert_eq!([&of_left.header["frame"], &of_right.header["frame"]], [third, third]);
}

/// Shows a page's updates until one of this frame comes.
async fn show_until(page: &mut Page, mut update: Update, frame: u64) -> Update {
    while update.header["frame"] != frame {
        page.shown(&update).await;
        update = page.update().await;
    }
    update
}

#[tokio::test(flavor = "multi_thread")]
async fn a_screen_that_hangs_or_is_hidden_does_not_stop_the_others() {
    let mut server = Server::with_screens(&["left", "right"]).await;
    let (mut left, mut right) = (server.page().await, server.page().await);
    server.publish(0.5, (0, 0));
    let (of_left, _) = (left.update().await, right.update().await);
    // It shows nothing. After a while the other one goes on.
    let second = server.publish(0.4, (0, 0));
    let of_left = show_until(&mut left, of_left, second).await;
    // It is hidden. The other one goes on at once.
    right.say(json!({ "do": "hidden", "hidden": true })).await;
    let third = server.publish(0.3, (0, 0));
    timeout(SOON, show_until(&mut left, of_left, third)).await.unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_screen_that_leaves_does_not_stop_the_others() {
    let mut server = Server::with_screens(&["left", "right"]).await;
    let (mut left, mut right) = (server.page().await, server.page().await);
    server.publish(0.5, (0, 0));
    let (of_left, _) = (left.update().await, right.update().await);
    let second = server.publish(0.4, (0, 0));
    drop(right);
    timeout(SOON, show_until(&mut left, of_left, second)).await.unwrap();
}
