//! Times the quadtree driver: `cargo run --release -p holo-driver-quadtree --example quadtree_speed`, on one core alone behind `taskset -c 0`.
//!
//! For each kind of samples: a new quadtree, insertions into it and into one whose memory has been used, the first pictures of either, a draft
//! and a whole one, one of a burst after 50,000 more samples, one after so many when 33 ms are over, one after a hundred, and those at rest. Of each
//! the processor time of the first thread, then that of all threads (whole pictures are drawn by all cores), then the time passed, in
//! ms: the least of some rounds. `--json`: a line for each kind of samples, processor time of the first thread only.

#[path = "../tests/common/mod.rs"]
mod common;

use common::*;
use holo_display::{SelectOptions, select_beams};
use holo_driver_quadtree::{Quadtree, QuadtreeParams};
use holo_section::{BeamId, Sample};
use std::fmt::{self, Display, Formatter};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Long enough since the last picture that another is due.
const LATE: Duration = Duration::from_millis(33);
/// New samples that are a burst.
const BURST: usize = 50_000;
/// Times are the least of so many: other programs only add to them.
const ROUNDS: u64 = 4;

/// Times in ms.
#[derive(Clone, Copy)]
struct Times {
    first_thread: f64,
    all_threads: f64,
    passed: f64,
}

impl Times {
    const NONE: Self =
        Self { first_thread: f64::INFINITY, all_threads: f64::INFINITY, passed: f64::INFINITY };

    fn least(self, other: Self) -> Self {
        Self {
            first_thread: self.first_thread.min(other.first_thread),
            all_threads: self.all_threads.min(other.all_threads),
            passed: self.passed.min(other.passed),
        }
    }
}

impl Display for Times {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        write!(f, "{:.2}/{:.2}/{:.2}", self.first_thread, self.all_threads, self.passed)
    }
}

/// Processor time of this thread and of all, where Linux tells: in nanoseconds, where `/proc` has steps of some milliseconds.
#[cfg(target_os = "linux")]
fn processor_times(_: Instant) -> [f64; 2] {
    use rustix::time::{ClockId, clock_gettime};
    [ClockId::ThreadCPUTime, ClockId::ProcessCPUTime].map(|clock| {
        let time = clock_gettime(clock);
        1e3 * time.tv_sec as f64 + 1e-6 * time.tv_nsec as f64
    })
}

/// Time passed, in place of processor time.
#[cfg(not(target_os = "linux"))]
fn processor_times(start: Instant) -> [f64; 2] {
    [1e3 * start.elapsed().as_secs_f64(); 2]
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, Times) {
    let start = Instant::now();
    let before = processor_times(start);
    let result = work();
    let after = processor_times(start);
    let passed = 1e3 * start.elapsed().as_secs_f64();
    (
        result,
        Times { first_thread: after[0] - before[0], all_threads: after[1] - before[1], passed },
    )
}

/// Samples by beam, as they come.
fn packets(mut stored: Vec<Stored>) -> Vec<(BeamId, Vec<Sample>)> {
    stored.sort_by_key(|&(beam, _)| beam);
    let packet = |same: &[Stored]| (same[0].0, same.iter().map(|stored| stored.1).collect());
    stored.chunk_by(|a, b| a.0 == b.0).map(packet).collect()
}

fn insert(tree: &mut Quadtree, packets: &[(BeamId, Vec<Sample>)]) {
    packets.iter().for_each(|(beam, samples)| tree.insert(0, *beam, 1, samples));
}

fn main() {
    let json = std::env::args().skip(1).any(|argument| argument == "--json");
    for size in [(320, 240), (512, 512)] {
        let (section, view) = (room_section(8), room_view(size));
        let (selection, select) = timed(|| {
            select_beams(std::slice::from_ref(&section), &view, size, &SelectOptions::default())
        });
        if !json {
            println!("{size:?}: select {} beams {select}", selection.beams.len());
        }
        for (name, noise) in [("clean", clean as Noise), ("1 path", one_path)] {
            for density in [1.0, 4.0, 16.0] {
                let count = (f64::from(size.0 * size.1) * density) as usize;
                let first = packets(near_samples(room, &section, &view, count, 1, noise));
                let [mut new, mut inserted, mut again] = [Times::NONE; 3];
                let [mut drafted, mut drawn, mut drafted_again, mut drawn_again] = [Times::NONE; 4];
                let mut times = [Times::NONE; 5];
                for round in 0..ROUNDS {
                    let (mut tree, took) = timed(|| {
                        Quadtree::new(
                            Arc::from([section.clone()]),
                            view,
                            size,
                            QuadtreeParams::default(),
                        )
                    });
                    new = new.least(took);
                    inserted = inserted.least(timed(|| insert(&mut tree, &first)).1);
                    drafted = drafted.least(timed(|| tree.redraw(LATE).is_some()).1);
                    drawn = drawn.least(timed(|| tree.redraw(LATE).is_some()).1);
                    let more =
                        |seed| near_samples(room, &section, &view, BURST + 1000, seed, noise);
                    let (burst, all) = (packets(more(2 * round + 2)), more(2 * round + 3));
                    let (few, all) = (packets(all[..100].to_vec()), packets(all));
                    for (time, (samples, since)) in times.iter_mut().zip([
                        (burst.as_slice(), Duration::ZERO),
                        (&all, LATE),
                        (&few, LATE),
                        (&[], LATE),
                        (&[], LATE),
                    ]) {
                        insert(&mut tree, samples);
                        *time = time.least(timed(|| tree.redraw(since).is_some()).1);
                    }
                    tree.reset(view);
                    again = again.least(timed(|| insert(&mut tree, &first)).1);
                    drafted_again = drafted_again.least(timed(|| tree.redraw(LATE).is_some()).1);
                    drawn_again = drawn_again.least(timed(|| tree.redraw(LATE).is_some()).1);
                }
                let [burst, all, few, whole, none] = times;
                let speed = |times: Times| 1e-3 * count as f64 / times.first_thread;
                if json {
                    let (insert, [draft, drawn, burst, whole]) = (
                        speed(again),
                        [drafted_again, drawn_again, burst, whole].map(|times| times.first_thread),
                    );
                    println!(
                        "{{\"size\": \"{}x{}\", \"samples\": \"{name}\", \"a_pixel\": {density}, \"insert_m_per_s\": {insert:.2}, \
                         \"draft_ms\": {draft:.3}, \"whole_ms\": {drawn:.3}, \"burst_ms\": {burst:.3}, \"rest_ms\": {whole:.3}}}",
                        size.0, size.1
                    );
                    continue;
                }
                println!(
                    "  {name:6} {density:2} a pixel: new {new}; insert {:.1} M/s, again {:.1} M/s; draft {drafted}, whole \
                     picture {drawn}, of another view {drafted_again}, {drawn_again}, in a burst of {BURST} {burst}, all of them {all}, after 100 {few}, at rest {whole}, then {none}",
                    speed(inserted),
                    speed(again),
                );
            }
        }
    }
}
