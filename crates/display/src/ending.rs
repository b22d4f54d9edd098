//! Which beams hold samples of points that are seen, besides those that the view's own rays belong to.
//!
//! A view crosses 0.2 % of a file's rays, and a fifth of all rays end on what it sees.
//!
//! Invariant: the choice is a function of the points and the sections.

use crate::parts::for_parts;
use glam::DVec3;
use holo_section::{BeamId, Section, ViewClass};

/// Lines tried for each section: of the cabin's living room they find nearly all beams that its views have a use for, in
/// about 20 ms.
const LINES: usize = 200_000;

/// Lines tried for each section for a quick look.
const FEW_LINES: usize = 40_000;

/// Most beams to ask for: a message has room for a million.
const MOST_BEAMS: usize = 900_000;

/// Parts in which lines are dealt to threads.
const PARTS: usize = 64;

/// A point that is seen, and the normal of its surface on the side that is seen, if that is known.
#[derive(Clone, Copy, Debug)]
pub(crate) struct End {
    pub point: DVec3,
    pub normal: Option<DVec3>,
}

/// Beams that have rays which end on one of these points, ordered by section and beam, each once.
///
/// `slack`: how far behind a section's wall points may seem to lie that lie on it, relative to the ray's length.
pub(crate) fn beams_ending_on(sections: &[Section], points: &[End], slack: f64) -> Vec<(u16, BeamId)> {
    let mut found: Vec<_> = by_lines(sections, points, slack, LINES).into_iter().map(|(at, _)| at).collect();
    found.truncate(MOST_BEAMS);
    found
}

/// Those of them, `most` at the most, of which a quick look finds the most rays that end there; in the same order.
pub(crate) fn beams_mostly_ending_on(
    sections: &[Section],
    points: &[End],
    slack: f64,
    most: usize,
) -> Vec<(u16, BeamId)> {
    let mut found = by_lines(sections, points, slack, FEW_LINES);
    found.sort_by_key(|&(_, count)| std::cmp::Reverse(count));
    found.truncate(most);
    found.sort_unstable();
    found.into_iter().map(|(at, _)| at).collect()
}

/// Beams that some of so many lines for each section belong to, and how many of them.
fn by_lines(sections: &[Section], points: &[End], slack: f64, count: usize) -> Vec<((u16, BeamId), usize)> {
    let mut found = Vec::new();
    if points.is_empty() {
        return found;
    }
    let part_lines = count.div_ceil(PARTS);
    for (number, section) in (0_u16..).zip(sections) {
        let mut lines = vec![None; count];
        for_parts(&mut lines, 1, part_lines, |part, lines| {
            for (line, number) in lines.iter_mut().zip(part * part_lines..) {
                *line = beam(section, points, number as u64, slack);
            }
        });
        let mut beams: Vec<u64> = lines.into_iter().flatten().collect();
        beams.sort_unstable();
        found.extend(beams.chunk_by(|a, b| a == b).map(|same| ((number, BeamId(same[0])), same.len())));
    }
    found
}

/// The beam of a line from a random point of the section to a random point seen; `None` if none of its rays could show it.
fn beam(section: &Section, points: &[End], line: u64, slack: f64) -> Option<u64> {
    let random = |salt: u64| {
        let mut z = (line * 4 + salt).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    let end = points.get((random(0) * points.len() as f64) as usize)?;
    let from = section.local_to_world(DVec3::new(random(1), random(2), random(3)));
    let along = end.point - from;
    if end.normal.is_some_and(|normal| along.dot(normal) >= 0.0) {
        return None;
    }
    let hit = section.line(from, along)?;
    let begins_inside = section.spec().obstructions || section.spec().class == ViewClass::Exterior;
    // The point is at 1.
    (begins_inside || hit.exit_t <= 1.0 + slack).then(|| section.beam(hit.pair).0)
}
