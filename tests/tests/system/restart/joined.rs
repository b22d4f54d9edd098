//! Workers and displays on other machines stay when the server starts again.

use holo_tests::{Place, Process, wait_until};

use super::{PAINTED, Truths, VIEW, WHITE, edit, of_scene, restart, taken, wait_to_see};

/// Waits until a worker was ready to trace this many times.
fn wait_for_worker(worker: &Process, times: usize) {
    wait_until(&format!("the worker to be ready {times} times ({})", worker.stderr()), || {
        (worker.stdout().lines().filter(|line| *line == "ready").count() >= times).then_some(())
    });
}

/// Waits until a display that follows typed lines shows one of the paints.
fn wait_for_script(place: &Place, display: &mut Process, truths: &Truths, painted: bool) {
    wait_until(&format!("the picture of the script, painted: {painted}"), || {
        let picture = taken(place, |path| {
            display.write_line(&format!("picture {path}"));
            display.wait_for_line(&format!("{{\"picture\":\"{path}\""));
        });
        truths.is(&picture, painted).then_some(())
    });
}

/// The samples of workers that joined with a token.
fn of_joined_workers(place: &Place) -> u64 {
    let info = place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
    let workers = info["workers"].as_array().unwrap();
    let joined = workers.iter().filter(|worker| worker["token"].is_string());
    joined.map(|worker| worker["samples"].as_u64().unwrap()).sum()
}

#[test]
fn joined_workers_and_displays_go_on_with_the_edited_scene_and_after_starting_over() {
    let place = Place::new();
    let truths = Truths::of(&place);
    let words = ["view", "--no-open", "--threads", "1", "--listen", "127.0.0.1:0", "--secure"];
    let identity = ["--identity", "{}/identity"];
    let mut session = place.start(&[&words[..], &identity, &of_scene(), &VIEW].concat());
    let join = session.wait_for_line("join with ");
    // Another machine has no file of the scene, and a cache of its own.
    let other = Place::new();
    let worker = other.start(&["rtworker", "--join", &join, "--threads", "1", "--with-parent"]);
    let elsewhere = ["--vp", "1,2,-1", "--vd", "0,0,1", "--vh", "60", "--size", "96x72"];
    let display = ["view", "--join", &join, "--no-open"];
    let mut display = other.start(&[&display[..], &elsewhere].concat());
    display.write_line("view -vp 2.78 2.73 -2");
    let script = ["view", "--join", &join, "--headless", "--script", "-", "--json"];
    let mut script = other.start(&[&script[..], &VIEW].concat());
    wait_for_worker(&worker, 1);
    wait_to_see(&other, &mut display, &truths, false);
    wait_for_script(&other, &mut script, &truths, false);

    edit(&place, WHITE, PAINTED);
    restart(&mut session);
    session.wait_for_error("goes on with the edited scene");
    wait_for_worker(&worker, 2);
    // From now on, only the joined worker traces.
    session.write_line("kill workers");
    let before = of_joined_workers(&place);
    wait_to_see(&other, &mut display, &truths, true);
    wait_for_script(&other, &mut script, &truths, true);
    wait_until("samples of the joined worker", || {
        (of_joined_workers(&place) > before + 1000).then_some(())
    });
    let info = place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
    assert_eq!(info["generation"], 1);

    session.write_line("start over");
    session.write_line("start over");
    wait_for_worker(&worker, 3);
    wait_to_see(&other, &mut display, &truths, true);
    wait_for_script(&other, &mut script, &truths, true);

    // A server that quits for good takes everyone with it.
    session.write_line("quit");
    session.wait().ok();
    worker.wait().ok();
    display.wait().failed(1, &["the session is over"]);
    script.wait().failed(1, &["the session is over"]);
}

#[test]
fn a_session_on_any_free_port_with_a_public_address_starts_again_at_the_same_port() {
    let place = Place::new();
    let words = ["view", "--no-open", "--threads", "1", "--listen", "127.0.0.1:0", "--secure"];
    let public = ["--public", "holodeck.invalid:1", "--identity", "{}/identity"];
    let mut session = place.start(&[&words[..], &public, &of_scene(), &VIEW].concat());
    let join = session.wait_for_line("join with ");
    let address = session.wait_for_line("listening for other machines on ");
    // The router in between is left out.
    let join = join.replace("holodeck.invalid:1", &address);
    let other = Place::new();
    let worker = other.start(&["rtworker", "--join", &join, "--threads", "1", "--with-parent"]);
    wait_for_worker(&worker, 1);
    session.write_line("start over");
    session.write_line("start over");
    wait_for_worker(&worker, 2);
    edit(&place, WHITE, PAINTED);
    restart(&mut session);
    wait_for_worker(&worker, 3);
    session.write_line("quit");
    session.wait().ok();
    worker.wait().ok();
}
