//! Better samples: stored samples that are traced again with more paths.
//!
//! Only the file's extents say how many paths a sample has. So a fill goes on where it was after a
//! restart or a crash. A better packet is an ordinary packet with more paths. Invariants:
//! - Only samples that are uniform in their beam get better. The viewpoint of the others is not
//!   stored, so their rays cannot be made again.
//! - A sample never gets worse, in whatever order results arrive.
//! - The rays stay the same. A better sample's paths begin with those of the sample that it
//!   replaces.

use std::ops::Range;

use holo_proto::MAX_RAYS_PER_PACKET;
use holo_section::{NumberRun, SampleKind};

/// The factor from one level's paths to the next level's. The error halves with each level.
const MORE_PATHS: u32 = 4;

/// Most paths per sample. The error of one path is about its radiance, so that of 16,384 paths is
/// 1/128. An error of 1/128 is one step of a sample's largest channel, which has seven to eight
/// bits.
pub const MOST_PATHS: u16 = 1 << 14;

/// Paths in one packet: some milliseconds of work, 0.2 s at the last level. Longer packets would be
/// lost at the end of a fill, or make displays wait.
const PATHS_PER_PACKET: u32 = 256 * MAX_RAYS_PER_PACKET as u32;

/// Returns the paths per sample of a level, if new samples have `usual` paths (level 0). `None`
/// beyond the last level.
pub fn paths_of(usual: u16, level: u32) -> Option<u16> {
    let times = MORE_PATHS.checked_pow(level)?;
    let paths = u16::try_from(u32::from(usual).checked_mul(times)?).ok()?;
    (level == 0 || paths <= MOST_PATHS).then_some(paths)
}

/// Returns the rays in a packet whose samples have so many paths.
pub fn rays_per_packet(paths: u16) -> u32 {
    (PATHS_PER_PACKET / u32::from(paths.max(1))).clamp(1, MAX_RAYS_PER_PACKET as u32)
}

/// Returns the ranges of `numbers` whose samples are uniform and have fewer than `paths` paths.
///
/// `runs` are the beam's runs in the file. The ranges are in order, and neighbours are joined.
pub fn worse(runs: &[NumberRun], paths: u16, numbers: &Range<u32>) -> Vec<Range<u32>> {
    let mut found: Vec<Range<u32>> = Vec::new();
    for run in runs.iter().filter(|run| run.kind == SampleKind::Uniform && run.paths < paths) {
        let range = run.first.max(numbers.start)..(run.first + run.count).min(numbers.end);
        match found.last_mut() {
            _ if range.is_empty() => {}
            Some(last) if last.end == range.start => last.end = range.end,
            _ => found.push(range),
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use holo_section::{BeamId, BeamKey};

    use super::*;

    #[test]
    fn levels_end_where_a_samples_bytes_hold_no_more() {
        let levels = |usual| (1..).map_while(|level| paths_of(usual, level)).collect::<Vec<_>>();
        assert_eq!(levels(1), [4, 16, 64, 256, 1024, 4096, 16384]);
        assert_eq!(levels(3), [12, 48, 192, 768, 3072, 12288]);
        assert!(levels(4097).is_empty() && levels(u16::MAX).is_empty());
        assert_eq!(paths_of(u16::MAX, 0), Some(u16::MAX));
        for level in 0..1000 {
            let Some(paths) = paths_of(1, level) else { continue };
            assert!((1..=MAX_RAYS_PER_PACKET as u32).contains(&rays_per_packet(paths)));
        }
    }

    #[test]
    fn only_uniform_samples_of_fewer_paths_are_traced_again() {
        let run = |kind, first, count, paths| {
            let key = BeamKey { section: 0, beam: BeamId(1) };
            NumberRun { key, first, count, kind, paths }
        };
        let uniform = SampleKind::Uniform;
        let runs = [
            run(uniform, 0, 10, 1),
            run(uniform, 10, 5, 1),
            run(uniform, 15, 5, 4),
            run(uniform, 20, 5, 16),
            // A gap, as a damaged chunk leaves.
            run(uniform, 30, 5, 4),
            run(uniform, 35, 5, 1),
            run(SampleKind::ViewpointLimited, 0, 50, 1),
        ];
        let all = 0..u32::MAX;
        assert_eq!(worse(&runs, 1, &all), []);
        assert_eq!(worse(&runs, 4, &all), [0..15, 35..40]);
        assert_eq!(worse(&runs, 16, &all), [0..20, 30..40]);
        assert_eq!(worse(&runs, 16, &(12..32)), [12..20, 30..32]);
        assert_eq!(worse(&runs, 16, &(20..30)), []);
    }
}
