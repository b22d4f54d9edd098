//! Workers that are killed and stopped again and again, in an order that looks random.

use holo_tests::{Place, Process, stored, wait_until};
use rustix::process::Signal;

use crate::interrupted::count;

/// Faults in one test: enough that each meets workers in several states.
const FAULTS: u32 = 16;

/// Does something to the workers of a server after each few thousand samples. A stopped one goes on
/// after two other faults.
fn harass(place: &Place, start: impl Fn() -> Process, mut seed: u32) -> Vec<Process> {
    let file = place.path("a.holo");
    let mut workers: Vec<Process> = (0..3).map(|_| start()).collect();
    let mut stopped: Vec<(u32, usize)> = Vec::new();
    for fault in 0..FAULTS {
        let then = count(&file);
        wait_until("more samples", || (count(&file) > then + 2_000).then_some(()));
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let victim = (seed >> 16) as usize % workers.len();
        let is_stopped = stopped.iter().any(|(_, at)| *at == victim);
        match seed >> 30 {
            // The last working worker must not stop, because no other would trace.
            0 | 1 if !is_stopped && stopped.len() < 2 => {
                workers[victim].signal(Signal::STOP);
                stopped.push((fault, victim));
            }
            _ => {
                stopped.retain(|(_, at)| *at != victim);
                let dead = std::mem::replace(&mut workers[victim], start());
                assert_eq!(dead.end(Signal::KILL).signal(), Some(9));
            }
        }
        stopped.retain(|(since, at)| {
            let goes_on = fault >= since + 2;
            if goes_on {
                workers[*at].signal(Signal::CONT);
            }
            !goes_on
        });
    }
    stopped.iter().for_each(|(_, at)| workers[*at].signal(Signal::CONT));
    workers
}

#[test]
fn a_fill_whose_workers_are_killed_and_stopped_loses_nothing_and_stores_nothing_twice() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let server = place.server("a.holo", &["--fill", "--json"]);
    let mut workers = harass(&place, || place.worker(server.address, &[]), 1);
    // The surviving worker traces the packets of the dead ones.
    workers.truncate(1);
    let file = place.path("a.holo");
    wait_until("all numbers", || stored(&file).gap().is_none().then_some(()));
    let summary = server.process.end(Signal::TERM).ok().json();
    let stored = stored(&file);
    assert_eq!(summary["samples"], stored.count());
    stored.assert_no_gaps();
    place.run(&["verify", "{}/a.holo"]).ok();
}

#[test]
fn a_walk_whose_workers_are_killed_and_stopped_goes_on() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let server = place.server("a.holo", &["--fill", "--json"]);
    let viewer = place.viewer(server.address, &["--time", "600", "--size", "64x64"]);
    let workers = harass(&place, || place.worker(server.address, &[]), 3);
    assert!(viewer.end(Signal::INT).code().is_some(), "it is not killed");
    let summary = server.process.end(Signal::TERM).ok().json();
    assert_eq!(summary["samples"], stored(&place.path("a.holo")).count());
    drop(workers);
}
