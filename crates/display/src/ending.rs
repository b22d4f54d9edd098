//! Which beams hold samples of points that are seen, besides those that the view's own rays belong to.
//!
//! A view crosses 0.2 % of a file's rays, and a fifth of all rays end on what it sees. What stands between a section and such a
//! point is not known here; the further the point is from where rays begin, the likelier something does, so that beams of other
//! rooms' sections come last. (Of the samples of 8,000 beams chosen by the number of their lines alone, 5 to 70 % were used in
//! views of the cabin, and a third of the beams were of each of its three sections; of so many samples chosen this way, 33 to 95 %.)
//!
//! Invariant: the choice is a function of the points and the sections.

use crate::bands::for_bands;
use crate::random::split_mix;
use glam::DVec3;
use holo_section::{BeamId, BeamKey, Section, ViewClass};

/// Lines tried for each section: of the cabin's living room they find nearly all beams that its views have a use for, in
/// about 20 ms.
const LINES: usize = 200_000;

/// Lines tried for each section for a quick look.
const FEW_LINES: usize = 40_000;

/// Sections that get all these lines. More sections share as many lines as these have, so that the
/// time does not grow with their number.
const SECTIONS_IN_FULL: usize = 4;

/// Fewest lines tried for each section, however many there are.
const LEAST_LINES: usize = 512;

/// Distance from where a ray begins at which it counts half, as a share of the shortest section's diagonal.
const NEAR: f64 = 0.2;

/// Weight of a line that begins where it ends.
const FULL_WEIGHT: f64 = 65_536.0;

/// Most beams to ask for: a message has room for a million.
const MOST_BEAMS: usize = 900_000;

/// Parts in which lines are dealt to threads.
const PARTS: usize = 64;

/// A point that is seen, and the normal of its surface on the side that is seen, if that is known.
#[derive(Clone, Copy, Debug)]
pub struct End {
    /// The point, in the scene.
    pub point: DVec3,
    /// The surface's normal on the visible side, if it is known.
    pub normal: Option<DVec3>,
}

/// Beams that have rays which end on one of these points, ordered by section and beam, each once.
///
/// `slack`: how far behind a section's wall points may seem to lie that lie on it, relative to the ray's length.
pub fn beams_ending_on(sections: &[Section], points: &[End], slack: f64) -> Vec<BeamKey> {
    let mut found: Vec<_> =
        by_lines(sections, points, slack, LINES).into_iter().map(|(at, _)| at).collect();
    found.truncate(MOST_BEAMS);
    found
}

/// Those of them of which a quick look finds the most rays that are likely to end there; in the same order.
///
/// As many as have, together, the `most` that is wanted, each `of_one(section)`.
pub fn beams_mostly_ending_on(
    sections: &[Section],
    points: &[End],
    slack: f64,
    most: f64,
    of_one: impl Fn(u16) -> f64,
) -> Vec<BeamKey> {
    let mut found = by_lines(sections, points, slack, FEW_LINES);
    found.sort_by_key(|&(_, weight)| std::cmp::Reverse(weight));
    let mut sum = 0.0;
    let enough = found.iter().position(|(key, _)| {
        sum += of_one(key.section);
        sum > most
    });
    found.truncate(enough.unwrap_or(MOST_BEAMS).min(MOST_BEAMS));
    found.sort_unstable();
    found.into_iter().map(|(at, _)| at).collect()
}

/// Beams that some of so many lines for each section belong to, and how likely rays of theirs are to end there, by their lines' weights.
fn by_lines(sections: &[Section], points: &[End], slack: f64, count: usize) -> Vec<(BeamKey, u32)> {
    let mut found = Vec::new();
    if points.is_empty() {
        return found;
    }
    let near = NEAR * sections.iter().map(Section::diagonal).fold(f64::INFINITY, f64::min);
    let count = lines_per_section(count, sections.len());
    let part_lines = count.div_ceil(PARTS);
    for (number, section) in (0_u16..).zip(sections) {
        let mut lines = vec![None; count];
        for_bands(&mut lines, 1, part_lines, |part, lines| {
            for (line, number) in lines.iter_mut().zip(part * part_lines..) {
                *line = beam(section, points, number as u64, slack, near);
            }
        });
        let mut beams: Vec<(u64, u32)> = lines.into_iter().flatten().collect();
        beams.sort_unstable();
        // Close to the mean, so that many lines that are likely to be blocked do not stand for one that is not; less by half for
        // one line alone, which may be the only one of the beam that ends there.
        let share = |same: &[(u64, u32)]| {
            let all: u64 = same.iter().map(|&(_, weight)| u64::from(weight)).sum();
            (all / (same.len() as u64 + 1)) as u32
        };
        found.extend(
            beams
                .chunk_by(|a, b| a.0 == b.0)
                .map(|same| (BeamKey { section: number, beam: BeamId(same[0].0) }, share(same))),
        );
    }
    found
}

/// Returns how many lines each of `sections` sections gets, if a few of them would get `count`.
fn lines_per_section(count: usize, sections: usize) -> usize {
    let shared = count * SECTIONS_IN_FULL / sections.max(SECTIONS_IN_FULL);
    shared.max(LEAST_LINES.min(count))
}

/// The beam of a line from a random point of the section to a random point seen, and the line's weight; `None` if none of its
/// rays could show it. `near`: distance from where its rays begin at which the weight is half.
fn beam(section: &Section, points: &[End], line: u64, slack: f64, near: f64) -> Option<(u64, u32)> {
    let random = |salt: u64| (split_mix(line * 4 + salt) >> 11) as f64 / (1_u64 << 53) as f64;
    let end = points.get((random(0) * points.len() as f64) as usize)?;
    let from = section.local_to_world(DVec3::new(random(1), random(2), random(3)));
    let along = end.point - from;
    if end.normal.is_some_and(|normal| along.dot(normal) >= 0.0) {
        return None;
    }
    let hit = section.line(from, along)?;
    let begins_inside = section.spec().obstructions || section.spec().class == ViewClass::Exterior;
    // The point is at 1.
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
    fn many_sections_share_the_lines_of_a_few() {
        assert_eq!(lines_per_section(LINES, 1), LINES);
        assert_eq!(lines_per_section(LINES, 4), LINES);
        let all = |sections| sections * lines_per_section(LINES, sections);
        for sections in 5..=1024 {
            assert!(all(sections) <= all(4), "{sections}: {}", all(sections));
        }
        assert_eq!(lines_per_section(FEW_LINES, 100_000), LEAST_LINES);
    }
}
