//! Finds beams whose rays end on visible points, besides the beams that the view crosses.
//!
//! A view crosses 0.2 % of a file's rays, but a fifth of all rays end on surfaces that it sees.
//! Random lines from each section to visible points find such beams. This module does not know
//! which lines are blocked. A long gap between a ray's start and the point makes this likely, so
//! lines with long gaps have little weight (figures: docs/notes/surface-beams.md).
//!
//! Invariant: the choice is a function of the points and the sections.

use crate::random::split_mix;
use glam::DVec3;
use holo_section::{BeamId, BeamKey, Section, ViewClass};
use rayon::prelude::*;
use std::cmp::Reverse;

/// The thoroughness of a search.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Search {
    /// Finds the most useful beams in about 10 ms for each section.
    Quick,
    /// Finds nearly all useful beams, and takes five times as long.
    Thorough,
}

/// Lines tried for each section by a thorough search.
const LINES: usize = 200_000;

/// Lines tried for each section by a quick search.
const FEW_LINES: usize = 40_000;

/// Most beams that a quick search returns. A server finds this many in a file in about 20 ms.
const BEST_BEAMS: usize = 20_000;

/// Most sections that get all these lines. More sections share the lines of this many, so that the
/// time does not grow with their number.
const SECTIONS_IN_FULL: usize = 4;

/// Fewest lines for each section, however many sections there are.
const LEAST_LINES: usize = 512;

/// Gap between a ray's start and the point at which the line's weight is half, relative to the
/// shortest diagonal of a section.
const NEAR: f64 = 0.2;

/// Weight of a line whose ray starts at the point.
const FULL_WEIGHT: f64 = 65_536.0;

/// Most beams to return: a request has room for a million.
const MOST_BEAMS: usize = 900_000;

/// A visible point.
#[derive(Clone, Copy, Debug)]
pub struct VisibleEnd {
    /// The point, in the scene.
    pub point: DVec3,
    /// The normal of its surface on the visible side, if it is known.
    pub normal: Option<DVec3>,
}

/// A beam, and how useful its samples are: in (0, 1].
pub type UsefulBeam = (BeamKey, f32);

/// A search for useful beams, which may run on any thread. It returns them in the order of their
/// keys, each once.
pub type BeamSearch = Box<dyn FnOnce() -> Vec<UsefulBeam> + Send>;

/// Returns beams with rays that end on one of these points, ordered by section and beam, each once.
/// Beams whose rays are likelier to end there are more useful.
///
/// A point on a section's wall may seem to lie behind the wall because of rounding. `slack` is the
/// largest such error, relative to the ray's length.
pub fn beams_ending_on(
    sections: &[Section],
    points: &[VisibleEnd],
    slack: f64,
    search: Search,
) -> Vec<UsefulBeam> {
    let lines = if search == Search::Quick { FEW_LINES } else { LINES };
    let mut found = by_lines(sections, points, slack, lines);
    if search == Search::Quick && found.len() > BEST_BEAMS {
        found.select_nth_unstable_by_key(BEST_BEAMS, |&(key, weight)| (Reverse(weight), key));
        found.truncate(BEST_BEAMS);
        found.par_sort_unstable();
    }
    found.truncate(MOST_BEAMS);
    let useful = |weight: u32| (f64::from(weight.max(1)) / FULL_WEIGHT) as f32;
    found.into_iter().map(|(key, weight)| (key, useful(weight))).collect()
}

/// Tries `count` lines for each section. Returns the beams of these lines. Their weights grow with
/// the probability that their rays end on the points.
fn by_lines(
    sections: &[Section],
    points: &[VisibleEnd],
    slack: f64,
    count: usize,
) -> Vec<(BeamKey, u32)> {
    if points.is_empty() {
        return Vec::new();
    }
    let near = NEAR * sections.iter().map(Section::diagonal).fold(f64::INFINITY, f64::min);
    let count = lines_per_section(count, sections.len());
    // Nearly the mean, so that many lines that are probably blocked do not outweigh one that is
    // free. A line alone counts half: it may be the beam's only ray that ends on a point.
    let share = |same: &[(u64, u32)]| {
        let all: u64 = same.iter().map(|&(_, weight)| u64::from(weight)).sum();
        (all / (same.len() as u64 + 1)) as u32
    };
    let of_section = |(number, section): (usize, &Section)| -> Vec<(BeamKey, u32)> {
        let lines = (0..count).into_par_iter();
        let beam = |line| beam(section, points, line as u64, slack, near);
        let mut beams: Vec<(u64, u32)> = lines.filter_map(beam).collect();
        beams.par_sort_unstable();
        let key = |beam| BeamKey { section: number as u16, beam: BeamId(beam) };
        beams.chunk_by(|a, b| a.0 == b.0).map(|same| (key(same[0].0), share(same))).collect()
    };
    let found: Vec<_> = sections.par_iter().enumerate().map(of_section).collect();
    found.concat()
}

/// Returns the number of lines for each of `sections` sections, if a few sections get `count` each.
fn lines_per_section(count: usize, sections: usize) -> usize {
    let shared = count * SECTIONS_IN_FULL / sections.max(SECTIONS_IN_FULL);
    shared.max(LEAST_LINES.min(count))
}

/// Returns the beam and the weight of a line from a random point of the section to a random visible
/// point. `None` if no ray of the beam can show the point.
///
/// `near` is the gap at which a line's weight is half, scene units.
fn beam(
    section: &Section,
    points: &[VisibleEnd],
    line: u64,
    slack: f64,
    near: f64,
) -> Option<(u64, u32)> {
    let random = |salt: u64| (split_mix(line * 4 + salt) >> 11) as f64 / (1_u64 << 53) as f64;
    let end = points.get((random(0) * points.len() as f64) as usize)?;
    let from = section.local_to_world(DVec3::new(random(1), random(2), random(3)));
    let along = end.point - from;
    if end.normal.is_some_and(|normal| along.dot(normal) >= 0.0) {
        return None;
    }
    let hit = section.line(from, along)?;
    let begins_inside = section.spec().obstructions || section.spec().class == ViewClass::Exterior;
    // The visible point is at parameter 1 of the line.
    if !begins_inside && hit.exit_t > 1.0 + slack {
        return None;
    }
    let begin = if begins_inside { hit.entry_t } else { hit.exit_t };
    let gap = (1.0 - begin).max(0.0) * along.length() / near;
    Some((section.beam(hit.pair).0, (FULL_WEIGHT / (1.0 + gap * gap)).max(1.0) as u32))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_lines_does_not_grow_with_many_sections() {
        assert_eq!(lines_per_section(LINES, 1), LINES);
        assert_eq!(lines_per_section(LINES, 4), LINES);
        let all = |sections| sections * lines_per_section(LINES, sections);
        for sections in 5..=1024 {
            assert!(all(sections) <= all(4), "{sections}: {}", all(sections));
        }
        assert_eq!(lines_per_section(LINES, 10_000_000), LEAST_LINES);
    }
}
