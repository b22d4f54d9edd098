//! Whole clusters in this process: a server, workers and displays, on wires that are late, stall
//! and are cut. The clock is a simulated one: it jumps from each event to the next.
//!
//! Each test runs many clusters. A cluster's seed determines what happens on the wires, when, and
//! to which peer. Disks and the threads that read them are real, so a seed does not repeat every
//! step exactly.

// Helpers are tests, too.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

mod cluster;
mod peers;
mod random;
mod truth;
mod wire;

use std::{path::PathBuf, sync::Arc, time::Duration};

use holo_proto::control::RenderSettings;
use holo_section::{SampleKind, SectionSpec, ViewClass};
use tokio::{
    task::JoinSet,
    time::{sleep, timeout},
};

use crate::{
    Goal, about::HolodeckDescription, coordinator::FillOptions, holodeck::Holodeck,
    progress::Totals, shard::Share,
};
use cluster::{Cluster, FOR_EVER};
use peers::{DisplayPlan, WorkerFault, WorkerPlan};
use random::SplitMix;
use truth::{Samples, beam, stored};
use wire::{Cut, Wire};

/// Clusters of each test.
const SEEDS: u64 = 24;

/// Cells along each side of the section: 480 beams.
const GRID: u32 = 2;
const BEAMS: u64 = 480;

/// Threads that read the disk do not follow the simulated clock. This is the largest number of
/// simulated seconds that pass in one real second.
const SPEED: u32 = 1000;

/// Runs a cluster for each seed.
fn for_each_seed<F: Future<Output = ()>>(test: impl Fn(PathBuf, SplitMix) -> F) {
    for seed in 0..SEEDS {
        println!("seed {seed}");
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.holo");
        make(&file);
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_time()
            .start_paused(true)
            .build()
            .unwrap();
        runtime.block_on(async {
            tokio::spawn(async {
                let step = Duration::from_millis(50);
                loop {
                    sleep(step).await;
                    std::thread::sleep(step / SPEED);
                }
            });
            test(file, SplitMix(seed)).await;
        });
    }
}

fn make(file: &std::path::Path) {
    let spec = SectionSpec {
        origin: [0.0; 3],
        axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        grid: [GRID; 3],
        class: ViewClass::Interior,
        obstructions: true,
    };
    let settings = RenderSettings::default();
    let about = HolodeckDescription::new(vec![spec], settings, b"a scene", "a test".into());
    let holodeck = Holodeck::create(file, about, b"a scene", 1 << 20).unwrap();
    assert_eq!(holodeck.sections[0].beam_count(), BEAMS);
}

/// Returns a wire with faults.
fn wire(random: &mut SplitMix) -> Wire {
    let seconds =
        |random: &mut SplitMix, most: u64| Duration::from_millis(random.below(1000 * most));
    let latency = Duration::from_millis(1 + random.below(100));
    let loss = 0.05 * random.unit();
    let stall = (random.below(3) == 0).then(|| (seconds(random, 10), seconds(random, 25)));
    let cut = (random.below(3) == 0).then(|| {
        let how = if random.below(2) == 0 { Cut::Closed } else { Cut::Silent };
        (seconds(random, 20), how)
    });
    Wire { latency, loss, stall, cut }
}

/// Returns a worker with faults.
fn worker(random: &mut SplitMix) -> WorkerPlan {
    let fault = match random.below(4) {
        0 => Some(WorkerFault::Dies(50 + random.below(500))),
        1 => Some(WorkerFault::Hangs(random.below(200), Duration::from_secs(1 + random.below(40)))),
        _ => None,
    };
    WorkerPlan { wire, ray: Duration::from_micros(20 + random.below(5000)), fault }
}

/// Returns a worker without faults, so that there is one which gets things done.
fn sound_worker() -> WorkerPlan {
    let wire = |_: &mut SplitMix| Wire {
        latency: Duration::from_millis(1),
        loss: 0.0,
        stall: None,
        cut: None,
    };
    WorkerPlan { wire, ray: Duration::from_millis(1), fault: None }
}

/// Starts 2 to 8 workers with faults.
fn start_workers(cluster: &Arc<Cluster>, random: &mut SplitMix) -> JoinSet<()> {
    let mut workers = JoinSet::new();
    for number in 0..2 + random.below(7) {
        let (cluster, plan) = (Arc::clone(cluster), worker(random));
        workers.spawn(peers::worker(cluster, number as usize, plan, random.fork()));
    }
    workers
}

/// Starts 1 to 4 displays, each with beams of its own.
fn start_displays(cluster: &Arc<Cluster>, random: &mut SplitMix) -> JoinSet<Samples> {
    let count = 1 + random.below(4);
    let (views, share) = (3, BEAMS / count);
    let mut displays = JoinSet::new();
    for number in 0..count {
        let plan = DisplayPlan {
            wire,
            views,
            first_beam: number * share,
            beams: share / u64::from(views),
            samples: 1 + random.below(1000) as usize,
        };
        let cluster = Arc::clone(cluster);
        displays.spawn(peers::display(cluster, number as usize, plan, random.fork()));
    }
    displays
}

/// Waits for all of them.
async fn all<T: 'static>(mut tasks: JoinSet<T>) -> Vec<T> {
    let mut results = Vec::new();
    while let Some(result) = timeout(FOR_EVER, tasks.join_next()).await.expect("nobody hangs") {
        results.push(result.unwrap());
    }
    results
}

/// Returns what is in a file, which has as many samples as its servers say.
fn checked(file: &std::path::Path, lives: &[Totals]) -> Samples {
    let holodeck = Holodeck::open_read_only(file, 0).unwrap();
    let stats = holodeck.file.stats();
    let added: u64 = lives.iter().map(|totals| totals.added).sum();
    assert_eq!((stats.samples, stats.superseded), (added, 0));
    let stored = stored(&holodeck.file);
    assert_eq!(stored.len() as u64, added);
    stored
}

#[test]
fn displays_get_all_that_is_traced_for_them_and_nothing_is_stored_twice() {
    for_each_seed(|file, mut random| async move {
        let cluster = Arc::new(Cluster::default());
        let goal = Goal::default();
        let mut lives = Vec::new();
        let mut life = cluster.start(&file, None, goal);
        let mut workers = start_workers(&cluster, &mut random);
        workers.spawn(peers::worker(Arc::clone(&cluster), 99, sound_worker(), random.fork()));
        let displays = start_displays(&cluster, &mut random);
        // The server is restarted a few times while all peers continue.
        for _ in 0..random.below(3) {
            sleep(Duration::from_millis(random.below(15_000))).await;
            lives.push(cluster.end(life, true).await);
            sleep(Duration::from_millis(random.below(5_000))).await;
            life = cluster.start(&file, None, goal);
        }
        let seen: Samples = all(displays).await.into_iter().flatten().collect();
        cluster.finish();
        lives.push(cluster.end(life, true).await);
        all(workers).await;
        let stored = checked(&file, &lives);
        // Each of them looked at beams of its own until nothing of these was under way.
        assert_eq!(seen.len(), stored.len());
        assert!(seen == stored && !seen.is_empty());
    });
}

#[test]
fn what_workers_lose_is_traced_by_others_before_a_fill_ends() {
    for_each_seed(|file, mut random| async move {
        let cluster = Arc::new(Cluster::default());
        let fill = FillOptions { enough: Some(1 << 20), share: Share::default() };
        let life = cluster.start(&file, Some(fill), Goal::default());
        let mut broken = start_workers(&cluster, &mut random);
        let displays = start_displays(&cluster, &mut random);
        sleep(Duration::from_secs(5 + random.below(60))).await;
        broken.abort_all();
        let sound =
            tokio::spawn(peers::worker(Arc::clone(&cluster), 99, sound_worker(), random.fork()));
        let seen = all(displays).await;
        // Time enough to find out who has gone, and for one worker to trace what they had.
        sleep(Duration::from_secs(120)).await;
        let lives = [cluster.end(life, true).await];
        cluster.finish();
        timeout(FOR_EVER, sound).await.expect("nobody hangs").unwrap();
        while broken.join_next().await.is_some() {}
        let stored = checked(&file, &lives);
        for (name, sample) in seen.iter().flatten() {
            assert_eq!(stored.get(name), Some(sample), "a display has it, and the file does not");
        }
        for number in 0..BEAMS {
            let kind = SampleKind::Uniform as u8;
            let of_beam = stored.range((beam(number), kind, 0)..=(beam(number), kind, u32::MAX));
            let numbers: Vec<u32> = of_beam.map(|((_, _, number), _)| *number).collect();
            let expected: Vec<u32> = (0..numbers.len() as u32).collect();
            assert_eq!(numbers, expected, "beam {number}");
        }
    });
}
