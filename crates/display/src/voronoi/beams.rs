//! Which beams hold samples of what is seen, besides those that the view's own rays belong to.
//!
//! Light on a diffuse surface is the same from everywhere, so all rays that end on it are worth having: some hundred times as
//! many as pass near the eye.
//!
//! Invariant: the choice is a function of the view and the sections.

use super::Voronoi;
use super::surfaces::{SKY, Seen, Surfaces};
use super::tiles::for_parts;
use glam::DVec3;
use holo_section::{BeamId, Section, ViewClass};

/// Lines tried for each section: of the cabin's living room they find nearly all beams that its views have a use for, in
/// about 20 ms.
const LINES: usize = 200_000;

/// Most beams to ask for: a message has room for a million.
const MOST_BEAMS: usize = 900_000;

impl Voronoi {
    /// Beams whose rays may end on what the view sees, ordered by section and beam, each once.
    pub fn surface_beams(&self) -> Vec<(u16, BeamId)> {
        let points = self.points();
        let mut found = Vec::new();
        if points.is_empty() {
            return found;
        }
        for (number, section) in (0_u16..).zip(self.sections.iter()) {
            let mut lines = vec![None; LINES];
            for_parts(&mut lines, 1, LINES / 64, |part, lines| {
                for (line, number) in lines.iter_mut().zip(part * (LINES / 64)..) {
                    *line = beam(section, &points, number as u64);
                }
            });
            let mut beams: Vec<u64> = lines.into_iter().flatten().collect();
            beams.sort_unstable();
            beams.dedup();
            found.extend(beams.into_iter().map(|beam| (number, BeamId(beam))));
        }
        found.truncate(MOST_BEAMS);
        found
    }

    /// Surface points of the picture and their normals, in the scene.
    fn points(&self) -> Vec<(DVec3, DVec3)> {
        let turn = |v: glam::Vec3| {
            let v = v.as_dvec3();
            self.camera.right * v.x + self.camera.up * v.y + self.camera.forward * v.z
        };
        let points = |Surfaces { seen, images, .. }: &Surfaces| -> Vec<(DVec3, DVec3)> {
            let there = seen.iter().filter(|seen| seen.triangle != SKY);
            let place = |seen: &Seen| {
                let image = images.get(usize::from(seen.image))?;
                let (point, normal) = image.back(seen.position, seen.normal);
                Some((turn(point) + self.camera.eye, turn(normal)))
            };
            there.filter_map(place).collect()
        };
        self.layers.iter().flat_map(|layer| points(&layer.surfaces)).collect()
    }
}

/// The beam of a line from a random point of the section to a random point seen; `None` if none of its rays could show it.
fn beam(section: &Section, points: &[(DVec3, DVec3)], line: u64) -> Option<u64> {
    let random = |salt: u64| {
        let mut z = (line * 4 + salt).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    };
    let (point, normal) = *points.get((random(0) * points.len() as f64) as usize)?;
    let from = section.local_to_world(DVec3::new(random(1), random(2), random(3)));
    let along = point - from;
    if along.dot(normal) >= 0.0 {
        return None;
    }
    let hit = section.line(from, along)?;
    let begins_inside = section.spec().obstructions || section.spec().class == ViewClass::Exterior;
    // The point is at 1; a little past the wall is allowed for walls that coincide.
    (begins_inside || hit.exit_t <= 1.01).then(|| section.beam(hit.pair).0)
}
