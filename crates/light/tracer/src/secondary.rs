//! Secondary sources: small surfaces near lamps that reflect so much light that they dominate the
//! noise of a picture. Examples are lamp housings, polished metal around a bulb, and the wall
//! behind a sconce. Diffuse surfaces find them only by chance.
//!
//! When the scene is prepared, light paths from the emitters are traced once (Appel 1968; Arvo
//! 1986, "Backward Ray Tracing"). Triangles that reflect far more light per area than the average
//! become the leaves of a second light tree. Wide materials aim a share of their samples at it. One
//! sample combines both ways of finding a point there (Veach 1997, §9.2.4, balance heuristic).
//!
//! Invariant: the set of sources is a function of the scene alone. It only decides where samples
//! go: any set of triangles and powers gives the same expectation. Emitters are never secondary
//! sources. A scene without secondary sources pays nothing.

use std::collections::HashMap;
use std::ops::AddAssign;
use std::sync::Arc;

use glam::Vec3;
use holo_raycast::{Hit, Ray, Raycaster, SurfacePoint, spawn};
use holo_scene::Scene;

use crate::geometry::{ShadingFrame, cosine_hemisphere, triangle};
use crate::lights::{Aim, ChosenLight, Emitter, LATER, Lights, PreparedPoint, VertexLights};
use crate::luminance::luminance;
use crate::panes::Panes;
use crate::sampler::{NumberPurpose, Sampler};
use crate::surface::TracedMaterial;

/// Number of light paths: about 50 ms of work.
const PATHS: u32 = 1 << 16;
/// Most surfaces of a light path.
const DEPTH: u32 = 4;
/// Light paths that must have met a patch; fewer would give no reliable estimate.
const MIN_PATHS: u32 = 4;
/// Reflected flux per area of a source, over the average of the scene's lit surfaces.
const CONTRAST: f64 = 30.0;
/// Side of a patch over the scene's longest side. A patch is what one material has in one cube of
/// that side, because light paths meet single facets too rarely.
const PATCH_SIZE: f32 = 1.0 / 256.0;
/// The light that a patch reflects.
#[derive(Clone, Copy, Default)]
struct Patch {
    area: f64,
    outgoing: OutgoingFlux,
}

/// The flux that light paths bring to a triangle or patch and that it reflects; each path starts
/// with 1.
#[derive(Clone, Copy, Default)]
struct OutgoingFlux {
    /// Flux that leaves the counter-clockwise side, and the other side.
    flux: [f64; 2],
    /// Number of light paths.
    paths: u32,
}

impl OutgoingFlux {
    fn flux(&self) -> f64 {
        self.flux[0] + self.flux[1]
    }
}

impl AddAssign for OutgoingFlux {
    fn add_assign(&mut self, other: Self) {
        self.flux = [self.flux[0] + other.flux[0], self.flux[1] + other.flux[1]];
        self.paths += other.paths;
    }
}

/// The secondary sources of a scene.
#[derive(Debug)]
pub(crate) struct SecondarySources {
    tree: Lights,
    /// One bit per triangle of the scene; most triangles that a path meets are no sources.
    members: Vec<u64>,
}

/// A vertex that may see sources and aims some of its samples at them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AimedVertex<'a> {
    sources: &'a SecondarySources,
    point: Vec3,
    normal: Vec3,
}

impl AimedVertex<'_> {
    /// Returns a point on a source by two uniform numbers. `None` if the descent of the tree ends
    /// where no source can contribute.
    #[inline]
    pub(crate) fn target(
        &self,
        raycaster: &Raycaster,
        first: f64,
        second: f32,
    ) -> Option<SurfacePoint> {
        let ChosenLight::Triangle { triangle, rest, .. } =
            self.sources.tree.choose(&self.lights(), first)?
        else {
            return None;
        };
        let (u, v) = Aim::new(self.point, raycaster.vertices(triangle)).sample([rest, second]);
        Some(raycaster.surface(triangle, u, v))
    }

    /// Computed on demand, because few samples need it.
    #[inline]
    fn lights(&self) -> VertexLights {
        self.sources.tree.at_vertex(self.point, self.normal, LATER)
    }

    /// Returns the density of aimed samples, per solid angle, towards a point that a ray met; 0 if
    /// the point is on no source.
    #[inline]
    pub(crate) fn density(&self, raycaster: &Raycaster, met: &Hit) -> f32 {
        if self.sources.members[met.triangle as usize / 64] >> (met.triangle % 64) & 1 == 0 {
            return 0.0;
        }
        let probability = self.sources.tree.probability(&self.lights(), met.triangle);
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

impl SecondarySources {
    /// Finds the sources of a scene. `None` if there are none.
    pub(crate) fn find(
        raycaster: &Arc<Raycaster>,
        surfaces: &[TracedMaterial],
        lights: &Lights,
    ) -> Option<Self> {
        let scene = raycaster.scene();
        let strength: Vec<f64> =
            scene.materials.iter().map(|m| f64::from(luminance(m.emission))).collect();
        let power = |t: u32| strength[scene.material_id(t) as usize] * scene.area(t);
        let (emitters, points) = (lights.triangles(), lights.points());
        let of_point = |p: &PreparedPoint| f64::from(p.strength() * p.extent());
        let powers = emitters.iter().map(|&t| power(t)).chain(points.iter().map(of_point));
        let mut total = 0.0;
        let sums: Vec<f64> = powers
            .map(|power| {
                total += power;
                total
            })
            .collect();
        if total.is_nan() || total <= 0.0 || !total.is_finite() {
            return None;
        }
        let mut outgoing = HashMap::<u32, OutgoingFlux>::new();
        for path in 0..PATHS {
            let mut sampler = Sampler::new(SEED, u64::from(path));
            sampler.turn(0, NumberPurpose::Light);
            let (choice, _) = sampler.pairs(1).at(0);
            let i = sums.partition_point(|&sum| sum <= choice * total).min(sums.len() - 1);
            let light = match emitters.get(i) {
                Some(&triangle) => LightPathStart::Triangle(triangle),
                None => LightPathStart::Point(&points[i - emitters.len()]),
            };
            follow(raycaster, surfaces, &light, &mut sampler, &mut |t, side, share| {
                let mut one = OutgoingFlux { flux: [0.0; 2], paths: 1 };
                one.flux[side] = f64::from(share);
                *outgoing.entry(t).or_default() += one;
            });
        }
        let tree = brightest(scene, &outgoing, total / f64::from(PATHS))?.with_cells(
            &[CELLS],
            raycaster,
            &Arc::new(Panes::closed()),
        );
        let mut members = vec![0; scene.triangles().len().div_ceil(64)];
        tree.triangles().iter().for_each(|&t| members[t as usize / 64] |= 1 << (t % 64));
        Some(Self { tree, members })
    }

    /// Returns the sources as a surface sees them that is lit on the side of `normal`. `None` if it
    /// sees none.
    #[inline]
    pub(crate) fn aimed(&self, point: &SurfacePoint, normal: Vec3) -> Option<AimedVertex<'_>> {
        self.tree.reaches(point.point, normal).then(|| self.aimed_from(point, normal))
    }

    /// The same without the test whether any source can be seen. For callers that take many
    /// samples.
    pub(crate) fn aimed_from(&self, point: &SurfacePoint, normal: Vec3) -> AimedVertex<'_> {
        AimedVertex { sources: self, point: point.point, normal }
    }
}

/// Returns a tree of the triangles whose patches reflect the most flux per area.
fn brightest(
    scene: &Scene,
    outgoing: &HashMap<u32, OutgoingFlux>,
    flux_of_path: f64,
) -> Option<Lights> {
    let (low, high) = scene.bounds();
    let side = ((high - low).max_element() as f32 * PATCH_SIZE).max(f32::MIN_POSITIVE);
    let is_large = |t: u32| {
        let [a, b, c] = scene.corners(t);
        (a.max(b).max(c) - a.min(b).min(c)).max_element() > side
    };
    let patch_of = |t: u32| {
        let corners = scene.corners(t);
        let center = (corners[0] + corners[1] + corners[2]) / 3.0;
        let cube = (center / side).floor().as_ivec3().to_array();
        // A triangle that is larger than a cube is a patch of its own.
        if is_large(t) { (cube, u32::MAX - t) } else { (cube, scene.material_id(t)) }
    };
    let candidates = || scene.triangles().filter(|&t| !scene.material(t).emits());
    // Numbered in the order of triangles, so that sums do not depend on the hash map.
    let mut numbers = HashMap::new();
    let mut patches: Vec<Patch> = Vec::new();
    for t in candidates() {
        if let Some(&outgoing) = outgoing.get(&t) {
            let number = *numbers.entry(patch_of(t)).or_insert(patches.len());
            if number == patches.len() {
                patches.push(Patch::default());
            }
            patches[number].outgoing += outgoing;
        }
    }
    let numbers: Vec<Option<usize>> =
        candidates().map(|t| numbers.get(&patch_of(t)).copied()).collect();
    for (t, number) in candidates().zip(&numbers) {
        if let Some(number) = *number {
            patches[number].area += scene.area(t);
        }
    }
    let area: f64 = patches.iter().map(|p| p.area).sum();
    let all: f64 = patches.iter().map(|p| p.outgoing.flux()).sum();
    let mean = all * flux_of_path / area;
    let mut triangles = Vec::new();
    let mut emitters = Vec::new();
    for (t, number) in candidates().zip(&numbers) {
        let Some(Patch { area, outgoing }) = number.map(|number| &patches[number]) else {
            continue;
        };
        let radiance = outgoing.flux() * flux_of_path / area;
        if outgoing.paths < MIN_PATHS || radiance < CONTRAST * mean {
            continue;
        }
        let (front, back) = (outgoing.flux[0] > 0.0, outgoing.flux[1] > 0.0);
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

/// Approximate number of cells in the grid that chooses among the sources. With 8192 cells, noise
/// is 1.5 % less, but estimating them takes as long as 50,000 paths.
const CELLS: f32 = 512.0;

/// Seed of the light paths; any number will do.
const SEED: u64 = 0x5EC0_DA2E;

/// The emitter where a light path starts.
enum LightPathStart<'a> {
    Triangle(u32),
    Point(&'a PreparedPoint),
}

/// Traces one light path from a point of an emitter. Calls `outgoing` for each surface that
/// reflects it, with triangle, side (0: counter-clockwise) and remaining flux.
fn follow(
    raycaster: &Raycaster,
    surfaces: &[TracedMaterial],
    light: &LightPathStart,
    sampler: &mut Sampler,
    outgoing: &mut impl FnMut(u32, usize, f32),
) {
    let surface = |triangle: u32| &surfaces[raycaster.scene().material_id(triangle) as usize];
    let (mut point, mut direction, mut share) = match *light {
        LightPathStart::Triangle(emitter) => {
            let (u, v) = triangle(sampler.two());
            let point = raycaster.surface(emitter, u, v);
            let mut normal = point.normal;
            if surface(emitter).two_sided && sampler.one() < 0.5 {
                normal = -normal;
            }
            let direction = ShadingFrame::new(normal).to_world(cosine_hemisphere(sampler.two()));
            let luminaire = surface(emitter).luminaire.as_ref();
            (point, direction, luminaire.map_or(1.0, |luminaire| luminaire.share(direction)))
        }
        LightPathStart::Point(light) => {
            let (direction, share) = light.direction(sampler.two());
            (light.place(), direction, share)
        }
    };
    for depth in 1..=DEPTH {
        let ray = Ray::new(spawn(point.point, point.error, point.normal, direction), direction);
        let Some(hit) = raycaster.nearest_from(&ray, point.triangle) else { return };
        point = raycaster.surface(hit.triangle, hit.u, hit.v);
        let front = direction.dot(point.normal) < 0.0;
        let frame = ShadingFrame::new(if front { point.normal } else { -point.normal });
        let wo = frame.to_local(-direction);
        if wo.z <= 0.0 {
            return;
        }
        sampler.turn(depth, NumberPurpose::Scatter);
        let scatter = &surface(hit.triangle).scatter;
        let Some(sampled) = scatter.sample(wo, front, sampler) else { return };
        share *= luminance(sampled.weight.to_array()).min(1.0);
        if sampled.wi.z > 0.0 {
            outgoing(hit.triangle, usize::from(!front), share);
        }
        direction = frame.to_world(sampled.wi);
    }
}
