//! Finds the surfaces that a view's pixels show, also through mirrors and panes, once for each
//! view.
//!
//! Invariant: the surface of a pixel is a function of the view and the scene.

use crate::light_store::{
    AtPanes, FaceClass, Follower, MaterialClass, Materials, RayContent, Reflections, Trail,
    TrailEnd,
};
use crate::visible::{Edge, EdgePiece, InPane, PLAIN, SurfaceTrail, VisiblePoint, are_near, seen};
use glam::{DVec3, Vec3};
use holo_display::Camera;
use holo_picture::View as Eye;
use holo_raycast::{MAX_TILE, Ray, Raycaster};
use holo_scene::Rgb;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// Side of a tile of pixels whose rays are cast together.
const SIDE: usize = 8;
const _: () = assert!(SIDE * SIDE == MAX_TILE);

/// The surfaces of a view.
#[derive(Debug)]
pub struct SurfaceView {
    pub(crate) raycaster: Arc<Raycaster>,
    materials: Arc<Materials>,
    eye: Eye,
    /// The width of a pixel at distance 0, and its growth per distance.
    footprint: (f32, f32),
    /// True if rays that hit nothing are black.
    clips_sky: bool,
    /// The number of columns and of rows.
    pub size: (usize, usize),
    /// What each pixel sees.
    pub seen: Vec<VisiblePoint>,
    /// All ways, by number. The first one is not used.
    pub ways: Vec<SurfaceTrail>,
    /// Reflections in panes and partly covered surfaces, first those of pixels whose middle sees
    /// them.
    pub in_panes: Vec<InPane>,
    /// Number of those that middles of pixels see.
    pub(crate) panes_of_middles: usize,
    /// See [`on_edges`](Self::on_edges).
    pub(crate) on_edges: OnceLock<Vec<usize>>,
    /// Pixels that show several things. Empty before [`look_into_edges`](Self::look_into_edges).
    pub edges: Vec<Edge>,
    /// The pieces of these pixels.
    pub pieces: Vec<EdgePiece>,
    /// The shiny objects that middles of pixels show first, each with the number of these pixels.
    /// Empty without reflection cubes.
    pub(crate) objects: BTreeMap<u32, usize>,
}

/// The ways of some rows of pixels, and the reflections in panes that these see. Numbers of ways
/// count from 1.
#[derive(Default)]
struct Band {
    ways: Vec<SurfaceTrail>,
    in_panes: Vec<InPane>,
    objects: BTreeMap<u32, usize>,
}

impl Band {
    /// Adds the way to a surface. Returns the surface with the way's number.
    fn add(&mut self, (seen, way): (VisiblePoint, SurfaceTrail)) -> VisiblePoint {
        self.ways.push(way);
        VisiblePoint { way: self.ways.len() as u32, ..seen }
    }
}

impl SurfaceView {
    /// Casts the rays of all pixels. `size` must come from [`View::resolve`](Eye::resolve).
    #[must_use]
    pub fn new(
        raycaster: Arc<Raycaster>,
        materials: Arc<Materials>,
        eye: &Eye,
        size: (u32, u32),
    ) -> SurfaceView {
        SurfaceView::with_reflections(raycaster, materials, (eye, size), None, false)
    }

    /// Does the same for a view that may show rough metal by reflection cubes. If `ends_in_cubes`,
    /// rays that leave shiny objects end in the cubes too.
    pub(crate) fn with_reflections(
        raycaster: Arc<Raycaster>,
        materials: Arc<Materials>,
        (eye, size): (&Eye, (u32, u32)),
        reflections: Option<&Reflections>,
        ends_in_cubes: bool,
    ) -> SurfaceView {
        let footprint = |distance| eye.pixel_footprint(size, distance) as f32;
        let grows = footprint(1.0) - footprint(0.0);
        let clips_sky = Camera::new(eye, size).clips_sky();
        let footprint = (footprint(0.0), grows);
        let size = (size.0 as usize, size.1 as usize);
        let mut view = SurfaceView {
            footprint,
            clips_sky,
            raycaster,
            materials,
            eye: *eye,
            size,
            seen: Vec::new(),
            ways: vec![SurfaceTrail::PLAIN],
            in_panes: Vec::new(),
            panes_of_middles: 0,
            on_edges: OnceLock::new(),
            edges: Vec::new(),
            pieces: Vec::new(),
            objects: BTreeMap::new(),
        };
        let mut seen = vec![VisiblePoint::NOTHING; size.0 * size.1];
        let bands: Vec<Band> = seen
            .par_chunks_mut(size.0 * SIDE)
            .enumerate()
            .map(|(part, rows)| {
                let follower = Follower { reflections, ends_in_cubes, ..view.follower() };
                view.cast_rows(&follower, part * SIDE, rows)
            })
            .collect();
        view.seen = seen;
        view.take_bands(bands);
        view.panes_of_middles = view.in_panes.len();
        view
    }

    pub(crate) fn follower(&self) -> Follower<'_> {
        Follower::new(&self.raycaster, &self.materials)
    }

    /// Returns the ray through a point of the picture, and its distance from the eye. The point is
    /// in pixels from the left and from the top.
    pub(crate) fn ray(&self, column: f64, row: f64) -> (Ray, f32) {
        let (x, y) = (column / self.size.0 as f64, 1.0 - row / self.size.1 as f64);
        let nowhere = (Ray { t_max: 0.0, ..Ray::new(Vec3::ZERO, Vec3::ZERO) }, 0.0);
        if !self.eye.is_clipped() {
            let (origin, direction) = self.eye.ray(x, y);
            let local = self.raycaster.localize(origin, direction);
            return local.map_or(nowhere, |(ray, skipped)| (ray, skipped as f32));
        }
        let Some((origin, direction, reach)) = self.eye.clipped_ray(x, y) else { return nowhere };
        let Some((ray, skipped)) = self.raycaster.localize(origin, direction) else {
            return nowhere;
        };
        let before = self.eye.ray(x, y).0.distance(origin) + skipped;
        (Ray { t_max: (reach - skipped) as f32, ..ray }, before as f32)
    }

    /// Returns the result for a pixel's ray that hits nothing.
    pub(crate) fn nothing(&self, direction: Vec3) -> RayContent {
        if self.clips_sky { RayContent::Unknown } else { RayContent::Sky([1.0; 3], direction) }
    }

    /// Returns the width of a pixel at the end of a way of this length.
    pub(crate) fn pixel_width(&self, length: f32) -> f32 {
        self.footprint.0 + self.footprint.1 * length
    }

    /// Returns the length of the way from the eye to a pixel's surface.
    pub(crate) fn length(&self, seen: &VisiblePoint) -> f32 {
        let (width, grows) = self.footprint;
        if grows > 0.0 {
            return (seen.width - width) / grows;
        }
        let (camera, eye) = self.camera();
        camera.sight(camera.to_camera(seen.point.as_dvec3() - eye).as_vec3()).length()
    }

    /// Returns the surface that a ray shows, and adds its way.
    pub(crate) fn seen_of(&mut self, shown: RayContent) -> VisiblePoint {
        if let RayContent::Surface(end) = &shown {
            let is_direct = end.share == [1.0; 3] && !end.is_mirrored;
            if is_direct && self.follower().is_plain(end.hit) {
                return seen(end, self.pixel_width(end.length), PLAIN);
            }
        }
        self.with_way(self.seen_along(&self.follower(), shown))
    }

    /// Adds a reflection in a pane that takes this share of a pixel.
    pub(crate) fn add_in_pane(&mut self, pixel: usize, shown: RayContent, share: f32) {
        let seen = self.with_way(self.seen_along(&self.follower(), shown));
        self.in_panes.push(InPane { pixel, seen, share, rank: 0 });
    }

    /// Casts the rays of `rows`, which begin at row `top`.
    fn cast_rows(&self, follower: &Follower, top: usize, rows: &mut [VisiblePoint]) -> Band {
        let width = self.size.0;
        let count = rows.len() / width;
        let mut band = Band::default();
        let (mut trails, mut of_trails) = (Vec::new(), Vec::new());
        for left in (0..width).step_by(SIDE) {
            let across = SIDE.min(width - left);
            let mut rays = [Ray::new(Vec3::ZERO, Vec3::ZERO); MAX_TILE];
            let mut befores = [0.0; MAX_TILE];
            let mut hits = [None; MAX_TILE];
            for number in 0..across * count {
                let (x, y) = (left + number % across, top + number / across);
                (rays[number], befores[number]) = self.ray(x as f64 + 0.5, y as f64 + 0.5);
            }
            let used = across * count;
            self.raycaster.nearest_tile(&rays[..used], &mut hits[..used]);
            trails.clear();
            of_trails.clear();
            let at = |number: usize| number / across * width + left + number % across;
            for number in 0..used {
                let (ray, before, hit) = (rays[number], befores[number], hits[number]);
                let Some(hit) = hit else {
                    let shown = self.nothing(ray.direction);
                    rows[at(number)] = band.add(self.seen_along(follower, shown));
                    continue;
                };
                if follower.is_plain(hit) {
                    let end = follower.end(&ray, hit);
                    let width = self.pixel_width(before + end.length);
                    rows[at(number)] = seen(&end, width, PLAIN);
                    continue;
                }
                if let Some(object) = follower.object(hit.triangle) {
                    *band.objects.entry(object).or_default() += 1;
                }
                trails.push(Trail::new(ray, hit, AtPanes::Pass));
                of_trails.push((number, false));
                if follower.splits(&hit) {
                    trails.push(Trail::new(ray, hit, AtPanes::ReflectFirst));
                    of_trails.push((number, true));
                }
            }
            let mut take = |(number, is_beside), shown: RayContent| {
                let seen = band.add(self.seen_along(follower, shown.farther(befores[number])));
                if is_beside {
                    let pixel = top * width + at(number);
                    band.in_panes.push(InPane { pixel, seen, share: 1.0, rank: 0 });
                } else {
                    rows[at(number)] = seen;
                }
            };
            follower.follow_many(&mut trails, |trail, shown| take(of_trails[trail], shown));
            // Panes that mirrors show mirror too, and so do partly covered mirrors.
            for (trail, &(number, _)) in trails.iter().zip(&of_trails) {
                if let Some(hit) = hits[number].filter(|_| trail.is_split())
                    && !follower.splits(&hit)
                {
                    let shown = follower.follow(rays[number], hit, AtPanes::ReflectFirst);
                    take((number, true), shown);
                }
            }
            for (trail, &(number, _)) in trails.iter_mut().zip(&of_trails) {
                for end in trail.take_covers() {
                    take((number, true), RayContent::Surface(end));
                }
            }
        }
        // Reflections were found before covered surfaces, and the sort keeps this order.
        band.in_panes.sort_by_key(|pane| pane.pixel);
        for of_pixel in band.in_panes.chunk_by_mut(|one, next| one.pixel == next.pixel) {
            of_pixel.iter_mut().enumerate().for_each(|(rank, pane)| pane.rank = rank);
        }
        band
    }

    /// Takes the ways of all bands, which are in the order of rows.
    fn take_bands(&mut self, bands: Vec<Band>) {
        let mut count = 0;
        let before = |band: &Band| {
            let before = count;
            count += band.ways.len();
            before as u32
        };
        let befores: Vec<u32> = bands.iter().map(before).collect();
        let number = |seen: &mut VisiblePoint, before| {
            seen.way += if seen.way == PLAIN { 0 } else { before }
        };
        let rows = self.seen.par_chunks_mut(self.size.0 * SIDE).zip(&befores);
        rows.for_each(|(rows, &before)| rows.iter_mut().for_each(|seen| number(seen, before)));
        self.ways.reserve(count);
        for (mut band, before) in bands.into_iter().zip(befores) {
            band.in_panes.iter_mut().for_each(|pane| number(&mut pane.seen, before));
            self.in_panes.append(&mut band.in_panes);
            self.ways.append(&mut band.ways);
            for (object, pixels) in band.objects {
                *self.objects.entry(object).or_default() += pixels;
            }
        }
    }

    /// Adds the way to a surface. Returns the surface with the way's number.
    fn with_way(&mut self, (seen, way): (VisiblePoint, SurfaceTrail)) -> VisiblePoint {
        self.ways.push(way);
        VisiblePoint { way: self.ways.len() as u32 - 1, ..seen }
    }

    /// Returns the surface that a ray shows, and the way to it. The way has no number yet.
    fn seen_along(&self, follower: &Follower, shown: RayContent) -> (VisiblePoint, SurfaceTrail) {
        let times = |a: Rgb, b: Rgb| [0, 1, 2].map(|channel: usize| a[channel] * b[channel]);
        let mut how = SurfaceTrail::PLAIN;
        let mut at = VisiblePoint::NOTHING;
        match shown {
            RayContent::Surface(end) => {
                let finish = follower.finish(end.material);
                let TrailEnd { share, direction, is_mirrored, pane, .. } = end;
                let width = self.pixel_width(end.length);
                how = SurfaceTrail { share, direction, is_mirrored, pane, ..how };
                if finish.shines(end.front) {
                    let emission = times(finish.emission, follower.glow(&end, width));
                    how.radiance = times(end.share, emission);
                    how.to_lamp = end.length;
                } else {
                    how.texture = follower.texture(&end, width);
                    how.mirrors = follower.mirrors(&end);
                    at = seen(&end, width, PLAIN);
                }
            }
            RayContent::Sky(share, direction) => {
                how.radiance = times(share, self.materials.sky_seen(direction));
            }
            RayContent::Light(light, length) => {
                (how.radiance, how.to_lamp) = (light, length);
            }
            RayContent::Unknown => {}
        }
        (at, how)
    }

    /// Returns the way to a surface.
    #[inline]
    pub(crate) fn way(&self, seen: &VisiblePoint) -> &SurfaceTrail {
        &self.ways[seen.way as usize]
    }

    /// Returns true if the surface has a clear coat over a diffuse base, and no mirror shows it.
    #[inline]
    pub(crate) fn shows_coat(&self, seen: &VisiblePoint) -> bool {
        seen.is_surface()
            && self.follower().finish(seen.material).is_coated
            && !self.way(seen).is_mirrored
    }

    /// Returns true if the light that the surface sends depends on the direction.
    pub(crate) fn is_glossy(&self, seen: &VisiblePoint) -> bool {
        seen.is_surface() && self.follower().finish(seen.material).kind == MaterialClass::Glossy
    }

    /// Returns true if two neighbouring pixels show different things.
    #[inline]
    pub(crate) fn differ(&self, one: &VisiblePoint, other: &VisiblePoint) -> bool {
        if one.way == other.way && !one.is_surface() && !other.is_surface() {
            return false;
        }
        let (through, by) = (self.way(one), self.way(other));
        let is_same_way = one.way == other.way
            || (through.is_mirrored == by.is_mirrored
                && are_near(through.share, by.share)
                && are_near(through.radiance, by.radiance));
        !is_same_way || (one.is_surface() || other.is_surface()) && one.differs(other)
    }

    /// Returns the face of a surface's samples.
    pub(crate) fn face(&self, seen: &VisiblePoint) -> FaceClass {
        let is_glossy = self.follower().finish(seen.material).kind == MaterialClass::Glossy;
        FaceClass::new(seen.normal, seen.material, is_glossy.then(|| self.way(seen).direction))
    }

    /// Returns the projection of points to pixels, and the eye's position relative to the scene's
    /// origin.
    pub(crate) fn camera(&self) -> (Camera, DVec3) {
        let camera = Camera::new(&self.eye, (self.size.0 as u32, self.size.1 as u32));
        let eye = camera.eye - self.raycaster.scene().origin;
        (camera, eye)
    }

    /// Returns the factor from a surface's light to its pixel's radiance, and the radiance to add.
    #[must_use]
    pub fn paint(&self, seen: &VisiblePoint) -> (Rgb, Rgb) {
        let way = &self.ways[seen.way as usize];
        if !seen.is_surface() {
            return ([0.0; 3], way.radiance);
        }
        let finish = self.follower().finish(seen.material);
        let reflectance = finish.reflectance_by(way.texture);
        let scale = [0, 1, 2].map(|c| reflectance[c] * way.share[c]);
        (scale, way.radiance)
    }

    /// Returns each pixel's albedo, between 0 and 1, and its normal, for a denoiser of traced
    /// pictures.
    #[must_use]
    pub fn features(&self) -> (Vec<Rgb>, Vec<[f32; 3]>) {
        let feature = |seen: &VisiblePoint| {
            let (scale, radiance) = self.paint(seen);
            let albedo = [0, 1, 2].map(|c| (scale[c] + radiance[c]).clamp(0.0, 1.0));
            (albedo, seen.normal.to_array())
        };
        self.seen.iter().map(feature).unzip()
    }

    /// Returns the eye, relative to the scene's origin.
    pub(crate) fn eye(&self) -> Vec3 {
        self.camera().1.as_vec3()
    }

    /// Returns the mean light that the scene's lamps let expect, fixed-point steps.
    pub(crate) fn expected_light(&self) -> Vec3 {
        Vec3::from(self.materials.expected_light(self.raycaster.scene())) / self.unit()
    }

    /// Returns the light of one fixed-point step.
    #[must_use]
    pub fn unit(&self) -> f32 {
        self.materials.unit
    }
}
