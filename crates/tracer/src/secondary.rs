//! Secondary sources: small surfaces beside lamps that send on so much light that a diffuse surface's samples, which find them
//! by chance, make most of a picture's error: housings, mirrors and polished metal around a bulb, the wall behind a sconce.
//!
//! Light is followed once from the emitters when the scene is prepared (Appel 1968; Arvo 1986, "Backward Ray Tracing"); triangles that then
//! send on much more per area than surfaces do on average are the leaves of a second tree like that of the lights. Wide
//! materials aim a share of their samples at them, and both ways of finding a point there are combined with one sample (Veach
//! 1997, §9.2.4, balance heuristic).
//!
//! Always true: what is aimed at is a function of the scene alone, and only decides where samples go: any set of triangles and
//! powers gives the same expectation. Emitters are never among them. A scene without such places pays nothing.

use std::collections::HashMap;
use std::ops::AddAssign;
use std::sync::Arc;

use glam::Vec3;
use holo_raycast::{Hit, Ray, Raycaster, SurfacePoint, spawn};
use holo_scene::Scene;

use crate::geometry::{Frame, cosine_hemisphere, triangle};
use crate::lights::{Aim, Chosen, Emitter, Lights, Seen, luminance};
use crate::panes::Panes;
use crate::path::Surface;
use crate::sampler::{Purpose, Sampler};

/// Paths of light that are followed: some 50 ms.
const PATHS: u32 = 1 << 16;
/// Surfaces that each may meet.
const DEPTH: u32 = 4;
/// Paths that must have met a place: fewer say little.
const LEAST_PATHS: u32 = 4;
/// How many times the average of the scene's lit surfaces a place must send on by area.
const CONTRAST: f64 = 30.0;
/// Places are cubes of this share of the scene's greatest side, by material: single facets are met too seldom.
const PLACES: f32 = 1.0 / 256.0;
/// Share of a vertex's samples that is aimed, if it sees any source. With 0.25, error and time are the same within a few percent.
const SHARE: f32 = 0.15;

/// What light brings to a place.
#[derive(Clone, Copy, Default)]
struct Place {
    area: f64,
    sent: Sent,
}

/// What light's paths bring to a triangle or a place, each path as much as any other.
#[derive(Clone, Copy, Default)]
pub(crate) struct Sent {
    /// Sent on from the counter-clockwise side, and from the other.
    pub flux: [f64; 2],
    /// Of that, what shows an emitter as a mirror does, and the same times the radiance that it shows.
    pub shown: f64,
    pub shown_radiance: f64,
    pub paths: u32,
}

impl Sent {
    fn flux(&self) -> f64 {
        self.flux[0] + self.flux[1]
    }

    /// Root of the mean square of the radiance that leaves `area`, where a path brings `flux_of_path` (over π): samples had best be
    /// so dense there. The mean, if it leaves in all directions; where a curved mirror shows a lamp to some, more.
    pub(crate) fn rms_radiance(&self, area: f64, flux_of_path: f64) -> f64 {
        let mean = self.flux() * flux_of_path / area;
        ((self.shown_radiance + (self.flux() - self.shown) * mean) * flux_of_path / area).sqrt()
    }
}

impl AddAssign for Sent {
    fn add_assign(&mut self, other: Self) {
        self.flux = [self.flux[0] + other.flux[0], self.flux[1] + other.flux[1]];
        self.shown += other.shown;
        self.shown_radiance += other.shown_radiance;
        self.paths += other.paths;
    }
}

/// The sources of a scene.
#[derive(Debug)]
pub(crate) struct Secondary {
    tree: Lights,
    /// A bit per triangle of the scene: most that a path meets are no sources.
    members: Vec<u64>,
}

/// A vertex that sees sources, at which [`SHARE`] of its samples are aimed.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aimed<'a> {
    sources: &'a Secondary,
    point: Vec3,
    normal: Vec3,
}

/// What the next sample of a vertex is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Choice {
    /// One of its material.
    Material,
    /// A point on a source.
    Source(SurfacePoint),
    /// None: what seemed to be there from farther up the tree is not.
    Nothing,
}

/// What a sample counts when it is known what it met.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Weight {
    /// Times value over density by the material.
    pub weight: f32,
    /// Whether it met a source.
    pub on_source: bool,
}

impl Aimed<'_> {
    /// Material or source, by numbers of [`Purpose::Aim`].
    #[inline]
    pub(crate) fn choose(&self, raycaster: &Raycaster, sampler: &mut Sampler) -> Choice {
        let (first, second) = sampler.pairs(1).at(0);
        if first >= f64::from(SHARE) {
            return Choice::Material;
        }
        self.target(raycaster, first / f64::from(SHARE), second)
            .map_or(Choice::Nothing, Choice::Source)
    }

    /// A point on a source by two uniform numbers; `None` if what seemed to be there from farther up the tree is not.
    #[inline]
    pub(crate) fn target(
        &self,
        raycaster: &Raycaster,
        first: f64,
        second: f32,
    ) -> Option<SurfacePoint> {
        let Chosen::Triangle { triangle, rest, .. } =
            self.sources.tree.choose(&self.seen(), first)?
        else {
            return None;
        };
        let (u, v) = Aim::new(self.point, raycaster.vertices(triangle)).sample([rest, second]);
        Some(raycaster.surface(triangle, u, v))
    }

    /// For a sample whose direction the material chooses with density `pdf`: aimed at `target` or not, and what it met. `None` if
    /// something else is in front of its target.
    #[inline]
    pub(crate) fn weight(
        &self,
        raycaster: &Raycaster,
        pdf: f32,
        target: &Choice,
        met: Option<&Hit>,
    ) -> Option<Weight> {
        if let Choice::Source(target) = target
            && met.is_none_or(|met| met.triangle != target.triangle)
        {
            return None;
        }
        let density = met.map_or(0.0, |met| self.density(raycaster, met));
        Some(Weight {
            weight: pdf / ((1.0 - SHARE) * pdf + SHARE * density),
            on_source: density > 0.0,
        })
    }

    /// For the few samples that need it.
    #[inline]
    fn seen(&self) -> Seen {
        self.sources.tree.seen(self.point, self.normal)
    }

    /// Density of aimed samples, per solid angle, towards a point that was met; 0 if that is on no source.
    #[inline]
    pub(crate) fn density(&self, raycaster: &Raycaster, met: &Hit) -> f32 {
        if self.sources.members[met.triangle as usize / 64] >> (met.triangle % 64) & 1 == 0 {
            return 0.0;
        }
        let probability = self.sources.tree.probability(&self.seen(), met.triangle);
        if probability == 0.0 {
            return 0.0;
        }
        let met = raycaster.surface(met.triangle, met.u, met.v);
        let aim = Aim::new(self.point, raycaster.vertices(met.triangle));
        let towards = met.point - self.point;
        let distance2 = towards.length_squared();
        probability * aim.density(distance2, towards.dot(met.normal).abs() / distance2.sqrt())
    }
}

impl Secondary {
    /// `None` if the scene has no such places.
    pub(crate) fn find(
        raycaster: &Arc<Raycaster>,
        surfaces: &[Surface],
        lights: &Lights,
    ) -> Option<Self> {
        let scene = raycaster.scene();
        let strength: Vec<f64> =
            scene.materials.iter().map(|m| f64::from(luminance(m.emission))).collect();
        let power = |t: u32| strength[scene.material_ids[t as usize] as usize] * scene.area(t);
        let emitters = lights.triangles();
        let mut sums = Vec::with_capacity(emitters.len());
        let mut total = 0.0;
        for &t in emitters {
            total += power(t);
            sums.push(total);
        }
        if total.is_nan() || total <= 0.0 || !total.is_finite() {
            return None;
        }
        let mut sent = HashMap::<u32, Sent>::new();
        for path in 0..PATHS {
            let mut sampler = Sampler::new(SEED, u64::from(path));
            sampler.turn(0, Purpose::Light);
            let (choice, _) = sampler.pairs(1).at(0);
            let i = sums.partition_point(|&sum| sum <= choice * total).min(emitters.len() - 1);
            let radiance = strength[scene.material_ids[emitters[i] as usize] as usize];
            follow(raycaster, surfaces, emitters[i], &mut sampler, &mut |t, side, share, shows| {
                let share = f64::from(share);
                let shown = if shows { share } else { 0.0 };
                let mut one = Sent {
                    shown,
                    shown_radiance: shown * share * radiance,
                    paths: 1,
                    ..Sent::default()
                };
                one.flux[side] = share;
                *sent.entry(t).or_default() += one;
            });
        }
        let tree = brightest(scene, &sent, total / f64::from(PATHS))?
            .with_cells(raycaster, &Arc::new(Panes::closed()));
        let mut members = vec![0; scene.triangles.len().div_ceil(64)];
        tree.triangles().iter().for_each(|&t| members[t as usize / 64] |= 1 << (t % 64));
        Some(Self { tree, members })
    }

    /// The sources as a surface sees them that is lit on the side of `normal`. `None` if it sees none.
    #[inline]
    pub(crate) fn aimed(&self, point: &SurfacePoint, normal: Vec3) -> Option<Aimed<'_>> {
        self.tree.reaches(point.point, normal).then(|| self.aimed_from(point, normal))
    }

    /// The same wherever it is: for many samples, of which some may be in vain.
    pub(crate) fn aimed_from(&self, point: &SurfacePoint, normal: Vec3) -> Aimed<'_> {
        Aimed { sources: self, point: point.point, normal }
    }
}

/// The triangles of the places that send on most by area, by what each sends on.
fn brightest(scene: &Scene, sent: &HashMap<u32, Sent>, flux_of_path: f64) -> Option<Lights> {
    let (low, high) = scene.bounds();
    let side = ((high - low).max_element() as f32 * PLACES).max(f32::MIN_POSITIVE);
    let is_large = |t: u32| {
        let [a, b, c] = scene.corners(t);
        (a.max(b).max(c) - a.min(b).min(c)).max_element() > side
    };
    let place_of = |t: u32| {
        let corners = scene.corners(t);
        let center = (corners[0] + corners[1] + corners[2]) / 3.0;
        let cube = (center / side).floor().as_ivec3().to_array();
        // A triangle that is larger than a cube is a place of its own.
        if is_large(t) { (cube, u32::MAX - t) } else { (cube, scene.material_ids[t as usize]) }
    };
    let candidates = || (0..scene.triangles.len() as u32).filter(|&t| !scene.material(t).emits());
    // Numbered in the order of triangles, so that sums are the same every time.
    let mut numbers = HashMap::new();
    let mut places: Vec<Place> = Vec::new();
    for t in candidates() {
        if let Some(&sent) = sent.get(&t) {
            // What shows a lamp in a small part of itself is not worth being aimed at all over.
            let sent =
                if is_large(t) { Sent { shown: 0.0, shown_radiance: 0.0, ..sent } } else { sent };
            let number = *numbers.entry(place_of(t)).or_insert(places.len());
            if number == places.len() {
                places.push(Place::default());
            }
            places[number].sent += sent;
        }
    }
    let numbers: Vec<Option<usize>> =
        candidates().map(|t| numbers.get(&place_of(t)).copied()).collect();
    for (t, number) in candidates().zip(&numbers) {
        if let Some(number) = *number {
            places[number].area += scene.area(t);
        }
    }
    let area: f64 = places.iter().map(|p| p.area).sum();
    let all: f64 = places.iter().map(|p| p.sent.flux()).sum();
    let mean = all * flux_of_path / area;
    let mut triangles = Vec::new();
    let mut emitters = Vec::new();
    for (t, number) in candidates().zip(&numbers) {
        let Some(Place { area, sent }) = number.map(|number| &places[number]) else { continue };
        let radiance = sent.rms_radiance(*area, flux_of_path);
        if sent.paths < LEAST_PATHS || radiance < CONTRAST * mean {
            continue;
        }
        let (front, back) = (sent.flux[0] > 0.0, sent.flux[1] > 0.0);
        let normal = if front { scene.normal(t) } else { -scene.normal(t) };
        triangles.push(t);
        emitters.push(Emitter::new(
            scene.corners(t),
            normal,
            radiance / mean * scene.area(t) / area,
            front && back,
        ));
    }
    (!triangles.is_empty()).then(|| Lights::over(triangles, emitters))
}

/// Of the numbers of light's paths: any will do.
const SEED: u64 = 0x5EC0_DA2E;

/// Follows light from a point of an emitter; says which triangles send on what share of it on which side, and whether as mirrors
/// show it.
fn follow(
    raycaster: &Raycaster,
    surfaces: &[Surface],
    emitter: u32,
    sampler: &mut Sampler,
    sent: &mut impl FnMut(u32, usize, f32, bool),
) {
    let material_ids = &raycaster.scene().material_ids;
    let (u, v) = triangle(sampler.two());
    let mut point = raycaster.surface(emitter, u, v);
    let mut normal = point.normal;
    if surfaces[material_ids[emitter as usize] as usize].two_sided && sampler.one() < 0.5 {
        normal = -normal;
    }
    let mut direction = Frame::new(normal).to_world(cosine_hemisphere(sampler.two()));
    let mut share = 1.0;
    let mut shows = true;
    for depth in 1..=DEPTH {
        let ray = Ray::new(spawn(point.point, point.error, point.normal, direction), direction);
        let Some(hit) = raycaster.nearest_from(&ray, point.triangle) else { return };
        point = raycaster.surface(hit.triangle, hit.u, hit.v);
        let front = direction.dot(point.normal) < 0.0;
        let frame = Frame::new(if front { point.normal } else { -point.normal });
        let wo = frame.to_local(-direction);
        if wo.z <= 0.0 {
            return;
        }
        sampler.turn(depth, Purpose::Scatter);
        let scatter = &surfaces[material_ids[hit.triangle as usize] as usize].scatter;
        let Some(sampled) = scatter.sample(wo, front, sampler) else { return };
        shows &= sampled.pdf.is_none();
        share *= luminance(sampled.weight.to_array()).min(1.0);
        if sampled.wi.z > 0.0 {
            sent(hit.triangle, usize::from(!front), share, shows);
        }
        direction = frame.to_world(sampled.wi);
    }
}
