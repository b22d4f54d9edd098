//! `--time` measures tracing, not loading.

use holo_net::Message;
use holo_proto::{control::Control, hello::Role};
use holo_tests::{LIMIT, Place, analytic::join};

/// A server reports twice a second, so four reports take longer than its `--time`.
const REPORTS: usize = 4;

#[test]
fn a_server_s_time_begins_when_a_worker_is_ready() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let mut server = place.server("a.holo", &["--fill", "--time", "1s", "--json"]);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let (mut inbox, _outbox, _) = join(server.address, Role::Display).await;
        for _ in 0..REPORTS {
            while !matches!(next(&mut inbox).await, Message::Control(Control::Status(_))) {}
        }
    });
    assert!(server.process.is_running(), "its time was over before anybody traced");
    let worker = place.worker(server.address, &[]);
    let summary = server.process.wait().ok().json();
    assert!(summary["added"].as_u64().unwrap() > 0, "{summary}");
    let seconds = summary["seconds"].as_f64().unwrap();
    assert!(seconds > 0.0, "{summary}");
    worker.wait().ok();
}

async fn next(inbox: &mut holo_net::Inbox) -> Message {
    tokio::time::timeout(LIMIT, inbox.next()).await.expect("in time").expect("the server lives")
}
