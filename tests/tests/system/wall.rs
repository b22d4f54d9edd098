//! Two pages as the screens of a wall.

use holo_picture::{Picture, luminance};
use holo_tests::{Chromium, Place, wait_until};

/// The eye, and a place of a screen: its column and row of 1280 × 720 pixels.
const EYE: [&str; 4] = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1"];
const PLACES: [(u32, u32); 3] = [(640, 360), (200, 150), (1100, 600)];

#[test]
fn pages_show_their_screens_of_one_frame_and_follow_the_leader_s_eye() {
    let place = Place::new();
    place.fill_small_with("a.holo", "200k", &["--bounces", "0"]);
    // 16 to 9, so that pixels are square.
    let (left, right) =
        ("left=-0.8,0.8,-0.45,0.45,1,-10".to_owned(), "right=-0.6,1,-0.4,0.5,1,10".to_owned());
    let words = ["replay", "{}/a.holo", "--no-open", "--screen", &left, "--screen", &right];
    let mut session = place.start(&[&words[..], &EYE].concat());
    let address = format!("http:{}", session.wait_for_line("http:"));
    let leader = &mut Chromium::open(&format!("{address}?screen=left"));
    let follower = &mut Chromium::open(&format!("{address}?screen=right"));
    let rests = "document.body.dataset.rest === 'true' && document.body.dataset.exact === 'true'";
    for (browser, screen) in [(&mut *leader, "left"), (&mut *follower, "right")] {
        browser.wait(rests);
        assert_eq!(browser.value("document.body.dataset.screen"), screen);
        assert_eq!(browser.value("header.size"), serde_json::json!([2560, 720]));
    }
    // Each screen's light is that of a view with the same eye and the screen's edges.
    for (turn, [across, along], [vs, vl], browser) in [
        (-10_f64, [1.6, 0.9], [0.0, 0.0], &mut *leader),
        (10.0, [1.6, 0.9], [0.2 / 1.6, 0.05 / 0.9], &mut *follower),
    ] {
        let (sine, cosine) = turn.to_radians().sin_cos();
        let angle = |side: f64| 2.0 * (0.5 * side).atan().to_degrees();
        let view = format!(
            "-vp 2.78 2.73 -2 -vd {} 0 {cosine} -vu 0 1 0 -vh {} -vv {} -vs {vs} -vl {vl}",
            -sine,
            angle(across),
            angle(along)
        );
        let file = place.write("screen.vf", &format!("rvu -vtv {view}\n"));
        let picture = ["picture", "{}/a.holo", "-o", "{}/p.pfm", "--size", "1280x720", "--vf"];
        place.run(&[&picture[..], &[&file]].concat()).ok();
        let picture = Picture::read(place.path("p.pfm")).unwrap();
        assert_eq!(picture.size(), (1280, 720));
        for (column, row) in PLACES {
            let truth = luminance(picture.get(column, row).unwrap());
            let shown = "parseFloat(document.getElementById('p-luminance').textContent)";
            let agrees = format!("Math.abs({shown} / {truth} - 1) < 0.01");
            wait_until("the light of the screen's own view", || {
                // The page leaves out places of a mouse that moves fast.
                browser.mouse("mouseMoved", (column, row), 0);
                (browser.value(&agrees) == true).then_some(())
            });
        }
        // The page shows its half of the frame, and nothing else.
        let columns = browser.value(
            "(() => { const box = picture.getBoundingClientRect(); \
             return [box.left, box.width]; })()",
        );
        let first = if turn < 0.0 { 0 } else { -1280 };
        assert_eq!(columns, serde_json::json!([first, 2560]));
    }
    // The leader walks, and the follower with it.
    let options = "document.body.dataset.options";
    let before = follower.value(options);
    leader.key("KeyW", "w", true);
    follower.wait(&format!("{options} !== {before}"));
    leader.key("KeyW", "w", false);
    leader.wait(rests);
    let frame = leader.value("document.body.dataset.frame");
    follower.wait(&format!("document.body.dataset.frame >= {frame} && {rests}"));
    assert_eq!(leader.value(options), follower.value(options));
    // A page that names no screen of the wall says so.
    follower
        .go_to(&format!("{address}?screen=top"), "typeof screens === 'object' && screens.length");
    follower.wait("document.getElementById('notice').textContent.includes('left, right')");
}
