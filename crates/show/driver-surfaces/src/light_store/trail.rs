//! Follows rays through mirrors, panes and solid glass to the surface whose light they show.
//!
//! A ray that meets solid glass follows the light that passes, and is reflected only if none
//! passes. A second ray shows what the first glass on the way reflects. Light that is reflected
//! inside the glass counts as if it were as bright as the light that passes.
//!
//! Rays of a view pass surfaces that are partly covered, and note them: a pixel shows each with its
//! opacity, and what is behind with the rest. A sample shows one surface alone, at its distance.
//! The first mirror on the way that is partly covered is treated like a pane, which passes and
//! reflects. Further ones are there if they are there for most rays.
//!
//! Invariant: the end of a ray is a function of the ray and the scene.

use super::materials::{Finish, MaterialClass, Materials};
use super::reflections::Reflections;
use glam::Vec3;
use holo_optics::{dielectric, pane};
use holo_raycast::{Hit, Ray, Raycaster, spawn};
use holo_scene::Rgb;

/// Most mirrors, panes and surfaces of solid glass along a ray.
const MOST_SURFACES: usize = 16;

/// Least cosine between a smooth normal and the direction to the eye. Beyond, the tracer bends the
/// normal to the eye, and so the same must be done here.
const LEAST_COSINE: f32 = 0.02;

/// The surface where a ray ends.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TrailEnd {
    pub point: Vec3,
    /// The unit normal on the side that the ray meets.
    pub normal: Vec3,
    /// True if the ray meets the counter-clockwise side.
    pub front: bool,
    pub material: u32,
    /// The material's [`Finish::light`].
    pub light: u32,
    /// The ray's unit direction when it meets the surface.
    pub direction: Vec3,
    /// The share of the surface's light that comes back along the whole way.
    pub share: Rgb,
    /// The length of the whole way, scene units.
    pub length: f32,
    /// True if a mirror, a pane or solid glass has turned the ray.
    pub is_mirrored: bool,
    /// The share of light that the first pane or solid glass on the way reflects; 0 without any,
    /// and behind a partly covered mirror. Samples of the surface contain that light.
    pub pane: f32,
    pub hit: Hit,
}

/// What a ray shows.
#[derive(Clone, Copy, Debug)]
pub(crate) enum RayContent {
    Surface(TrailEnd),
    /// This share of the sky in this unit direction.
    Sky(Rgb, Vec3),
    /// This radiance from a reflection cube, at the end of a way of this length.
    Light(Rgb, f32),
    /// Unknown because too many mirrors are on the way.
    Unknown,
}

impl RayContent {
    /// Returns the same at the end of a way that is longer by `before`.
    pub fn farther(self, before: f32) -> RayContent {
        match self {
            RayContent::Surface(end) => {
                RayContent::Surface(TrailEnd { length: end.length + before, ..end })
            }
            RayContent::Light(light, length) => RayContent::Light(light, length + before),
            other => other,
        }
    }
}

/// Treatment of a ray at panes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AtPanes {
    /// They let it pass, and keep the share of light that is transmitted. So do partly covered
    /// mirrors.
    Pass,
    /// They let it pass, and keep the share that is transmitted or reflected. The reflection counts
    /// as if it were as bright as the light behind the pane. Mirrors are whole: a sample has met
    /// its first surface.
    PassAll,
    /// The first pane or partly covered mirror reflects it. Further ones let it pass.
    ReflectFirst,
}

/// A ray at a boundary of solid glass.
struct AtBoundary {
    /// True if the ray comes from outside.
    enters: bool,
    /// The share of light that is reflected.
    reflected: f32,
    /// The direction of the ray that passes, if it can.
    onward: Option<Vec3>,
}

/// Bends a normal until its cosine to the direction of the eye is at least [`LEAST_COSINE`]: a
/// surface that is seen faces the eye. `None` if no direction is left.
fn facing_eye(normal: Vec3, towards_eye: Vec3) -> Option<Vec3> {
    let cosine = normal.dot(towards_eye);
    if cosine >= LEAST_COSINE {
        return Some(normal);
    }
    (normal + towards_eye * (LEAST_COSINE - cosine)).try_normalize()
}

/// Follows rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Follower<'a> {
    pub raycaster: &'a Raycaster,
    pub materials: &'a Materials,
    /// The cubes of the scene's shiny objects, if the view may use them.
    pub reflections: Option<&'a Reflections>,
    /// True if rays that leave shiny objects end in their cubes.
    pub ends_in_cubes: bool,
}

impl<'a> Follower<'a> {
    /// Returns a follower that uses no reflection cubes.
    pub fn new(raycaster: &'a Raycaster, materials: &'a Materials) -> Self {
        Self { raycaster, materials, reflections: None, ends_in_cubes: false }
    }

    /// Returns the number of the shiny object that a triangle belongs to, if the view may use
    /// reflection cubes.
    #[inline]
    pub fn object(&self, triangle: u32) -> Option<u32> {
        self.reflections?.object(triangle)
    }

    /// Returns the shiny object of rough metal at the end of a way, and its smooth normal there.
    /// `None` for other surfaces.
    pub fn mirrors(&self, end: &TrailEnd) -> Option<(u32, Vec3)> {
        let object = self.object(end.hit.triangle)?;
        self.finish(end.material).rough?;
        let (_, smooth) = self.normals(end.direction, &end.hit);
        Some((object, smooth))
    }

    pub fn finish(&self, material: u32) -> &'a Finish {
        &self.materials.finishes[material as usize]
    }

    pub fn material(&self, triangle: u32) -> u32 {
        self.raycaster.scene().material_id(triangle)
    }

    /// Returns true if the surface at a hit passes a part of the light and mirrors a part: a pane,
    /// or a partly covered mirror.
    pub fn splits(&self, hit: &Hit) -> bool {
        match self.finish(self.material(hit.triangle)).kind {
            MaterialClass::Pane { .. } => true,
            MaterialClass::Mirror(_) => self.opacity(hit) < 1.0,
            _ => false,
        }
    }

    /// Returns the opacity of the surface at a hit, from above 0 to 1.
    #[inline]
    pub fn opacity(&self, hit: &Hit) -> f32 {
        match self.raycaster.has_covers() {
            true => self.raycaster.scene().opacity(hit.triangle, hit.u, hit.v),
            false => 1.0,
        }
    }

    /// Returns the normals of a surface at a hit that face the ray: of the triangle, and of the
    /// smooth surface. They are equal if the surface is flat.
    #[inline]
    fn normals(&self, direction: Vec3, hit: &Hit) -> (Vec3, Vec3) {
        let facet = self.raycaster.geometric_normal(hit.triangle);
        let facing = if facet.dot(direction) <= 0.0 { facet } else { -facet };
        let Some(smooth) = self.raycaster.scene().smooth_normal(hit.triangle, hit.u, hit.v) else {
            return (facing, facing);
        };
        let smooth = if smooth.dot(facing) < 0.0 { -smooth } else { smooth };
        (facing, facing_eye(smooth, -direction).unwrap_or(facing))
    }

    /// Returns the direction of a ray that a mirror reflects, as the tracer does. `None` if a
    /// smooth normal sends it behind the triangle: the mirror is black there.
    #[inline]
    fn mirrored(&self, ray: &Ray, hit: &Hit) -> Option<Vec3> {
        let (facing, smooth) = self.normals(ray.direction, hit);
        let onward = ray.direction - 2.0 * ray.direction.dot(smooth) * smooth;
        (onward.dot(facing) > 0.0).then(|| onward.normalize())
    }

    /// Returns the way of a ray on, at a boundary of solid glass with the index of refraction
    /// `ior`.
    fn at_boundary(&self, ray: &Ray, hit: &Hit, ior: f32) -> AtBoundary {
        let (facing, smooth) = self.normals(ray.direction, hit);
        let enters = facing.dot(self.raycaster.geometric_normal(hit.triangle)) > 0.0;
        let eta = if enters { ior } else { 1.0 / ior };
        let cosine = -ray.direction.dot(smooth);
        let (reflected, beyond) = dielectric(cosine, eta);
        let onward = (ray.direction / eta + (cosine / eta - beyond) * smooth).normalize_or_zero();
        let passes = reflected < 1.0 && onward.dot(facing) < 0.0;
        AtBoundary { enters, reflected, onward: passes.then_some(onward) }
    }

    /// Returns the surface at a hit.
    #[inline]
    pub fn end(&self, ray: &Ray, hit: Hit) -> TrailEnd {
        let normal = self.raycaster.geometric_normal(hit.triangle);
        let front = normal.dot(ray.direction) <= 0.0;
        let material = self.material(hit.triangle);
        TrailEnd {
            point: self.raycaster.surface_point(&hit).0,
            normal: if front { normal } else { -normal },
            front,
            material,
            light: self.finish(material).light,
            direction: ray.direction,
            share: [1.0; 3],
            length: hit.t,
            is_mirrored: false,
            pane: 0.0,
            hit,
        }
    }

    /// Returns the factor of the texture at the end of a way, as a mean over a place of this width;
    /// 1 without a texture.
    pub fn texture(&self, end: &TrailEnd, width: f32) -> Rgb {
        self.texture_at(end.hit, width)
    }

    fn texture_at(&self, hit: Hit, width: f32) -> Rgb {
        let Hit { triangle, u, v, .. } = hit;
        self.raycaster.scene().base_texture(triangle, u, v, width).unwrap_or([1.0; 3])
    }

    /// Returns the factor of a lamp's emission at the end of a way: that of its texture, and that
    /// of a luminaire in the direction of the way.
    pub fn glow(&self, end: &TrailEnd, width: f32) -> Rgb {
        let Hit { triangle, u, v, .. } = end.hit;
        let share = self.luminaire_share(end);
        let texture = self.raycaster.scene().emission_texture(triangle, u, v, width);
        texture.unwrap_or([1.0; 3]).map(|channel| channel * share)
    }

    /// Returns the radiance of a luminaire in the direction of a way over its material's emission;
    /// 1 for other lamps.
    pub fn luminaire_share(&self, end: &TrailEnd) -> f32 {
        let luminaire = self.raycaster.scene().luminaire_of(end.material);
        luminaire.map_or(1.0, |luminaire| luminaire.share(-end.direction))
    }

    /// Returns true if the hit is on a whole surface that is no mirror, pane or lamp and has no
    /// texture.
    #[inline]
    pub fn is_plain(&self, hit: Hit) -> bool {
        let finish = self.finish(self.material(hit.triangle));
        let is_diffuse = finish.kind == MaterialClass::Diffuse && !finish.emits;
        is_diffuse && !self.raycaster.scene().has_texture(hit.triangle) && self.opacity(&hit) >= 1.0
    }

    /// Follows a ray from its first hit to a surface that stores light.
    pub fn follow(&self, ray: Ray, hit: Hit, panes: AtPanes) -> RayContent {
        self.follow_to_end(&mut Trail::new(ray, hit, panes))
    }

    /// Follows a ray to its end.
    pub fn follow_to_end(&self, trail: &mut Trail) -> RayContent {
        loop {
            if let Some(shown) = trail.advance(self).or_else(|| trail.remembered(self)) {
                return shown;
            }
            let next = self.raycaster.nearest_from(&trail.ray, trail.hit.triangle);
            if let Some(shown) = trail.meet(next) {
                return shown;
            }
        }
    }

    /// Follows many rays as [`follow`](Self::follow) does, and gives what each shows to `ended`
    /// with its index. Their rays are cast together, which is faster.
    pub fn follow_many(&self, trails: &mut [Trail], mut ended: impl FnMut(usize, RayContent)) {
        let mut active: Vec<usize> = (0..trails.len()).collect();
        let (mut rays, mut from, mut hits) = (Vec::new(), Vec::new(), Vec::new());
        while !active.is_empty() {
            let advance =
                |trail: &mut Trail| trail.advance(self).or_else(|| trail.remembered(self));
            active.retain(|&number| match advance(&mut trails[number]) {
                Some(shown) => {
                    ended(number, shown);
                    false
                }
                None => true,
            });
            rays.clear();
            rays.extend(active.iter().map(|&number| trails[number].ray));
            from.clear();
            from.extend(active.iter().map(|&number| trails[number].hit.triangle));
            hits.clear();
            hits.resize(active.len(), None);
            self.raycaster.nearest_many_from(&rays, &from, &mut hits);
            let mut hits = hits.iter();
            active.retain(|&number| {
                let shown = trails[number].meet(hits.next().copied().flatten());
                let goes_on = shown.is_none();
                shown.into_iter().for_each(|shown| ended(number, shown));
                goes_on
            });
        }
    }
}

/// A ray on its way through mirrors and panes.
pub(crate) struct Trail {
    ray: Ray,
    hit: Hit,
    panes: AtPanes,
    share: Rgb,
    length: f32,
    is_mirrored: bool,
    pane: f32,
    /// True once the ray has met a surface that passes a part of the light and mirrors a part.
    is_split: bool,
    surfaces: usize,
    /// The product of what covered surfaces have let pass.
    passed: f32,
    /// Surfaces that are partly covered, with their shares.
    covers: Vec<TrailEnd>,
}

impl Trail {
    /// Returns a ray at its first hit.
    pub fn new(ray: Ray, hit: Hit, panes: AtPanes) -> Trail {
        let (share, length, is_mirrored, pane, surfaces) = ([1.0; 3], 0.0, false, 0.0, 0);
        let (is_split, passed, covers) = (false, 1.0, Vec::new());
        Trail {
            ray,
            hit,
            panes,
            share,
            length,
            is_mirrored,
            pane,
            is_split,
            surfaces,
            passed,
            covers,
        }
    }

    /// Returns true if the ray has met a pane, solid glass or a partly covered mirror. A ray with
    /// [`AtPanes::ReflectFirst`] shows what that surface mirrors.
    pub fn is_split(&self) -> bool {
        self.is_split
    }

    /// Returns true if the first of these surfaces is a mirror.
    pub fn passes_mirror(&self) -> bool {
        self.is_split && self.pane == 0.0
    }

    /// Returns true if a mirror, a pane or solid glass has turned the ray.
    pub fn turns(&self) -> bool {
        self.is_mirrored
    }

    /// Takes the surfaces that are partly covered and that the ray has passed.
    pub fn take_covers(&mut self) -> Vec<TrailEnd> {
        std::mem::take(&mut self.covers)
    }

    /// Returns the end of the ray at its hit.
    fn end(&self, follower: &Follower) -> TrailEnd {
        let end = follower.end(&self.ray, self.hit);
        let Trail { share, is_mirrored, pane, .. } = *self;
        TrailEnd { share, length: self.length + self.hit.t, is_mirrored, pane, ..end }
    }

    /// Moves the ray from its hit on, if this is a mirror or a pane. Returns what it shows if it
    /// ends here.
    fn advance(&mut self, follower: &Follower) -> Option<RayContent> {
        let hit = self.hit;
        let normal = follower.raycaster.geometric_normal(hit.triangle);
        let kind = follower.finish(follower.material(hit.triangle)).kind;
        let opacity = follower.opacity(&hit);
        let (colour, onward) = match kind {
            // A sample whose way has a surface that may not be there shows something unknown.
            _ if opacity < 1.0 && self.panes == AtPanes::PassAll && self.surfaces > 0 => {
                return Some(RayContent::Unknown);
            }
            MaterialClass::Diffuse | MaterialClass::Glossy
                if opacity < 1.0 && self.panes != AtPanes::PassAll =>
            {
                let end = self.end(follower);
                self.covers.push(TrailEnd { share: end.share.map(|c| c * opacity), ..end });
                self.passed *= 1.0 - opacity;
                ([1.0 - opacity; 3], self.ray.direction)
            }
            MaterialClass::Diffuse | MaterialClass::Glossy => {
                return Some(RayContent::Surface(self.end(follower)));
            }
            MaterialClass::Mirror(ks) => {
                let there = match self.panes {
                    AtPanes::PassAll => 1.0,
                    _ if self.is_split => opacity.round(),
                    AtPanes::Pass | AtPanes::ReflectFirst => opacity,
                };
                self.is_split |= there > 0.0 && there < 1.0;
                if there < 1.0 && self.panes == AtPanes::Pass {
                    ([1.0 - there; 3], self.ray.direction)
                } else {
                    if there < 1.0 {
                        self.panes = AtPanes::Pass;
                    }
                    match follower.mirrored(&self.ray, &hit) {
                        Some(mirrored) => (ks.map(|ks| there * ks), mirrored),
                        None => return Some(RayContent::Sky([0.0; 3], self.ray.direction)),
                    }
                }
            }
            MaterialClass::Pane { ior, transmittance } => {
                let there = if self.panes == AtPanes::PassAll { 1.0 } else { opacity };
                let cosine = self.ray.direction.dot(normal);
                let mirrored = self.ray.direction - 2.0 * cosine * normal;
                let all_reflected = pane(cosine.abs(), ior);
                let reflected = there * all_reflected;
                let tint = follower.texture_at(hit, 0.0);
                let passes = [0, 1, 2].map(|c| {
                    let clear = transmittance[c] * tint[c] * (1.0 - all_reflected);
                    1.0 - there + there * clear
                });
                self.meet_glass(reflected);
                match self.panes {
                    AtPanes::Pass => (passes, self.ray.direction),
                    AtPanes::PassAll => (passes.map(|p| p + reflected), self.ray.direction),
                    AtPanes::ReflectFirst => {
                        self.panes = AtPanes::Pass;
                        ([reflected; 3], mirrored)
                    }
                }
            }
            // A sample shows what one of many ways through solid glass met.
            MaterialClass::Solid { .. } if self.panes == AtPanes::PassAll => {
                return Some(RayContent::Unknown);
            }
            MaterialClass::Solid { ior, transmittance } => {
                let boundary = follower.at_boundary(&self.ray, &hit, ior);
                let reflects_first = self.panes == AtPanes::ReflectFirst && boundary.enters;
                if boundary.enters && boundary.onward.is_some() {
                    self.meet_glass(boundary.reflected);
                }
                match boundary.onward.filter(|_| !reflects_first) {
                    Some(onward) => {
                        // What is reflected inside leaves elsewhere, and other such light here.
                        let lost = if boundary.enters { boundary.reflected } else { 0.0 };
                        (transmittance.map(|t| t * (1.0 - lost)), onward)
                    }
                    None => {
                        self.panes = AtPanes::Pass;
                        let Some(mirrored) = follower.mirrored(&self.ray, &hit) else {
                            return Some(RayContent::Sky([0.0; 3], self.ray.direction));
                        };
                        ([boundary.reflected; 3], mirrored)
                    }
                }
            }
        };
        self.is_mirrored |= onward != self.ray.direction;
        self.share = [0, 1, 2].map(|channel| self.share[channel] * colour[channel]);
        self.length += hit.t;
        let (at, error) = follower.raycaster.surface_point(&hit);
        self.ray = Ray::new(spawn(at, error, normal, onward), onward);
        None
    }

    /// Notes a pane or solid glass that reflects this share of light.
    fn meet_glass(&mut self, reflected: f32) {
        if !self.is_split && reflected > 0.0 {
            self.is_split = true;
            self.pane = reflected * self.passed;
        }
    }

    /// Returns the light of the ray that leaves the last surface, if this is part of a shiny object
    /// whose cube knows it.
    #[inline]
    fn remembered(&self, follower: &Follower) -> Option<RayContent> {
        let reflections = follower.reflections.filter(|_| follower.ends_in_cubes)?;
        let triangle = self.hit.triangle;
        let object = reflections.object(triangle)?;
        let is_solid = matches!(
            follower.finish(follower.material(triangle)).kind,
            MaterialClass::Solid { .. }
        );
        if is_solid && follower.raycaster.geometric_normal(triangle).dot(self.ray.direction) <= 0.0
        {
            return None;
        }
        let (radiance, distance) = reflections.along(object, &self.ray)?;
        let light = [0, 1, 2].map(|channel: usize| self.share[channel] * radiance[channel]);
        Some(RayContent::Light(light, self.length + distance))
    }

    /// Takes the next hit. Returns what the ray shows if it does not go on.
    fn meet(&mut self, hit: Option<Hit>) -> Option<RayContent> {
        let Some(hit) = hit else { return Some(RayContent::Sky(self.share, self.ray.direction)) };
        self.hit = hit;
        self.surfaces += 1;
        (self.surfaces == MOST_SURFACES).then_some(RayContent::Unknown)
    }
}
