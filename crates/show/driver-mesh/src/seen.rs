//! The vertices of a mesh as a view sees them, and which of them a nearer surface hides.
//!
//! Invariant: everything here is a function of the set of vertices, not of their numbers.

use glam::DVec3;
use holo_display::Camera;
use rayon::prelude::*;

use crate::chart::RayEnd;
use crate::direction::GridDirection;
use crate::mesh::LitMesh;

/// Depths that differ by this share are a jump at any angle (Larson & Simmons 1999, §2.4.4).
const JUMP: f64 = 0.02;
/// A surface may be so oblique that its depth grows by this share for each radian between two
/// vertices: it is seen at 7°. Steeper ones are a jump.
const STEEPEST: f64 = 8.0;
/// Fewest neighbours in front of a vertex that can surround it.
const FEWEST_AROUND: usize = 3;

/// A vertex as a view sees it.
#[derive(Clone, Copy, Debug)]
pub struct SeenVertex {
    /// Direction from the eye in camera coordinates, a unit vector. In a parallel view: the place in
    /// the picture, in widths from its middle, and 1.
    pub sight: DVec3,
    /// 1 / distance from the eye; 0 for the sky.
    pub nearness: f64,
    /// Radiance.
    pub colour: [f32; 3],
    /// Number of its samples.
    pub count: f32,
    /// Direction from the canonical eye: the order of vertices.
    pub order: GridDirection,
    /// True if the eye sees it for certain.
    pub is_near: bool,
}

/// The least distance from an eye, scene units, so that its inverse is finite.
const LEAST: f64 = 1e-30;

/// Returns the vertices with light, by number.
pub fn seen_vertices(mesh: &LitMesh, camera: &Camera, width: f64) -> Vec<Option<SeenVertex>> {
    let has_eye = mesh.chart.has_eye();
    let see = |light: &Option<crate::cells::VertexLight>| {
        let light = (*light)?;
        let end = mesh.chart.end(light.direction, f64::from(light.depth));
        let is_far = light.depth.is_infinite();
        let (sight, nearness) = match end {
            RayEnd::Sky(direction) => (camera.to_camera(direction), 0.0),
            RayEnd::Point(point) => {
                let point = camera.to_camera(point - camera.eye);
                let distance = if has_eye { point.length() } else { point.z }.max(LEAST);
                let sight = if has_eye {
                    point / distance
                } else {
                    DVec3::new(point.x / width, point.y / width, 1.0)
                };
                (sight, if is_far { 0.0 } else { 1.0 / distance })
            }
        };
        let (order, colour, is_near) = (light.direction, light.colour, light.is_near);
        let count = light.count as f32;
        Some(SeenVertex { sight, nearness, colour, count, order, is_near })
    };
    let mut seen: Vec<Option<SeenVertex>> = mesh.lights.par_iter().map(see).collect();
    // A vertex behind others that are hidden themselves is found in the second round.
    for _ in 0..2 {
        let covers: Vec<Option<SeenVertex>> = (0..seen.len() as u32)
            .into_par_iter()
            .map(|vertex| hidden_by(mesh, &seen, vertex))
            .collect();
        for (vertex, cover) in seen.iter_mut().zip(covers) {
            if cover.is_some() {
                *vertex = cover;
            }
        }
    }
    seen
}

/// Returns whether a surface cannot connect two vertices.
pub fn is_jump(a: &SeenVertex, b: &SeenVertex) -> bool {
    let [near, far] = [a.nearness.max(b.nearness), a.nearness.min(b.nearness)];
    // The depths' difference, as a share of the lesser one.
    let angle = (a.sight - b.sight).length();
    near - far > far * (JUMP + STEEPEST * angle)
}

/// Returns what a vertex shows if nearer ones surround it: a surface that they are on. `None` if it
/// is not hidden.
fn hidden_by(mesh: &LitMesh, seen: &[Option<SeenVertex>], number: u32) -> Option<SeenVertex> {
    let vertex = seen[number as usize].filter(|vertex| !vertex.is_near)?;
    let mut in_front: Vec<(u32, SeenVertex)> = Vec::new();
    mesh.triangles.for_neighbours(number, |other| {
        let nearer = seen[other as usize].filter(|other| other.nearness > vertex.nearness);
        in_front.extend(nearer.filter(|other| is_jump(&vertex, other)).map(|seen| (other, seen)));
    });
    let follows = |at: usize| in_front[(at + 1) % in_front.len()].0;
    let surround = in_front.len() >= FEWEST_AROUND
        && (0..in_front.len())
            .all(|at| mesh.triangles.is_left([number, in_front[at].0, follows(at)]));
    if !surround {
        return None;
    }
    in_front.sort_unstable_by_key(|(_, seen)| seen.order);
    let share = 1.0 / in_front.len() as f64;
    let mut cover = SeenVertex { nearness: 0.0, colour: [0.0; 3], count: 1.0, ..vertex };
    for (_, seen) in &in_front {
        cover.nearness += share * seen.nearness;
        for (sum, channel) in cover.colour.iter_mut().zip(seen.colour) {
            *sum += share as f32 * channel;
        }
    }
    Some(cover)
}
