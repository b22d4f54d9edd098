//! Places on surfaces, and the keys of their cells.

use std::f32::consts::FRAC_PI_3;

use glam::Vec3;
use holo_raycast::{Raycaster, SurfacePoint};

use crate::geometry::ShadingFrame;
use crate::policy::LaterVertex;
use holo_sobol::mix;

/// Offset of the grid in cells. Walls lie at round coordinates more often than not. A border of
/// cells in a wall's plane would divide the wall between two layers of cells by rounding.
const OFFSET: Vec3 = Vec3::new(0.1371, 0.2173, 0.3317);

/// A point on a side of a surface, with what distinguishes its light from that of other surfaces.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spot {
    pub point: SurfacePoint,
    /// Geometric normal on the lit side.
    pub normal: Vec3,
    pub material: u32,
    /// Number of further bounces whose light counts; `u32::MAX` without a limit.
    pub bounces: u32,
}

/// A spot in its scene.
#[derive(Clone, Copy)]
pub(crate) struct SurfacePlace<'a> {
    pub raycaster: &'a Raycaster,
    pub spot: Spot,
}

impl<'a> SurfacePlace<'a> {
    /// Returns the place of a vertex of paths with at most `bounces` bounces.
    #[inline]
    pub(super) fn new(at: &LaterVertex<'a>, bounces: u32) -> Self {
        let bounces = match bounces {
            u32::MAX => u32::MAX,
            most => (most + 1).saturating_sub(at.scatterings),
        };
        let spot = Spot { point: *at.point, normal: at.normal, material: at.material, bounces };
        Self { raycaster: at.raycaster, spot }
    }

    #[inline]
    pub(super) fn spot(&self) -> Spot {
        self.spot
    }

    /// Returns whether something separates this place from a cell's anchor.
    #[inline]
    pub(super) fn is_parted(&self, anchor: Vec3, normal: Vec3) -> bool {
        self.raycaster.parted(&self.spot.point, self.spot.normal, anchor, normal)
    }

    /// Returns whether nothing stands on the surface within reach of any cell of this width around
    /// this place.
    ///
    /// Six rays go outwards along the surface. Any wall that comes within 1.42 widths crosses one
    /// of them, and a cell reaches no further. Smaller things may be missed.
    pub(super) fn is_clear(&self, width: f32) -> bool {
        let Spot { point, normal, .. } = self.spot;
        let frame = ShadingFrame::new(normal);
        let reach = 1.65 * width;
        (0..6).all(|ray| {
            let (sin, cos) = (ray as f32 * FRAC_PI_3).sin_cos();
            let end = point.point + (frame.s * cos + frame.t * sin) * reach;
            !self.raycaster.parted(&point, normal, end, normal)
        })
    }
}

impl Spot {
    /// Returns the key of the cell of this width. `part` distinguishes parts of a cell that do not
    /// see each other. A key is never 0.
    #[inline]
    pub(super) fn key(&self, width: f32, level: u32, part: u32) -> u64 {
        let cell = (self.point.point / width + OFFSET).floor().as_ivec3();
        let around = self.normal.abs();
        let axis = around.max_position() as u32;
        let side = axis << 1 | u32::from(self.normal[axis as usize] < 0.0);
        let pair = |a: u32, b: u32| u64::from(a) << 32 | u64::from(b);
        let mut key = mix(pair(self.material, side << 8 | level << 3 | part));
        key = mix(key ^ pair(cell.x as u32, cell.y as u32));
        mix(key.wrapping_add(pair(cell.z as u32, self.bounces))) | 1
    }
}
