//! Better samples: the numbers that a beam has already, traced again with more paths (design: enough is enough).
//!
//! What paths a sample has is read from the file's extents, and nothing else knows it: after a restart or a crash a fill
//! goes on where it was. A better packet is an ordinary packet but for its paths. What always holds:
//! - only samples that are uniform in their beam get better: of the others the viewpoint is not stored, so their rays
//!   cannot be made again;
//! - a sample never gets worse, whatever order results arrive in;
//! - the rays stay the same, and a better sample's paths begin with those of the one that it supersedes.

use std::ops::Range;

use holo_proto::MAX_RAYS_PER_PACKET;
use holo_section::{Run, SampleKind};

/// How many times the paths of the level before a level has. An error halves; and so much more often does each byte of
/// the file stand for the work that went into it.
const MORE_PATHS: u32 = 4;

/// Paths per sample at the most. A path's error is about what it carries, so that of 16,384 is 1/128: a step of a
/// sample's largest channel, which has seven to eight bits.
pub const MOST_PATHS: u16 = 1 << 14;

/// Paths in one packet, about: some milliseconds of work, 0.2 s at the last level. Longer packets would be lost at the
/// end of a fill, or make displays wait.
const PATHS_PER_PACKET: u32 = 256 * MAX_RAYS_PER_PACKET as u32;

/// Paths per sample of a level, where samples have `usual` paths at first; level 0 are these. `None` beyond the last.
pub fn paths_of(usual: u16, level: u32) -> Option<u16> {
    let times = MORE_PATHS.checked_pow(level)?;
    let paths = u16::try_from(u32::from(usual).checked_mul(times)?).ok()?;
    (level == 0 || paths <= MOST_PATHS).then_some(paths)
}

/// Rays in a packet whose samples have so many paths.
pub fn rays_per_packet(paths: u16) -> u32 {
    (PATHS_PER_PACKET / u32::from(paths.max(1))).clamp(1, MAX_RAYS_PER_PACKET as u32)
}

/// Which of `numbers` are stored with fewer than `paths` paths and uniform in the beam, in order, neighbours joined. `runs` is
/// what the file says of the beam.
pub fn worse(runs: &[Run], paths: u16, numbers: &Range<u32>) -> Vec<Range<u32>> {
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
            Run { key, first, count, kind, paths }
        };
        let uniform = SampleKind::Uniform;
        let runs = [
            run(uniform, 0, 10, 1),
            run(uniform, 10, 5, 1),
            run(uniform, 15, 5, 4),
            run(uniform, 20, 5, 16),
            // A gap: a damaged chunk.
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
