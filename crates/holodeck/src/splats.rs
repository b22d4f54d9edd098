//! Makes splats of a holodeck: every sample is placed on its surface, and the surfaces' light
//! becomes a hierarchy that is drawn without the holodeck.

use std::{
    ops::ControlFlow,
    path::{Path, PathBuf},
    sync::Arc,
    time::Instant,
};

use anyhow::{Context, Result, ensure};
use glam::{DVec3, Vec3};
use holo_beamfile::{BeamSamples, Caching};
use holo_optics::pane;
use holo_raycast::{Ray, Raycaster, StoredScenes};
use holo_scene::{Bsdf, Scene};
use holo_section::{BeamKey, Sample, Section, SectionRay};
use holo_server::Holodeck;
use holo_splats::{
    LEAST_REFLECTANCE, LightPoint, Origin, SplatFile, SplatTree, Surfel, SurfelCells, write,
};
use holo_view::{DriverArg, DriverArgs};
use rayon::prelude::*;
use serde::Serialize;

use crate::prepare::SMALL_CACHE;

/// Least distance between surfels, metres: distances of samples are hardly more accurate.
const FINEST: f64 = 0.005;

/// Samples for each surfel, on average, unless the spacing is stated.
const SAMPLES_PER_SURFEL: u64 = 4;

/// Least and most surfels, unless the spacing is stated. With the most, making them takes about
/// 2 GB of memory.
const SURFELS: (u64, u64) = (10_000, 8_000_000);

/// Samples that are placed together.
const BATCH: usize = 1 << 19;

/// Number of steps of a stored distance by which a sample may lie off its surface.
const STEPS_OFF: f64 = 2.0;

/// Directions in which the rim of a disc is compared with the surface.
const RIM: usize = 8;

/// Ratio of two radii that are tried.
const SHRINK: f32 = 0.75;

/// Least radius of a disc, over the spacing.
const LEAST_RADIUS: f32 = 0.15;

/// Height over a disc from which its rim is compared with the surface, over the radius. A curved
/// surface is at most as far from its disc.
const LIFT: f32 = 0.4;

/// Height by which the mean of places may lie below its surface, over the spacing.
const HEIGHT: f32 = 0.1;

/// Least cosine between normals of one surface.
const SAME_SURFACE: f32 = 0.6;

/// Most panes of glass, one behind the other, that a sample's light comes through.
const MOST_PANES: usize = 8;

/// What to make.
#[derive(Clone, Debug)]
pub struct SplatRequest {
    /// The holodeck.
    pub file: PathBuf,
    /// The file to write.
    pub output: PathBuf,
    /// Distance between surfels, metres. `None`: as fine as the samples allow.
    pub spacing: Option<f64>,
    /// Most surfels; more make the spacing larger. `None`: by the number of samples.
    pub most: Option<u64>,
    /// True if samples alone decide where surfaces are, as in files without a scene.
    pub ignores_scene: bool,
}

/// What was made.
#[derive(Clone, Debug, Serialize)]
pub struct SplatReport {
    /// The file.
    pub splats: PathBuf,
    /// Its length.
    pub bytes: u64,
    /// Number of surfels.
    pub surfels: u64,
    /// Number of nodes, surfels among them.
    pub nodes: u64,
    /// Number of levels.
    pub levels: usize,
    /// Distance between surfels, scene units.
    pub spacing: f64,
    /// Samples whose light is in the surfels.
    pub samples: u64,
    /// Samples that hit nothing.
    pub misses: u64,
    /// Samples that lie on no surface of the scene, such as virtual distances.
    pub unplaced: u64,
    /// Seconds for reading and placing samples.
    pub reading_seconds: f64,
    /// Seconds for smoothing light and building the hierarchy.
    pub building_seconds: f64,
}

/// Returns where the splats of a holodeck are, unless another place is stated.
pub fn beside(file: &Path) -> PathBuf {
    file.with_extension("splats")
}

/// Makes splats of a holodeck. Calls `progress` with the share that is done.
///
/// # Errors
/// If the holodeck cannot be read, has no sample on a surface, or the file cannot be written.
pub fn make(request: &SplatRequest, progress: &mut dyn FnMut(f64)) -> Result<SplatReport> {
    let holodeck = Holodeck::open_read_only(&request.file, SMALL_CACHE)?;
    let raycaster = match request.ignores_scene {
        true => None,
        false => raycaster(&holodeck)?,
    };
    Ok(make_of(request, &holodeck, raycaster.as_ref(), false, progress)?.0)
}

/// Makes splats as [`make`] does, and returns the tree too. If surfaces are drawn from the scene,
/// light is divided by their colours.
pub(crate) fn make_of(
    request: &SplatRequest,
    holodeck: &Holodeck,
    raycaster: Option<&Raycaster>,
    draws_surfaces: bool,
    progress: &mut dyn FnMut(f64),
) -> Result<(SplatReport, SplatTree)> {
    let start = Instant::now();
    let places = SamplePlaces::new(holodeck, raycaster, draws_surfaces);
    let unit = holodeck.about.unit;
    let samples = holodeck.file.stats().samples;
    let finest = FINEST / unit;
    let spacing = request.spacing.map_or(finest, |spacing| spacing / unit);
    let (least, most) = SURFELS;
    let most = match (request.most, request.spacing) {
        (Some(most), _) => most,
        (None, Some(_)) => u64::from(u32::MAX) / 2,
        (None, None) => (samples / SAMPLES_PER_SURFEL).clamp(least, most),
    };
    let mut cells = SurfelCells::new(spacing as f32, usize::try_from(most)?);
    let counts = places.collect(holodeck, samples, &mut cells, progress)?;
    ensure!(!cells.is_empty(), "{} has no sample on a surface", request.file.display());
    let spacing = cells.spacing();
    let reading_seconds = start.elapsed().as_secs_f64();
    let origin = Origin {
        origin: places.origin,
        spacing: f64::from(cells.spacing()),
        unit,
        up: holodeck.about.up,
        sky: holodeck.about.sky,
        samples: cells.samples(),
        generation: holodeck.about.generation,
        scene: holodeck.about.scene.hash,
    };
    let mut surfels = cells.into_surfels();
    // Light on surfaces that are drawn ends with them.
    if !draws_surfaces {
        surfels.par_iter_mut().for_each(|surfel| surfel.radius = places.fitting(surfel, spacing));
    }
    let tree = SplatTree::new(surfels, origin.spacing as f32)?;
    write(&request.output, &tree, &origin)?;
    let report = SplatReport {
        splats: request.output.clone(),
        bytes: std::fs::metadata(&request.output)?.len(),
        surfels: tree.surfels as u64,
        nodes: tree.nodes.len() as u64,
        levels: tree.levels.len(),
        spacing: origin.spacing,
        samples: origin.samples,
        misses: counts.misses,
        unplaced: counts.unplaced,
        reading_seconds,
        building_seconds: start.elapsed().as_secs_f64() - reading_seconds,
    };
    Ok((report, tree))
}

/// Opens splats, and checks that they are of this holodeck if there is one.
///
/// # Errors
/// If they cannot be read, or are of another scene.
pub fn open(splats: &Path, holodeck: Option<&Holodeck>) -> Result<SplatFile> {
    let file = SplatFile::open(splats).with_context(|| splats.display().to_string())?;
    if let Some(holodeck) = holodeck {
        let (header, about) = (file.header(), &holodeck.about);
        ensure!(
            (header.scene, header.generation) == (about.scene.hash, about.generation),
            "{} shows another scene than {}: make it again with `holodeck splats`",
            splats.display(),
            holodeck.path().display()
        );
    }
    Ok(file)
}

/// Returns a driver's options with the splats of a holodeck, unless others are named.
///
/// # Errors
/// If the driver draws splats, and they cannot be read or are of another scene.
pub fn with_splats(driver: &DriverArgs, file: &Path) -> Result<DriverArgs> {
    let mut driver = driver.clone();
    let path = driver.splats.clone().unwrap_or_else(|| beside(file));
    if driver.driver != DriverArg::Splats {
        // Someone who walks may choose them later.
        driver.splats = driver.splats.or_else(|| path.exists().then_some(path));
        return Ok(driver);
    }
    ensure!(
        path.exists(),
        "there is no {}: make it with `holodeck splats {}`",
        path.display(),
        file.display()
    );
    open(&path, Some(&Holodeck::open_read_only(file, SMALL_CACHE)?))?;
    driver.splats = Some(path);
    Ok(driver)
}

/// Prepares the scene of a file for casting rays; `None` if the file has none.
pub(crate) fn raycaster(holodeck: &Holodeck) -> Result<Option<Raycaster>> {
    if holodeck.about.scene.bytes == 0 {
        return Ok(None);
    }
    let (stored, hash) = (StoredScenes::new(None), holodeck.about.scene.hash);
    // A file that cannot be used is made again.
    if let Ok(Some(raycaster)) = stored.open(&hash) {
        return Ok(Some(raycaster));
    }
    let scene = Scene::unpack(&holodeck.packed_scene()?)?;
    Ok(Some(stored.prepare(Arc::new(scene), Some(hash))?.0))
}

/// Returns whether the light of a triangle depends on the direction.
fn is_directional(scene: &Scene, triangle: u32) -> bool {
    match scene.material(triangle).bsdf {
        Bsdf::Diffuse { .. } | Bsdf::Coated { .. } => false,
        Bsdf::Mirror { .. }
        | Bsdf::Conductor { .. }
        | Bsdf::ThinGlass { .. }
        | Bsdf::Dielectric { .. } => true,
    }
}

/// Returns the share of light that passes a pane of glass at this angle, as a cosine; `None` for
/// other surfaces.
pub(crate) fn pane_transmittance(surface: &Bsdf, cosine: f32) -> Option<Vec3> {
    let Bsdf::ThinGlass { ior, transmittance } = surface else { return None };
    Some(Vec3::from(*transmittance) * (1.0 - pane(cosine, *ior)))
}

/// Returns the colour of a triangle that is drawn from the scene, and is no part of the splats'
/// light; 1 if it is part of the light.
///
/// Only surfaces of one colour that scatter light are drawn in it. Textures, lamps, metals and
/// glass stay in the light.
pub(crate) fn drawn_colour(scene: &Scene, triangle: u32) -> [f32; 3] {
    let is_in_light = is_directional(scene, triangle)
        || scene.has_texture(triangle)
        || scene.material(triangle).emits();
    if is_in_light {
        return [1.0; 3];
    }
    // As dark as light is divided by.
    scene.reflectance(triangle, 0.3, 0.3, 0.0).map(|share| share.max(LEAST_REFLECTANCE))
}

/// Samples that became no light of a surfel.
#[derive(Clone, Copy, Debug, Default)]
struct LeftOut {
    misses: u64,
    unplaced: u64,
}

/// Where a sample's light comes from.
enum LightOrigin {
    /// A surface.
    At(LightPoint),
    /// The sky.
    Sky,
    /// No surface is where its ray ended.
    Nowhere,
}

/// Finds the places where samples ended. What is seen through panes that are drawn is the light of
/// what lies behind them.
struct SamplePlaces<'a> {
    sections: Arc<[Section]>,
    raycaster: Option<&'a Raycaster>,
    draws_surfaces: bool,
    origin: DVec3,
}

impl<'a> SamplePlaces<'a> {
    fn new(
        holodeck: &Holodeck,
        raycaster: Option<&'a Raycaster>,
        draws_surfaces: bool,
    ) -> SamplePlaces<'a> {
        let middle = |section: &Section| section.local_to_world(DVec3::splat(0.5));
        let sections = Arc::clone(&holodeck.sections);
        let middles: DVec3 = sections.iter().map(middle).sum();
        let origin = match raycaster {
            Some(raycaster) => raycaster.scene().origin,
            None => middles / sections.len().max(1) as f64,
        };
        SamplePlaces { sections, raycaster, draws_surfaces, origin }
    }

    /// Adds all samples of the present scene to cells.
    fn collect(
        &self,
        holodeck: &Holodeck,
        samples: u64,
        cells: &mut SurfelCells,
        progress: &mut dyn FnMut(f64),
    ) -> Result<LeftOut> {
        let mut beams = Vec::new();
        holodeck.file.for_each_beam(&mut |key, _| beams.push(key));
        let mut left_out = LeftOut::default();
        let mut batch: Vec<(BeamKey, Arc<BeamSamples>)> = Vec::new();
        let (mut waiting, mut done) = (0, 0);
        let mut empty = |batch: &mut Vec<(BeamKey, Arc<BeamSamples>)>| {
            let (points, counts) = self.place(batch, cells.spacing());
            cells.add(&points);
            left_out.misses += counts.misses;
            left_out.unplaced += counts.unplaced;
            batch.clear();
        };
        holodeck.file.read_many(&beams, Caching::Bypass, &mut |key, samples_of_beam| {
            waiting += samples_of_beam.samples.len();
            batch.push((key, samples_of_beam));
            if waiting >= BATCH {
                empty(&mut batch);
                done += waiting as u64;
                waiting = 0;
                progress(done as f64 / samples.max(1) as f64);
            }
            ControlFlow::Continue(())
        })?;
        empty(&mut batch);
        Ok(left_out)
    }

    /// Returns the places of these samples, in their order.
    fn place(
        &self,
        beams: &[(BeamKey, Arc<BeamSamples>)],
        spacing: f32,
    ) -> (Vec<LightPoint>, LeftOut) {
        let of_beam = |(key, samples): &(BeamKey, Arc<BeamSamples>)| {
            let mut points = Vec::with_capacity(samples.samples.len());
            let mut left_out = LeftOut::default();
            let section = key.section_in(&self.sections);
            let pair = section.and_then(|section| section.cells(key.beam));
            let (Some(section), Some(pair)) = (section, pair) else { return (points, left_out) };
            for (run, samples) in samples.iter() {
                for sample in samples {
                    let ray = section.ray(pair, sample.coords);
                    let distance = sample.distance(section.diagonal());
                    if distance.is_infinite() {
                        left_out.misses += 1;
                        continue;
                    }
                    let reach = (ray, distance, section.diagonal());
                    match self.point(reach, sample, run.paths, spacing) {
                        LightOrigin::At(point) => points.push(point),
                        LightOrigin::Sky => left_out.misses += 1,
                        LightOrigin::Nowhere => left_out.unplaced += 1,
                    }
                }
            }
            (points, left_out)
        };
        let parts: Vec<_> = beams.par_iter().map(of_beam).collect();
        let mut all = (Vec::new(), LeftOut::default());
        for (points, left_out) in parts {
            all.0.extend(points);
            all.1.misses += left_out.misses;
            all.1.unplaced += left_out.unplaced;
        }
        all
    }

    /// Returns the place of one sample.
    fn point(
        &self,
        (ray, distance, diagonal): (SectionRay, f64, f64),
        sample: &Sample,
        paths: u16,
        spacing: f32,
    ) -> LightOrigin {
        let towards = -ray.direction.as_vec3();
        let point = LightPoint {
            position: (ray.origin + ray.direction * distance - self.origin).as_vec3(),
            normal: None,
            towards,
            radiance: sample.rgb(),
            reflectance: [1.0; 3],
            drawn_colour: [1.0; 3],
            paths,
            is_directional: false,
            shines: false,
        };
        let Some(raycaster) = self.raycaster else { return LightOrigin::At(point) };
        let off = STEPS_OFF * diagonal.max(distance) / 2048.0;
        let from = ray.origin + ray.direction * (distance - off);
        let Some((mut local, skipped)) = raycaster.localize(from, ray.direction) else {
            return LightOrigin::Nowhere;
        };
        let hit = raycaster.nearest(&local);
        let hit = hit.filter(|hit| f64::from(hit.t) + skipped <= 2.0 * off);
        let Some(mut hit) = hit else { return LightOrigin::Nowhere };
        let (scene, mut radiance) = (raycaster.scene(), Vec3::from(point.radiance));
        for _ in 0..if self.draws_surfaces { MOST_PANES } else { 0 } {
            let cosine = raycaster.geometric_normal(hit.triangle).dot(towards).abs();
            let surface = &scene.material(hit.triangle).bsdf;
            let Some(share) = pane_transmittance(surface, cosine) else { break };
            radiance /= share.max(Vec3::splat(LEAST_REFLECTANCE));
            let behind = Ray::new(local.origin + local.direction * hit.t, local.direction);
            let Some(next) = raycaster.nearest_from(&behind, hit.triangle) else {
                return LightOrigin::Sky;
            };
            (local, hit) = (behind, next);
        }
        let normal = raycaster.geometric_normal(hit.triangle);
        let place = local.origin + local.direction * hit.t;
        let is_directional = is_directional(scene, hit.triangle);
        LightOrigin::At(LightPoint {
            position: (place.as_dvec3() + scene.origin - self.origin).as_vec3(),
            normal: Some(facing(normal, towards)),
            reflectance: match is_directional {
                true => [1.0; 3],
                false => scene.reflectance(hit.triangle, hit.u, hit.v, spacing),
            },
            radiance: radiance.to_array(),
            drawn_colour: match self.draws_surfaces {
                true => drawn_colour(scene, hit.triangle),
                false => [1.0; 3],
            },
            is_directional,
            shines: scene.material(hit.triangle).emits(),
            ..point
        })
    }
}

impl SamplePlaces<'_> {
    /// Returns the greatest radius, up to the surfel's, with which its disc does not stick out over
    /// the edge of its surface. What another surface hides may stick out.
    fn fitting(&self, surfel: &Surfel, spacing: f32) -> f32 {
        let Some(raycaster) = self.raycaster else { return surfel.radius };
        let origin = self.origin - raycaster.scene().origin;
        let place = (surfel.position.as_dvec3() + origin).as_vec3();
        let place = on_surface(raycaster, place, surfel.normal, HEIGHT * spacing);
        let (u, v) = surfel.normal.any_orthonormal_pair();
        let mut radius = surfel.radius;
        for direction in 0..RIM {
            let (sine, cosine) = (direction as f32 * std::f32::consts::TAU / RIM as f32).sin_cos();
            let along = u * cosine + v * sine;
            while radius > LEAST_RADIUS * spacing
                && !fits(raycaster, place, surfel.normal, along, radius)
            {
                radius *= SHRINK;
            }
        }
        radius
    }
}

/// Returns the place on the surface that a place is just below, such as the mean of places on a
/// curved one. The other side of a narrow gap faces the other way, and is none.
fn on_surface(raycaster: &Raycaster, place: Vec3, normal: Vec3, height: f32) -> Vec3 {
    let down = Ray { t_max: 2.0 * height, ..Ray::new(place + normal * height, -normal) };
    let hit = raycaster
        .nearest(&down)
        .filter(|hit| raycaster.geometric_normal(hit.triangle).dot(normal) > SAME_SURFACE);
    hit.map_or(place, |hit| down.origin + down.direction * hit.t)
}

/// Returns whether a disc's rim is on a surface in this direction, or hidden.
fn fits(raycaster: &Raycaster, place: Vec3, normal: Vec3, along: Vec3, radius: f32) -> bool {
    // In a narrow gap, half the way to the other side.
    let above = Ray::new(place + normal * (1e-3 * radius), normal);
    let room = raycaster.nearest(&above).map_or(f32::INFINITY, |hit| 0.5 * hit.t);
    let lift = (LIFT * radius).min(room);
    let over = place + normal * lift;
    let sideways = Ray { t_max: radius, ..Ray::new(over, along) };
    if raycaster.occluded(&sideways) {
        return true;
    }
    let down = Ray { t_max: 2.0 * lift, ..Ray::new(over + along * radius, -normal) };
    let hit = raycaster.nearest(&down);
    hit.is_some_and(|hit| raycaster.geometric_normal(hit.triangle).dot(normal).abs() > SAME_SURFACE)
}

/// Returns the normal of the side from which a ray came.
fn facing(normal: Vec3, towards: Vec3) -> Vec3 {
    if normal.dot(towards) < 0.0 { -normal } else { normal }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pane_takes_more_of_the_light_that_crosses_it_obliquely() {
        let glass = Bsdf::ThinGlass { ior: 1.52, transmittance: [1.0, 0.5, 0.0] };
        // All orders of reflection between the faces, each polarization by itself.
        for (degrees, share) in [(0.0_f32, 0.9183), (80.0, 0.456)] {
            let found = pane_transmittance(&glass, degrees.to_radians().cos()).unwrap();
            let wanted = Vec3::new(share, 0.5 * share, 0.0);
            assert!(found.abs_diff_eq(wanted, 1e-3), "{degrees}: {found}");
        }
        assert_eq!(pane_transmittance(&Bsdf::Mirror { ks: [1.0; 3] }, 1.0), None);
    }
}
