//! Which beams hold samples of what is seen, besides those that the view's own rays belong to.
//!
//! A view crosses 0.2 % of a file's rays, and a fifth of all rays end on what it sees. Light on diffuse surfaces is the same from
//! everywhere; where it is not, drawing finds out and does without ([`wide`](super::wide)).
//!
//! Invariant: the choice is a function of the view, the sections and the samples so far, not of their order.

use super::Quadtree;
use glam::DVec3;
use holo_section::{BeamId, Section, ViewClass};

/// Lines tried for each section: as many as `voronoi` tries.
const LINES: u64 = 200_000;
/// One point is taken from each square of so many pixels a side.
const APART: usize = 4;
/// Beams to ask for at most: a message has room for a million.
const MOST_BEAMS: usize = 900_000;

impl Quadtree {
    /// Beams whose rays may end on what the picture shows, ordered by section and beam, each once. None while nothing is shown.
    ///
    /// Takes a drawing and some 30 ms for each section: to be asked once, when the view's own samples are here.
    pub fn surface_beams(&self) -> Vec<(u16, BeamId)> {
        let points = self.points();
        let mut found = Vec::new();
        if points.is_empty() {
            return found;
        }
        for (number, section) in (0_u16..).zip(self.sections.iter()) {
            let mut beams: Vec<u64> = (0..LINES).filter_map(|line| beam(section, &points, line)).collect();
            beams.sort_unstable();
            beams.dedup();
            found.extend(beams.into_iter().map(|beam| (number, BeamId(beam))));
        }
        found.truncate(MOST_BEAMS);
        found
    }

    /// Points of the scene that the picture shows, spread over it.
    fn points(&self) -> Vec<DVec3> {
        let depth = self.draw().depth;
        let width = self.size.0 as usize;
        let shown = self.middles().zip(depth).enumerate().filter_map(|(pixel, ((eye, along), depth))| {
            let apart = (pixel % width).is_multiple_of(APART) && (pixel / width).is_multiple_of(APART);
            (apart && depth > 0.0 && depth.is_finite()).then(|| eye + along * f64::from(depth))
        });
        shown.collect()
    }
}

/// The beam of a line from a random point of the section to a random point seen; `None` if none of its rays could show it.
fn beam(section: &Section, points: &[DVec3], line: u64) -> Option<u64> {
    let random = |salt: u64| {
        let mut z = (line * 4 + salt).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    let point = *points.get((random(0) * points.len() as f64) as usize)?;
    let from = section.local_to_world(DVec3::new(random(1), random(2), random(3)));
    let hit = section.line(from, point - from)?;
    let begins_inside = section.spec().obstructions || section.spec().class == ViewClass::Exterior;
    // The point is at 1. Depths are known to 1.6 %, and walls may coincide with the section's.
    (begins_inside || hit.exit_t <= 1.04).then(|| section.beam(hit.pair).0)
}
