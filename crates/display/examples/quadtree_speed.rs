//! Times the quadtree driver, as its first thread's time on a core (whole pictures are drawn by all cores): `cargo run --release -p holo-display --example quadtree_speed`.
//!
//! For each kind of samples: insertions, the first picture, one of a burst after 50,000 more samples, one after so many when 33 ms
//! are over, one after a hundred, and those at rest.

#[path = "../tests/common/mod.rs"]
mod common;

use common::*;
use holo_display::{Quadtree, QuadtreeParams, SelectOptions, select_beams};
use holo_section::{BeamId, Sample};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Long enough since the last picture that another is due.
const LATE: Duration = Duration::from_millis(33);
/// New samples that are a burst.
const BURST: usize = 50_000;
/// Times are means of so many: the clock has steps of some milliseconds.
const ROUNDS: u64 = 8;

/// Time this process has had a core, where Linux tells (other programs then do not count), else time passed.
fn processor_time(start: Instant) -> Duration {
    std::fs::read_to_string("/proc/self/schedstat")
        .ok()
        .and_then(|text| text.split_whitespace().next().and_then(|first| first.parse().ok()))
        .map_or_else(|| start.elapsed(), Duration::from_nanos)
}

fn timed<T>(work: impl FnOnce() -> T) -> (T, Duration) {
    let start = Instant::now();
    let before = processor_time(start);
    let result = work();
    (result, processor_time(start) - before)
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
    for size in [(320, 240), (512, 512)] {
        let (section, view) = (room_section(8), room_view(size));
        let (selection, select) =
            timed(|| select_beams(std::slice::from_ref(&section), &view, size, &SelectOptions::default()));
        println!("{size:?}: select {} beams {select:?}", selection.beams.len());
        for (name, noise) in [("clean", clean as Noise), ("1 path", one_path)] {
            for density in [1.0, 4.0, 16.0] {
                let count = (f64::from(size.0 * size.1) * density) as usize;
                let first = packets(near_samples(room, &section, &view, count, 1, noise));
                let (mut tree, new) =
                    timed(|| Quadtree::new(Arc::from([section.clone()]), view, size, QuadtreeParams::default()));
                let ((), inserted) = timed(|| insert(&mut tree, &first));
                let drawn = timed(|| tree.redraw(LATE).is_some()).1;
                let mut times = [Duration::ZERO; 5];
                for seed in 0..ROUNDS {
                    let new = |seed| near_samples(room, &section, &view, BURST + 1000, seed, noise);
                    let (burst, all) = (packets(new(2 * seed + 2)), new(2 * seed + 3));
                    let (few, all) = (packets(all[..100].to_vec()), packets(all));
                    for (time, (samples, since)) in times.iter_mut().zip([
                        (burst.as_slice(), Duration::ZERO),
                        (&all, LATE),
                        (&few, LATE),
                        (&[], LATE),
                        (&[], LATE),
                    ]) {
                        insert(&mut tree, samples);
                        *time += timed(|| tree.redraw(since).is_some()).1 / ROUNDS as u32;
                    }
                }
                let [burst, all, few, whole, none] = times;
                println!(
                    "  {name:6} {density:2} a pixel: new {new:?}; insert {:.1} M/s; first picture {drawn:?}, in a burst of {BURST} {burst:?}, all of \
                     them {all:?}, after 100 {few:?}, at rest {whole:?}, then {none:?}",
                    1e-6 * count as f64 / inserted.as_secs_f64(),
                );
            }
        }
    }
}
