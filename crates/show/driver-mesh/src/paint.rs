//! Draws a mesh as a view sees it.

use glam::DVec3;
use holo_display::{Camera, Frame};
use holo_picture::{View, ViewKind};
use rayon::prelude::*;
use std::ops::Range;

use crate::mesh::LitMesh;
use crate::raster::{PixelSights, ScreenTriangle, rasterise};
use crate::seen::{SeenVertex, seen_vertices};
use crate::smooth::smooth;

/// A triangle of a view that is no perspective has curved edges. They may lie this share of its size
/// outside of its corners.
const BULGE: f32 = 0.25;
/// A triangle over this share of a picture with curved edges may be anywhere.
const LARGE: f32 = 0.25;

/// Largest error of a vertex's place in the picture, pixels.
const SLACK: f32 = 0.01;

/// A view to draw meshes into.
pub struct MeshPainter {
    view: View,
    camera: Camera,
    rays: PixelSights,
}

impl MeshPainter {
    pub fn new(view: &View, size: (u32, u32)) -> MeshPainter {
        let (camera, width) = (Camera::new(view, size), view.extent().0);
        let has_eye = view.kind.has_eye();
        let sight = |pixel: u32| {
            let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
            let Some((origin, direction)) = view.try_ray(x, y) else { return DVec3::ZERO };
            if has_eye {
                return camera.to_camera(direction);
            }
            let place = camera.to_camera(origin - camera.eye);
            DVec3::new(place.x / width, place.y / width, 1.0)
        };
        let sights = (0..size.0 * size.1).into_par_iter().map(sight).collect();
        MeshPainter { view: *view, camera, rays: PixelSights::new(size, sights, has_eye) }
    }

    /// Draws a mesh.
    pub fn paint(&self, mesh: &LitMesh) -> Frame {
        let width = self.view.extent().0;
        let mut seen = seen_vertices(mesh, &self.camera, width);
        smooth(mesh, &mut seen);
        let pixels: Vec<Option<(f32, f32)>> =
            seen.par_iter().map(|seen| self.pixel(seen.as_ref()?)).collect();
        let corners: Vec<[u32; 3]> = mesh.triangles.triangles().collect();
        let triangle = |&corners: &[u32; 3]| {
            let bounds = self.bounds(corners, &pixels)?;
            let lit = completed(corners, &seen, mesh, &self.camera)?;
            ScreenTriangle::new(lit, bounds)
        };
        let triangles: Vec<ScreenTriangle> = corners.par_iter().filter_map(triangle).collect();
        let fragments = rasterise(&triangles, &self.rays);
        let mut frame = Frame::black(self.rays.size);
        frame.picture.view = Some(self.view);
        for ((pixel, depth), fragment) in
            frame.picture.pixels.iter_mut().zip(&mut frame.depth).zip(fragments)
        {
            if fragment.nearness >= 0.0 {
                // 1 / 0 is the infinite depth of the sky.
                (*pixel, *depth) = (fragment.colour, fragment.nearness.recip());
            }
        }
        frame
    }

    /// Returns where the picture shows a vertex, pixels from its left and from its top.
    fn pixel(&self, seen: &SeenVertex) -> Option<(f32, f32)> {
        let sight = if self.rays.has_eye {
            seen.sight
        } else {
            let width = self.view.extent().0;
            DVec3::new(seen.sight.x * width, seen.sight.y * width, 1.0)
        };
        self.camera.project(sight).map(|(x, y)| (x as f32, y as f32))
    }

    /// Returns the columns and rows that a triangle may reach; `None` if there are none.
    fn bounds(
        &self,
        corners: [u32; 3],
        pixels: &[Option<(f32, f32)>],
    ) -> Option<(Range<u32>, Range<u32>)> {
        let (width, height) = self.rays.size;
        let [Some(a), Some(b), Some(c)] = corners.map(|corner| pixels[corner as usize]) else {
            return Some((0..width, 0..height));
        };
        let range = |a: f32, b: f32, c: f32, size: u32| {
            let (mut from, mut to) = (a.min(b).min(c), a.max(b).max(c));
            // A parallel view, like a perspective, has straight edges.
            if !matches!(self.view.kind, ViewKind::Perspective | ViewKind::Parallel) {
                let bulge = (to - from) * BULGE + 1.0;
                if to - from > LARGE * size as f32 {
                    return 0..size;
                }
                (from, to) = (from - bulge, to + bulge);
            }
            // The first and last columns whose middles are between them. Places are rounded.
            let limit = |at: f32| at.ceil().clamp(0.0, size as f32) as u32;
            limit(from - 0.5 - SLACK)..limit(to - 0.5 + SLACK)
        };
        let (columns, rows) = (range(a.0, b.0, c.0, width), range(a.1, b.1, c.1, height));
        (!columns.is_empty() && !rows.is_empty()).then_some((columns, rows))
    }
}

/// Returns the corners of a triangle. A corner of the icosahedron without samples takes the light of
/// the others, so that the mesh does not end before the picture does. `None` if no corner has light.
fn completed(
    corners: [u32; 3],
    seen: &[Option<SeenVertex>],
    mesh: &LitMesh,
    camera: &Camera,
) -> Option<[SeenVertex; 3]> {
    let seen = corners.map(|corner| seen[corner as usize]);
    let mut lit: Vec<SeenVertex> = seen.into_iter().flatten().collect();
    lit.sort_unstable_by_key(|seen| seen.order);
    // The nearest one: the sum over others of different depths would be at no surface.
    let given = lit.iter().copied().reduce(|a, b| if b.nearness > a.nearness { b } else { a })?;
    let corner = |at: usize| {
        seen[at].unwrap_or_else(|| {
            let order = mesh.triangles.direction(corners[at]);
            let unit = order.unit();
            let sight = if mesh.chart.has_eye() { camera.to_camera(unit) } else { mirrored(unit) };
            SeenVertex { sight, order, ..given }
        })
    };
    Some([corner(0), corner(1), corner(2)])
}

/// Converts a direction of the chart of a parallel view to camera coordinates.
fn mirrored(unit: DVec3) -> DVec3 {
    DVec3::new(-unit.x, unit.y, unit.z)
}
