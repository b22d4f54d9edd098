//! Likely light of squares with too few samples. It depends on the surface:
//! - on rough metal, the light that the metal mirrors;
//! - on solid glass, the light behind it;
//! - on coated surfaces, the mean light of samples from all directions;
//! - on others, the mean light of the picture around them.
//!
//! Invariant: likely light is a function of the view, the squares' sums, and the store.

use crate::light_store::{AtPanes, FaceClass, LightStore, RayContent, luminance};
use crate::planes::{Square, SquareLayout, SquarePlanes};
use crate::squares::Squares;
use crate::view::SurfaceView;
use crate::visible::VisiblePoint;
use glam::Vec3;
use holo_display::split_mix;
use holo_raycast::{Ray, spawn};

/// Side of a tile of the picture, pixels.
const TILE: usize = 32;

/// Number of samples from which no likely light is needed.
const ENOUGH_SAMPLES: f32 = 64.0;

/// Weight of the whole picture's mean in a tile's mean, in samples.
const PICTURE_WEIGHT: f32 = 4.0;

/// Mirrored rays for one square of rough metal.
const RAYS: u64 = 8;

/// Most surfaces of solid glass that a ray crosses.
const MOST_CROSSED: usize = 16;

/// Most light along such a ray, relative to the mean of the picture, so that a few rays do not show
/// single small lamps.
const MOST_RAY_LIGHT: f32 = 8.0;

/// The likely light of a square, fixed-point steps.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Likely {
    pub light: Vec3,
    /// True if it is the mean light of the picture around, whatever the square's surface is.
    pub is_around: bool,
}

/// Mean light of a picture and of its tiles, fixed-point steps.
pub(crate) struct LikelyLight<'a> {
    view: &'a SurfaceView,
    store: &'a LightStore,
    squares: &'a Squares,
    /// The number of tiles in a row and in a column.
    size: (usize, usize),
    /// The side of a tile, squares.
    side: usize,
    /// Light (3) and samples of each tile.
    tiles: Vec<[f32; 4]>,
    /// The mean light of all squares.
    pub mean: Vec3,
}

impl Likely {
    /// Returns the light's channels, and 1 if it is the mean light of the picture around.
    pub fn to_array(self) -> [f32; 4] {
        let [r, g, b] = self.light.to_array();
        [r, g, b, f32::from(u8::from(self.is_around))]
    }
}

impl From<[f32; 4]> for Likely {
    fn from([r, g, b, is_around]: [f32; 4]) -> Likely {
        Likely { light: Vec3::new(r, g, b), is_around: is_around > 0.0 }
    }
}

impl<'a> LikelyLight<'a> {
    /// Computes the means. `sums` has the light (3), samples and squared luminance of each square.
    pub fn new(
        (view, store): (&'a SurfaceView, &'a LightStore),
        squares: &'a Squares,
        layout: &SquareLayout,
        sums: &SquarePlanes<5>,
    ) -> LikelyLight<'a> {
        let side = (TILE / squares.step).max(1);
        let size = (squares.size.0.div_ceil(side), squares.size.1.div_ceil(side));
        let mut tiles = vec![[0.0; 4]; size.0 * size.1];
        for at in (0..squares.size.1).flat_map(|row| layout.squares(row)) {
            let tile = &mut tiles[at.row / side * size.0 + at.column / side];
            tile.iter_mut().zip(sums.at(at)).for_each(|(sum, more)| *sum += more);
        }
        let mut all = [0.0_f64; 4];
        for tile in &tiles {
            all.iter_mut().zip(tile).for_each(|(sum, more)| *sum += f64::from(*more));
        }
        let mean = [0, 1, 2].map(|c| (all[c] / all[3].max(1.0)) as f32);
        LikelyLight { view, store, squares, size, side, tiles, mean: Vec3::from_array(mean) }
    }

    /// Returns the likely light of a square whose widest neighbourhood has this many samples.
    /// `None` if there are enough samples, or none near.
    pub fn at(&self, square: Square, samples: f32) -> Option<Likely> {
        let seen = &self.squares.seen[square.number];
        if !seen.is_surface() || samples >= ENOUGH_SAMPLES {
            return None;
        }
        let special = self.mirrored(seen).or_else(|| self.behind(seen));
        let special = special.or_else(|| self.all_around(seen));
        let special = special.map(|light| Likely { light, is_around: false });
        let around = || Likely { light: self.around(square), is_around: true };
        special.or_else(|| (samples > 0.0).then(around))
    }

    /// Returns the mean light of the picture around a square, interpolated between tiles.
    fn around(&self, square: Square) -> Vec3 {
        let at = |number: usize| (number as f32 + 0.5) / self.side as f32 - 0.5;
        let (across, down) = (at(square.column), at(square.row));
        let (left, top) = (across.floor(), down.floor());
        let mut light = PICTURE_WEIGHT * self.mean;
        let mut samples = PICTURE_WEIGHT;
        for (row, v) in [(top, 1.0 - (down - top)), (top + 1.0, down - top)] {
            for (column, u) in [(left, 1.0 - (across - left)), (left + 1.0, across - left)] {
                // Conversions from floats to integers saturate.
                let row = (row as usize).min(self.size.1 - 1);
                let column = (column as usize).min(self.size.0 - 1);
                let [r, g, b, count] = self.tiles[row * self.size.0 + column];
                light += u * v * Vec3::new(r, g, b);
                samples += u * v * count;
            }
        }
        light / samples
    }

    /// Returns the light that rough metal mirrors, as a mean over a few rays. `None` for other
    /// surfaces.
    fn mirrored(&self, seen: &VisiblePoint) -> Option<Vec3> {
        let alpha = self.view.follower().finish(seen.material).rough?;
        let direction = self.view.way(seen).direction;
        let random =
            split_mix(u64::from(seen.point.x.to_bits()) << 32 | u64::from(seen.point.y.to_bits()));
        let first = (random >> 40) as f32 / (1 << 24) as f32;
        let (across, along) = seen.normal.any_orthonormal_pair();
        let ray = |number: u64| {
            // Facet normals are distributed by GGX (Walter et al. 2007, §5.2).
            let share = (number as f32 + 0.5) / RAYS as f32;
            let turn = std::f32::consts::TAU * (first + 0.618_034 * number as f32);
            let tangent = alpha * (share / (1.0 - share)).sqrt();
            let facet =
                (seen.normal + tangent * (turn.cos() * across + turn.sin() * along)).normalize();
            let mirrored = direction - 2.0 * direction.dot(facet) * facet;
            self.light_towards(seen, mirrored)
        };
        let lights = (0..RAYS).filter_map(ray);
        let (sum, count) =
            lights.fold((Vec3::ZERO, 0.0), |(sum, count), light| (sum + light, count + 1.0));
        (count > 0.0).then(|| sum / count)
    }

    /// Returns the light behind solid glass, as if the glass did not bend the ray. `None` for other
    /// surfaces.
    fn behind(&self, seen: &VisiblePoint) -> Option<Vec3> {
        let mut share = Vec3::from_array(self.view.follower().finish(seen.material).clear?);
        let mut ray = ray_from(seen, self.view.way(seen).direction);
        for _ in 0..MOST_CROSSED {
            let follower = self.view.follower();
            let hit = follower.raycaster.nearest(&ray);
            let clear = hit.and_then(|hit| follower.finish(follower.material(hit.triangle)).clear);
            let (Some(hit), Some(clear)) = (hit, clear) else {
                return self.light_along(ray).map(|light| share * light);
            };
            share *= Vec3::from_array(clear);
            let normal = follower.raycaster.geometric_normal(hit.triangle);
            let (at, error) = follower.raycaster.surface_point(&hit);
            ray = Ray::new(spawn(at, error, normal, ray.direction), ray.direction);
        }
        None
    }

    /// Returns the mean light of samples from all directions on a coated surface, most of whose
    /// light is diffuse. `None` for other surfaces, and without samples.
    fn all_around(&self, seen: &VisiblePoint) -> Option<Vec3> {
        let is_coated = self.view.follower().finish(seen.material).is_coated;
        let sums = || self.store.around(seen.point, |face| face.is_on(seen.normal, seen.material));
        is_coated.then(sums).filter(|sums| sums.count > 0).map(|sums| sums.mean())
    }

    /// Returns the light that reaches the front of a surface from a direction.
    fn light_towards(&self, seen: &VisiblePoint, direction: Vec3) -> Option<Vec3> {
        (direction.dot(seen.normal) > 0.0).then(|| self.light_along(ray_from(seen, direction)))?
    }

    /// Returns the light that comes back along a ray, from the store's means at the surface where
    /// it begins.
    fn light_along(&self, ray: Ray) -> Option<Vec3> {
        let view = self.view;
        let follower = view.follower();
        let unit = view.unit();
        let shown = match follower.raycaster.nearest(&ray) {
            Some(hit) => follower.follow(ray, hit, AtPanes::PassAll),
            None => RayContent::Sky([1.0; 3], ray.direction),
        };
        let light = match shown {
            RayContent::Surface(end) => {
                let finish = follower.finish(end.material);
                let share = Vec3::from_array(end.share);
                if finish.shines(end.front) {
                    share * Vec3::from_array(finish.emission) * follower.luminaire_share(&end)
                        / unit
                } else {
                    let serves =
                        |face: FaceClass| face.serves(end.normal, end.material, end.direction);
                    let sums = self.store.around(end.point, serves);
                    let light = if sums.count > 0 { sums.mean() } else { self.mean };
                    share * Vec3::from_array(finish.reflectance) * light
                }
            }
            RayContent::Sky(share, direction) => {
                Vec3::from_array(share) * follower.materials.sky_light(direction) / unit
            }
            RayContent::Light(..) | RayContent::Unknown => return None,
        };
        let most = MOST_RAY_LIGHT * luminance(self.mean.to_array());
        let bright = luminance(light.to_array());
        Some(if bright > most { light * (most / bright) } else { light })
    }
}

/// Returns a ray that leaves a surface in a direction, on either side.
fn ray_from(seen: &VisiblePoint, direction: Vec3) -> Ray {
    let origin = spawn(seen.point, Vec3::splat(1e-3 * seen.width), seen.normal, direction);
    Ray::new(origin, direction)
}
