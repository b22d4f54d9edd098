//! What the pixels of a view see: points of surfaces, the ways to them, and the pieces of pixels on
//! edges.

use crate::light_store::TrailEnd;
use glam::Vec3;
use holo_scene::Rgb;
use std::ops::Range;

/// Greatest relative difference between colours of the same pane or mirror in neighbouring pixels.
const SAME_COLOUR: f32 = 0.03;

/// Stands for the sky, or nothing.
pub(crate) const NO_MATERIAL: u32 = u32::MAX;

/// Number of the way of a surface that is seen directly, has no texture, and does not shine.
pub(crate) const PLAIN: u32 = 0;

/// A surface point that a pixel sees, relative to the scene's origin.
#[derive(Clone, Copy, Debug)]
pub struct VisiblePoint {
    /// The point.
    pub point: Vec3,
    /// The unit normal on the side that is seen.
    pub normal: Vec3,
    /// The width of a pixel at the point, scene units.
    pub width: f32,
    /// The material's number; `u32::MAX` if there is no surface.
    pub material: u32,
    /// Surfaces share light only if this number is the same.
    pub light: u32,
    /// The number of its [`SurfaceTrail`]; 0 if it is seen directly, has no texture, and does not
    /// shine.
    pub way: u32,
}

/// A reflection in a pane or partly covered mirror that a pixel sees, or another partly covered
/// surface before what it sees.
#[derive(Clone, Copy, Debug)]
pub struct InPane {
    /// The pixel's number.
    pub pixel: usize,
    /// The reflected or covered surface.
    pub seen: VisiblePoint,
    /// The share of the pixel that the pane or surface takes.
    pub share: f32,
    /// Its place among those of the pixel's middle, from 0: first reflections, then covered
    /// surfaces from the eye on.
    pub rank: usize,
}

/// The way to a surface that has a texture, shines, or is seen through mirrors or panes.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceTrail {
    /// The share of the surface's light that comes back through mirrors and panes.
    pub share: Rgb,
    /// The factor of the surface's texture.
    pub texture: Rgb,
    /// Added radiance, of the sky, of a lamp or from a reflection cube.
    pub radiance: Rgb,
    /// The ray's unit direction when it meets the surface.
    pub direction: Vec3,
    /// Distance to the lamp, or to what a reflection cube shows, scene units; infinite if neither
    /// is seen.
    pub to_lamp: f32,
    /// True if a mirror or solid glass turned the ray. Otherwise the surface lies in the pixel's
    /// direction.
    pub is_mirrored: bool,
    /// The share of light that the first pane or solid glass on the way reflects; 0 without any,
    /// and behind a partly covered mirror. Samples of the surface contain that light.
    pub pane: f32,
    /// The shiny object of rough metal that is seen, and its smooth normal.
    pub(crate) mirrors: Option<(u32, Vec3)>,
}

/// A pixel that shows several things.
#[derive(Clone, Debug)]
pub struct Edge {
    /// The pixel's number.
    pub pixel: usize,
    /// The numbers of its pieces.
    pub pieces: Range<usize>,
}

/// One of the things that a pixel on an edge shows.
#[derive(Clone, Copy, Debug)]
pub struct EdgePiece {
    /// The surface, or the lack of one.
    pub seen: VisiblePoint,
    /// The piece's share of the pixel.
    pub share: f32,
    /// The middle of the piece in the picture, pixels. The middle of the first pixel is at 0.
    pub at: (f32, f32),
    /// True if the piece has its own sums: it is not what the pixel's middle shows, and is not seen
    /// in a mirror.
    pub is_apart: bool,
}

impl SurfaceTrail {
    pub(crate) const PLAIN: SurfaceTrail = SurfaceTrail {
        share: [1.0; 3],
        texture: [1.0; 3],
        radiance: [0.0; 3],
        direction: Vec3::ZERO,
        to_lamp: f32::INFINITY,
        is_mirrored: false,
        pane: 0.0,
        mirrors: None,
    };
}

impl VisiblePoint {
    /// Stands for no surface.
    pub const NOTHING: VisiblePoint = VisiblePoint {
        point: Vec3::ZERO,
        normal: Vec3::ZERO,
        width: 0.0,
        material: NO_MATERIAL,
        light: 0,
        way: PLAIN,
    };

    /// Returns the distance of a point from this one, if both lie on the same surface. Points are
    /// rounded to `unit`.
    #[inline]
    pub(crate) fn away(&self, point: Vec3, unit: f32) -> Option<f32> {
        let between = point - self.point;
        let away = between.length();
        let tolerance = 2.0 * unit + 0.25 * self.width + 0.05 * away;
        (self.is_surface() && between.dot(self.normal).abs() < tolerance).then_some(away)
    }

    /// Returns true if this surface and that of a neighbouring ray differ.
    #[inline]
    pub(crate) fn differs(&self, other: &VisiblePoint) -> bool {
        self.material != other.material
            || self.normal.dot(other.normal) <= 0.9
            || self.away(other.point, 0.0).is_none()
    }

    /// Returns true if there is a surface.
    #[must_use]
    pub fn is_surface(&self) -> bool {
        self.material != NO_MATERIAL
    }
}

/// Returns true if colours agree within the effect of a pane's angle between neighbouring pixels.
pub(crate) fn are_near(one: Rgb, other: Rgb) -> bool {
    one.iter().zip(other).all(|(a, b)| (a - b).abs() <= SAME_COLOUR * a.max(b))
}

pub(crate) fn seen(end: &TrailEnd, width: f32, way: u32) -> VisiblePoint {
    let TrailEnd { point, normal, material, light, .. } = *end;
    VisiblePoint { point, normal, width, material, light, way }
}
