//! One pass of rays through the cells of a layer.

use glam::{DVec3, Vec3};
use holo_display::{Frame, mix};
use holo_picture::View;
use holo_raycast::Hit;

use super::cells::{CellGrid, LayerCell, Touch};
use super::deflected::DeflectedRays;
use crate::numbers::PassNumbers;
use crate::room::{Room, RoomSurface};
use crate::shading::{LightDetail, SeenObject, Shader};
use crate::shadow::Shadowed;
use crate::sheen::RoomSheen;

/// Relative difference of distances within which an object is in front of what a frame shows there.
const NEARLY: f64 = 1e-3;

/// What all cells of a layer share.
pub(super) struct LayerScene<'a> {
    pub shader: Shader<'a>,
    pub frame: &'a Frame,
    pub view: &'a View,
    pub grid: CellGrid,
    pub touch: Touch,
    /// Width of a ray at its beginning, and its growth with the distance.
    pub width: (f32, f32),
}

impl LayerScene<'_> {
    /// Adds a pass to a cell.
    pub(super) fn add(&self, cell: &mut LayerCell, pass: u32) {
        let (column, row) = self.grid.place(cell.column, cell.row);
        let number = row * self.grid.size.0 + column;
        let mut numbers = PassNumbers::new(mix(1, number), pass);
        let is_quick = self.shader.detail == LightDetail::Quick;
        let (dx, dy) = if is_quick { (0.5, 0.5) } else { numbers.two() };
        let (width, height) = (f64::from(self.grid.size.0), f64::from(self.grid.size.1));
        let x = (f64::from(column) + f64::from(dx)) / width;
        let y = 1.0 - (f64::from(row) + f64::from(dy)) / height;
        let (mut through, mut left) = (Vec3::ONE, Vec3::ONE);
        let mut object_distance = f64::INFINITY;
        if let Some((origin, direction, reach)) = self.view.clipped_ray(x, y) {
            let radiance = Vec3::from(self.frame.picture.pixels[number as usize]);
            // Quick frames trust the distances of the frame.
            let room = self.shader.room.filter(|_| !is_quick);
            // The glossy surfaces along the ray, each with the share of its light that comes here.
            let mut sheens = Vec::new();
            let mut take = |sheen: RoomSheen, left: Vec3| sheens.push((sheen, left));
            let known = room.map(|room| match cell.may_gleam {
                true => (room, room.sheens((origin, direction), f64::INFINITY, &mut take).1),
                false => (room, room.nearest(origin, direction)),
            });
            // Distances of frames begin at the eye, also if the view is clipped.
            let clipped = self.view.ray_to(origin).0.distance(origin);
            let depth = f64::from(self.frame.depth[number as usize]) - clipped;
            let behind = match &known {
                Some((_, hit)) => hit.map_or(f64::INFINITY, |(_, distance)| distance),
                None if depth > 0.0 => depth,
                None => f64::INFINITY,
            };
            let seen = match cell.may_show {
                true => self.shader.seen(origin, direction, self.width, &mut numbers),
                false => None,
            };
            let in_front = |seen: &SeenObject| seen.distance < (behind * (1.0 + NEARLY)).min(reach);
            if let Some(seen) = seen.filter(in_front) {
                (through, object_distance) = (seen.through, seen.distance);
                cell.radiance += self.behind_panes((origin, direction), &seen, &mut numbers);
                cell.seen += 1;
                cell.distance += (seen.distance + clipped) as f32;
            }
            if through != Vec3::ZERO && cell.may_shadow && behind.is_finite() {
                let place = origin + direction * behind;
                left = match (self.shader.room, known) {
                    (Some(room), known) => {
                        let hit = known.map_or_else(|| room.nearest(origin, direction), |k| k.1);
                        let width = self.width.0 + self.width.1 * behind as f32;
                        let surface =
                            hit.and_then(|(hit, _)| room.surface(&hit, direction.as_vec3(), width));
                        surface.map_or(Vec3::ONE, |surface| {
                            self.left_of(room, &surface, radiance, &mut numbers)
                        })
                    }
                    (None, _) => self.left_at((column, row), place, &mut numbers),
                };
            }
            if through != Vec3::ZERO && cell.may_mirror {
                let hit = known.map_or_else(|| self.room_hit(origin, direction), |known| known.1);
                let light = (radiance, through);
                left *= self.add_deflected(cell, (origin, direction), hit, light, &mut numbers);
            }
            for (sheen, left) in &sheens {
                let is_behind = origin.distance(sheen.origin) > object_distance;
                let left = if is_behind { *left * through } else { *left };
                if left != Vec3::ZERO
                    && let Some((room, _)) = known
                {
                    cell.radiance += left * self.gleam(room, sheen, &mut numbers);
                }
            }
        }
        cell.behind += through * left;
    }

    fn room_hit(&self, origin: DVec3, direction: DVec3) -> Option<(Hit, f64)> {
        self.shader.room.and_then(|room| room.nearest(origin, direction))
    }

    /// Returns the radiance of an object along a ray, through the panes of the room before it. The
    /// panes' own reflections replace what the object hides of the frame.
    fn behind_panes(
        &self,
        (origin, direction): (DVec3, DVec3),
        seen: &SeenObject,
        numbers: &mut PassNumbers,
    ) -> Vec3 {
        let Some(room) = self.shader.room.filter(|room| room.has_panes()) else {
            return seen.radiance;
        };
        let lit = &self.shader.objects[seen.object];
        let mut reflected = Vec3::ZERO;
        let (left, _) = room.sheens((origin, direction), seen.distance, |sheen, left| {
            if let Some((towards, share)) = sheen.reflected(numbers) {
                reflected += left * share * lit.light_without(sheen.origin, towards, sheen.alpha);
            }
        });
        left * seen.radiance + (Vec3::ONE - seen.through) * reflected
    }

    /// Estimates how much brighter a glossy surface of the room is by what it shows of objects:
    /// their light, less that of the room behind them.
    fn gleam(&self, room: &Room, sheen: &RoomSheen, numbers: &mut PassNumbers) -> Vec3 {
        let Some((towards, share)) = sheen.reflected(numbers) else { return Vec3::ZERO };
        let seen = self.shader.seen(sheen.origin, towards.as_dvec3(), self.width, numbers);
        let Some(seen) = seen else { return Vec3::ZERO };
        let behind = room.nearest(sheen.origin, towards.as_dvec3());
        if behind.is_some_and(|(_, distance)| distance < seen.distance) {
            return Vec3::ZERO;
        }
        let lit = &self.shader.objects[seen.object];
        let hidden = lit.light_without(sheen.origin, towards, sheen.alpha);
        share * (seen.radiance + (seen.through - Vec3::ONE) * hidden)
    }

    /// Adds what mirrors and solid glass show of objects along a ray to a cell. `hit` is what the
    /// ray meets. Returns the share that is left of what they show of the room. `radiance` is what
    /// the frame shows there, and `through` the share of it that objects in front leave.
    fn add_deflected(
        &self,
        cell: &mut LayerCell,
        ray: (DVec3, DVec3),
        hit: Option<(Hit, f64)>,
        (radiance, through): (Vec3, Vec3),
        numbers: &mut PassNumbers,
    ) -> Vec3 {
        let Some(room) = self.shader.room.filter(|_| cell.may_mirror) else { return Vec3::ONE };
        let (mut left, mut colour) = (Vec3::ONE, Vec3::ONE);
        // What glass reflects: the share of light, the place and the direction.
        let mut reflections = Vec::new();
        for (ray, hit) in DeflectedRays::new(room, ray, hit) {
            let reflection = ray.reflection;
            reflections
                .extend(reflection.map(|(towards, share)| (colour * share, ray.origin, towards)));
            colour *= ray.colour;
            let behind = hit.map_or(f64::INFINITY, |(_, distance)| distance);
            let seen = match self.touch {
                Touch::Shadow => None,
                _ => self.shader.seen(ray.origin, ray.direction, self.width, numbers),
            };
            if let Some(seen) = seen.filter(|seen| seen.distance < behind) {
                let lit = &self.shader.objects[seen.object];
                let reflected = reflections
                    .iter()
                    .map(|&(share, place, towards)| share * lit.light_without(place, towards, 0.0));
                let hidden = (Vec3::ONE - seen.through) * reflected.sum::<Vec3>();
                cell.radiance += through * left * (colour * seen.radiance + hidden);
                left *= seen.through;
            }
            let towards = ray.direction.as_vec3();
            let surface = hit.filter(|_| self.touch != Touch::Sight);
            let surface = surface.and_then(|(hit, _)| room.surface(&hit, towards, 0.0));
            if let Some(surface) = surface.filter(|_| left != Vec3::ZERO) {
                let radiance = radiance / colour.max(Vec3::splat(f32::MIN_POSITIVE));
                left *= self.left_of(room, &surface, radiance, numbers);
            }
        }
        left
    }

    /// Returns the share of light that objects leave to a surface of the room of this radiance.
    fn left_of(
        &self,
        room: &Room,
        surface: &RoomSurface,
        radiance: Vec3,
        numbers: &mut PassNumbers,
    ) -> Vec3 {
        let (place, normal) = (surface.place, surface.normal);
        self.left(Shadowed { place, normal, known: Some((room, surface, radiance)) }, numbers)
    }

    /// Returns the share of light that objects leave to what a pixel shows, by the frame's
    /// distances alone.
    fn left_at(&self, pixel: (u32, u32), place: DVec3, numbers: &mut PassNumbers) -> Vec3 {
        match self.normal(pixel, place) {
            Some(normal) => self.left(Shadowed { place, normal, known: None }, numbers),
            None => Vec3::ONE,
        }
    }

    fn left(&self, surface: Shadowed, numbers: &mut PassNumbers) -> Vec3 {
        let objects = self.shader.objects.iter();
        let detail = self.shader.detail;
        objects.map(|lit| Vec3::ONE - surface.share(lit, detail, numbers)).product()
    }

    /// Returns the normal of what a pixel shows, by the distances of the pixels around it.
    fn normal(&self, (column, row): (u32, u32), here: DVec3) -> Option<Vec3> {
        let at = |column: Option<u32>, row: Option<u32>| {
            let (column, row) = (column?, row?);
            let size = self.grid.size;
            if column >= size.0 || row >= size.1 {
                return None;
            }
            let depth = f64::from(self.frame.depth[(row * size.0 + column) as usize]);
            let (x, y) = View::pixel_centre(size, column, row);
            let (origin, direction, _) = self.view.clipped_ray(x, y)?;
            // Distances of frames begin at the eye, also if the view is clipped.
            let eye = self.view.ray_to(origin).0;
            (depth > 0.0 && depth.is_finite()).then(|| eye + direction * depth)
        };
        let here = at(Some(column), Some(row)).unwrap_or(here);
        let step = |before: Option<DVec3>, after: Option<DVec3>| {
            let steps = [before.map(|before| here - before), after.map(|after| after - here)];
            steps.into_iter().flatten().min_by(|a, b| a.length().total_cmp(&b.length()))
        };
        let across = step(at(column.checked_sub(1), Some(row)), at(Some(column + 1), Some(row)))?;
        let down = step(at(Some(column), row.checked_sub(1)), at(Some(column), Some(row + 1)))?;
        let normal = across.cross(down).try_normalize()?;
        let towards = self.view.ray_to(here).1;
        let normal = if normal.dot(towards) > 0.0 { -normal } else { normal };
        Some(normal.as_vec3())
    }
}
