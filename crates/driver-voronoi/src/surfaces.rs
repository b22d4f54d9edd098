//! What every pixel sees: position, normal and material, by the display's own ray caster (Larson & Simmons 1999, §2.4.4,
//! where the graphics hardware's depth buffer knows them).
//!
//! Through mirrors and thin panes the pixel's surface is the first one behind them, placed where the eye sees it: panes
//! leave it where it is, a mirror's image lies behind the mirror. All positions are camera coordinates.
//!
//! What always holds:
//! - A surface's normal faces the eye.
//! - Pixels have the same label only if they see one connected surface, or parts of it, in the same image.

use bytemuck::Zeroable;
use glam::{DVec3, Vec3};
use holo_cpu::Kernel;
use holo_display::{Camera, PixelWidth};
use holo_picture::View;
use holo_raycast::{Hit, MAX_TILE, Ray, Raycaster};
use holo_scene::{Bsdf, Rgb};
use rustc_hash::FxHashMap;
use std::ops::Range;

/// Metals of at most this roughness look nearly like mirrors: their highlights are some degrees wide.
pub(crate) const SMOOTH_METAL: f32 = 0.05;

/// Image of what small or curved mirrors show: [`Seen::position`] is then where it is, not where it is seen.
pub(crate) const NO_IMAGE: u8 = u8::MAX;

/// Cosine between normals that belong to one smooth surface: 2.6°. Coarser facets are lit each on its own, and are seen.
pub(crate) const SMOOTH: f32 = 0.999;

/// Of what lies in a portal's plane, the portal counts: relative rounding of its distance.
const PORTAL_SLACK: f64 = 1e-4;

/// No triangle: the pixel sees the sky.
pub(crate) const SKY: u32 = u32::MAX;

/// The [`key`](Seen::key) of the sky.
pub(crate) const NO_KEY: u64 = 0;

/// The image of a [`key`](Seen::key).
#[inline]
pub(crate) fn image_of(key: u64) -> u8 {
    (key >> 40) as u8
}

/// The label of pixels that see the sky.
pub(crate) const NO_LABEL: u32 = 0;

/// What a pixel, or a point of it, sees.
#[derive(Clone, Copy, Debug, Zeroable)]
pub(crate) struct Seen {
    /// Camera coordinates, as seen: behind the mirror for a mirror's image.
    pub position: Vec3,
    /// Unit, towards the eye, as seen.
    pub normal: Vec3,
    /// The complement of the triangle's number, so that memory that is 0 sees the sky: layers of which a picture has little take no
    /// time to clear.
    pub(super) complement: u32,
    pub material: u32,
    /// Whether its counter-clockwise side is seen.
    pub front: bool,
    /// Which [`Image`], or [`NO_IMAGE`].
    pub image: u8,
    /// Seen through a mirror or pane: a part of its light is lost on the way.
    pub through: bool,
}

impl Seen {
    pub const NOTHING: Seen = Seen {
        position: Vec3::ZERO,
        normal: Vec3::ZERO,
        complement: !SKY,
        material: 0,
        front: false,
        image: 0,
        through: false,
    };

    /// [`SKY`] for none.
    #[inline]
    pub fn triangle(&self) -> u32 {
        !self.complement
    }

    #[inline]
    pub fn is_sky(&self) -> bool {
        self.complement == !SKY
    }

    /// What belongs together as one number: the side of the triangle, and how it is seen. [`NO_KEY`] of the sky.
    #[inline]
    pub fn key(&self) -> u64 {
        let flags =
            u64::from(self.front) | u64::from(self.through) << 1 | u64::from(self.image) << 8;
        if self.is_sky() { NO_KEY } else { u64::from(self.complement) | flags << 32 }
    }

    /// The side of a triangle that it is of.
    pub fn side(&self) -> (u32, bool) {
        (self.triangle(), self.front)
    }

    /// Whether a surface seen next to this one is the same smooth one.
    pub fn continues(&self, other: &Seen, pixel_width: PixelWidth) -> bool {
        self.material == other.material
            && self.image == other.image
            && self.through == other.through
            && !self.is_sky()
            && !other.is_sky()
            && (self.side() == other.side()
                || (self.normal.dot(other.normal) > SMOOTH && {
                    let between = other.position - self.position;
                    let gap = between.dot(self.normal).abs().min(between.dot(other.normal).abs());
                    // A step of half a pixel is seen; curves stay well below it.
                    gap <= 0.5 * pixel_width.at(self.position)
                }))
    }
}

/// How a mirror image lies: `turn * point + shift`, camera coordinates.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Image {
    turn: glam::Mat3,
    shift: Vec3,
}

impl Image {
    pub const ITSELF: Image = Image { turn: glam::Mat3::IDENTITY, shift: Vec3::ZERO };

    /// Where a point of the scene is seen.
    pub fn point(&self, point: Vec3) -> Vec3 {
        self.turn * point + self.shift
    }

    /// How a direction is seen.
    pub fn direction(&self, direction: Vec3) -> Vec3 {
        self.turn * direction
    }

    /// Where in the scene a point and a direction of the image lie.
    pub fn back(&self, point: Vec3, direction: Vec3) -> (Vec3, Vec3) {
        let inverse = self.turn.transpose();
        (inverse * (point - self.shift), inverse * direction)
    }

    /// This image, seen in a mirror of the scene at `point` with `normal`.
    pub fn mirrored(&self, point: Vec3, normal: Vec3) -> Image {
        let columns =
            [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis - 2.0 * axis.dot(normal) * normal);
        let mirror = glam::Mat3::from_cols(columns[0], columns[1], columns[2]);
        let shift = 2.0 * point.dot(normal) * normal;
        Image { turn: self.turn * mirror, shift: self.turn * shift + self.shift }
    }

    pub fn is_like(&self, other: &Image, reach: f32) -> bool {
        let turns = (self.turn - other.turn)
            .to_cols_array()
            .iter()
            .fold(0.0_f32, |most, x| most.max(x.abs()));
        turns < 1e-4 && (self.shift - other.shift).length() < 1e-4 * reach
    }
}

/// The part of a picture in which an image is seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Window {
    /// Which image.
    pub image: u8,
    /// Pixels from the left and the top; the lower bounds are within, the upper ones not.
    pub low: (f32, f32),
    pub high: (f32, f32),
}

impl Window {
    /// Holds no pixel.
    pub fn nowhere() -> Window {
        Window { image: 0, low: (f32::INFINITY, f32::INFINITY), high: (0.0, 0.0) }
    }

    /// Makes it hold what another one holds.
    pub fn join(&mut self, other: &Window) {
        self.low = (self.low.0.min(other.low.0), self.low.1.min(other.low.1));
        self.high = (self.high.0.max(other.high.0), self.high.1.max(other.high.1));
    }
}

/// What a view's pixels see.
pub(crate) struct Surfaces {
    pub size: (usize, usize),
    pub seen: Vec<Seen>,
    /// Which connected surface each pixel shows; [`NO_LABEL`] for the sky.
    pub labels: Vec<u32>,
    /// Whether something else is seen in the 3 × 3 pixels around.
    pub edges: Vec<bool>,
    /// The scene itself, then its mirror images.
    pub images: Vec<Image>,
    /// Where in the picture each image is seen.
    pub windows: Vec<Window>,
    /// What comes through the mirrors and panes before a pixel's surface; all of it where none is listed.
    pub throughput: FxHashMap<u32, Rgb>,
    pub pixel_width: PixelWidth,
}

impl Surfaces {
    /// The columns and rows that see anything but the sky.
    pub fn bounds(&self) -> (Range<usize>, Range<usize>) {
        let bound = |low: fn(&Window) -> f32, high: fn(&Window) -> f32| {
            let first = self.windows.iter().map(|window| low(window) as usize).min().unwrap_or(0);
            first..self.windows.iter().map(|window| high(window) as usize).max().unwrap_or(0)
        };
        (bound(|w| w.low.0, |w| w.high.0), bound(|w| w.low.1, |w| w.high.1))
    }
}

/// Finds the rays from one eye through points of a picture.
pub(crate) struct Fan<'a> {
    eye: Vec3,
    points: &'a [(f64, f64); MAX_TILE],
    rays: &'a mut [Ray],
    /// Towards the picture's left upper corner, and from pixel to pixel.
    corner: DVec3,
    right: DVec3,
    down: DVec3,
}

impl Kernel for Fan<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let mut axes = [[0.0_f64; MAX_TILE]; 3];
        let (corner, right, down) =
            (self.corner.to_array(), self.right.to_array(), self.down.to_array());
        for axis in 0..3 {
            for (to, point) in axes[axis].iter_mut().zip(self.points) {
                *to = corner[axis] + right[axis] * point.0 + down[axis] * point.1;
            }
        }
        let mut directions = [[0.0_f32; MAX_TILE]; 3];
        for i in 0..MAX_TILE {
            let [x, y, z] = [0, 1, 2].map(|axis: usize| axes[axis][i]);
            let shorter = (x * x + y * y + z * z).sqrt().recip();
            directions[0][i] = (x * shorter) as f32;
            directions[1][i] = (y * shorter) as f32;
            directions[2][i] = (z * shorter) as f32;
        }
        for (i, ray) in self.rays.iter_mut().enumerate().take(MAX_TILE) {
            *ray =
                Ray::new(self.eye, Vec3::new(directions[0][i], directions[1][i], directions[2][i]));
        }
    }
}

/// Casts rays of a view.
pub(crate) struct Caster<'a> {
    raycaster: &'a Raycaster,
    portals: Option<&'a Raycaster>,
    view: &'a View,
    pub camera: &'a Camera,
    pub size: (usize, usize),
}

impl<'a> Caster<'a> {
    pub fn new(
        raycaster: &'a Raycaster,
        view: &'a View,
        camera: &'a Camera,
        size: (u32, u32),
    ) -> Self {
        Self { raycaster, portals: None, view, camera, size: (size.0 as usize, size.1 as usize) }
    }

    /// Sees nothing of what is behind these.
    #[must_use]
    pub fn with_portals(self, portals: Option<&'a Raycaster>) -> Self {
        Self { portals, ..self }
    }

    /// Whether a point of the picture, in pixels, that sees this looks through a portal at it.
    pub fn is_beyond(&self, column: f64, row: f64, seen: &Seen) -> bool {
        let Some(portals) = self.portals else { return false };
        let (eye, direction) =
            self.view.ray(column / self.size.0 as f64, 1.0 - row / self.size.1 as f64);
        let near = portals.localize(eye, direction).map(|ray| self.clipped(ray, direction));
        let met =
            near.and_then(|(ray, skipped)| Some(skipped + f64::from(portals.nearest(&ray)?.t)));
        let reach = f64::from(self.camera.sight(seen.position).length()) * (1.0 + PORTAL_SLACK);
        met.is_some_and(|distance| seen.is_sky() || distance <= reach)
    }

    /// The ray through a point of the picture in pixels, in the scene's coordinates, and how far from the eye it begins.
    pub fn ray(&self, column: f64, row: f64) -> Option<(Ray, f64)> {
        let (x, y) = (column / self.size.0 as f64, 1.0 - row / self.size.1 as f64);
        let (eye, direction) = self.view.ray(x, y);
        self.raycaster.localize(eye, direction).map(|ray| self.clipped(ray, direction))
    }

    /// A ray between the view's clipping surfaces.
    fn clipped(&self, (ray, skipped): (Ray, f64), direction: DVec3) -> (Ray, f64) {
        let [t_min, t_max] =
            self.view.span(direction).map(|distance| (distance - skipped).max(0.0) as f32);
        (Ray { t_min, t_max, ..ray }, skipped)
    }

    /// Whether all rays begin at one point, towards points of a plane, and go on for ever.
    pub fn is_plain_perspective(&self) -> bool {
        self.camera.is_perspective() && !self.view.is_clipped()
    }

    /// The rays from an eye through points of a perspective's picture, in pixels.
    pub fn fan<'b>(
        &self,
        eye: Vec3,
        points: &'b [(f64, f64); MAX_TILE],
        rays: &'b mut [Ray],
    ) -> Fan<'b> {
        let (across, along) = self.view.extent();
        let (right, up) = (self.view.right() * across, self.view.up() * along);
        let (width, height) = (self.size.0 as f64, self.size.1 as f64);
        let corner = self.view.vd + right * (self.view.vs - 0.5) + up * (self.view.vl + 0.5);
        Fan { eye, points, rays, corner, right: right / width, down: -up / height }
    }

    /// Material number of a triangle.
    pub fn material(&self, triangle: u32) -> u32 {
        self.scene().material_ids[triangle as usize]
    }

    /// Whether a triangle is of a mirror or pane.
    pub fn is_polished(&self, triangle: u32) -> bool {
        matches!(self.scene().material(triangle).bsdf, Bsdf::Mirror { .. } | Bsdf::ThinGlass { .. })
    }

    /// Normal of a triangle, camera coordinates, either side.
    pub fn normal(&self, triangle: u32) -> Vec3 {
        self.vector(self.raycaster.geometric_normal(triangle))
    }

    pub fn scene(&self) -> &holo_scene::Scene {
        self.raycaster.scene()
    }

    /// The nearest hits of view rays through neighbouring points.
    pub fn nearest_tile(&self, rays: &[Ray], hits: &mut [Option<Hit>]) {
        self.raycaster.nearest_tile(rays, hits);
    }

    pub fn vector(&self, local: Vec3) -> Vec3 {
        self.camera.to_camera(local.as_dvec3()).as_vec3()
    }

    /// A point of the scene's coordinates as the camera has it.
    pub fn point(&self, local: Vec3) -> Vec3 {
        self.camera
            .to_camera(local.as_dvec3() + self.raycaster.scene().origin - self.camera.eye)
            .as_vec3()
    }

    /// A point that the camera has, in the scene's coordinates relative to its origin.
    pub fn place(&self, point: Vec3) -> Vec3 {
        (self.turned_back(point.as_dvec3()) + self.camera.eye - self.scene().origin).as_vec3()
    }

    /// A direction that the camera has, in the scene's coordinates.
    pub fn towards(&self, direction: Vec3) -> Vec3 {
        self.turned_back(direction.as_dvec3()).as_vec3()
    }

    fn turned_back(&self, v: DVec3) -> DVec3 {
        self.camera.right * v.x + self.camera.up * v.y + self.camera.forward * v.z
    }

    pub fn raycaster(&self) -> &'a Raycaster {
        self.raycaster
    }

    /// What a hit of a view ray is, whatever its material.
    pub fn first(&self, ray: &Ray, hit: &Hit) -> Seen {
        self.on(&self.face(ray, hit.triangle), hit)
    }

    /// What all hits of rays on this side of a triangle have in common.
    pub fn face(&self, ray: &Ray, triangle: u32) -> Face {
        let normal = self.raycaster.geometric_normal(triangle);
        let front = faces(normal, ray);
        let seen = Seen {
            position: Vec3::ZERO,
            normal: self.vector(if front { normal } else { -normal }),
            complement: !triangle,
            material: self.material(triangle),
            front,
            image: 0,
            through: false,
        };
        Face { normal, seen, is_polished: self.is_polished(triangle) }
    }

    /// What a hit on a face is.
    #[inline]
    pub fn on(&self, face: &Face, hit: &Hit) -> Seen {
        Seen { position: self.point(self.raycaster.surface_point(hit).0), ..face.seen }
    }

    /// The nearest hit of a ray.
    pub fn nearest(&self, ray: &Ray) -> Option<Hit> {
        self.raycaster.nearest(ray)
    }

    /// The scene's triangle at a point that the camera has, looking along `direction`, within `reach` on either side.
    pub fn triangle_at(&self, point: DVec3, direction: DVec3, reach: f64) -> Option<u32> {
        let at = self.turned_back(point) + self.camera.eye - self.scene().origin;
        let along = self.turned_back(direction);
        let start = (at - along * reach).as_vec3();
        let ray = Ray { t_max: 2.0 * reach as f32, ..Ray::new(start, along.as_vec3()) };
        self.raycaster.nearest(&ray).map(|hit| hit.triangle)
    }
}

/// A side of a triangle: what all that is seen of it has in common.
pub(crate) struct Face {
    normal: Vec3,
    seen: Seen,
    /// Whether it is a mirror's or pane's.
    pub is_polished: bool,
}

impl Face {
    /// Whether a ray that meets this triangle meets this side.
    #[inline]
    pub fn is_met(&self, ray: &Ray, triangle: u32) -> bool {
        self.seen.triangle() == triangle && self.seen.front == faces(self.normal, ray)
    }
}

/// Whether a ray comes from the side that a normal points to.
#[inline]
fn faces(normal: Vec3, ray: &Ray) -> bool {
    normal.dot(ray.direction) <= 0.0
}
