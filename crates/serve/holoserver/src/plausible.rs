//! Checks whether a worker's results can be true. Impossible results are refused, and the worker is
//! dropped.
//!
//! A refusal must never depend on an honest tracer's luck, because leaving out bright samples would
//! darken pictures. Invariants:
//! - A ray that hits nothing brings the sky's light, and a ray that cannot be traced brings none.
//!   Tracers give both exactly.
//! - A ray hits nothing beyond the scene's bounds.
//! - No bound on the light of one ray is certain. Roulette raises the weights of paths that survive
//!   it, and aimed samples those of paths that were not aimed, by factors that multiply. But the
//!   expectation is limited by the brightest light, because no surface returns more than it
//!   receives. Few samples exceed a multiple of it (Markov's inequality): see [`IMPROBABLE`].
//!
//! So these checks find garbage. Wrong light of a possible brightness is found by tracing packets
//! twice (`audits`).

use std::sync::Arc;

use glam::DVec3;
use holo_proto::bulk::{LiveHit, LiveRay, WireCell};
use holo_scene::Sky;
use holo_section::{BeamKey, Sample, Section, distance, rgbe};
use thiserror::Error;

use crate::{about::HolodeckDescription, radiance_limits::RadianceLimits};

/// A sample does not reach this multiple of the brightest light, even by luck.
///
/// A path meets at most 1000 surfaces, and light inside glass is brighter by at most 10⁴. So the
/// expectation is below 10⁷ times the brightest light. A sample exceeds 10¹⁸ times its expectation
/// with a probability of at most 10⁻¹⁸. Ten terabytes are 10¹² honest samples: with a probability
/// of at most 10⁻⁶, one of these is refused.
const IMPROBABLE: f64 = 1e25;

/// The same for cells of surface light: less, so that no honest sample that uses one is improbable.
const IMPROBABLE_CELL: f64 = 1e19;

/// Rounding of distances that are compared with bounds, relative. Tracers work in f32, and codes of
/// distances have steps of 2⁻¹¹.
const ROUNDING: f64 = 1e-3;

/// At such coordinates the distance of a hit may be infinite in f32. A display may look from there.
const FAR: f64 = 1e30;

/// Relative difference of a sky's radiance on two machines, whose mathematics may round otherwise.
const SKY_ROUNDING: f32 = 1e-4;

/// The same for directions.
const DIRECTION_ROUNDING: f64 = 1e-7;

/// Why results cannot be true.
#[derive(Debug, Error, PartialEq, Eq)]
pub enum Implausible {
    #[error("it hit something beyond the bounds of the scene")]
    TooFar,
    #[error("it sent light that is brighter than any lamp could cause")]
    TooBright,
    #[error("its ray hit nothing, and brought other light than the sky's")]
    NotTheSky,
}

/// Limits on the results for one holodeck.
pub struct Plausible {
    /// For each section, the code of the greatest distance.
    farthest: Vec<u16>,
    /// Light of rays that hit nothing. `None` if mirrors may have shown it, or if it is unknown.
    sky: Option<Sky>,
    sections: Arc<[Section]>,
    /// `None` for files of earlier versions, which do not store them.
    limits: Option<RadianceLimits>,
    /// The greatest exponent of a stored colour.
    exponent: u8,
    are_distances_straight: bool,
}

impl Plausible {
    /// Returns the limits for a holodeck with these sections.
    pub fn new(about: &HolodeckDescription, sections: &Arc<[Section]>) -> Plausible {
        let are_distances_straight = !about.settings.virtual_distance;
        let limits = about.limits;
        let farthest = |section: &Section| {
            limits.filter(|_| are_distances_straight).map_or(distance::NOTHING_HIT, |limits| {
                let far = corners(section).map(|corner| limits.farthest(corner));
                let far = far.into_iter().fold(0.0, f64::max) * (1.0 + ROUNDING);
                distance::encode(far, section.diagonal())
            })
        };
        let most = limits.map_or(f32::MAX, |limits| most(&limits, IMPROBABLE));
        Plausible {
            farthest: sections.iter().map(farthest).collect(),
            sky: (are_distances_straight && !about.sky_varies).then(|| about.sky.into()),
            sections: Arc::clone(sections),
            limits,
            exponent: rgbe::encode([most; 3], 0)[3],
            are_distances_straight,
        }
    }

    /// Checks misses by this sky from now on, if misses can be checked at all.
    pub fn set_sky(&mut self, sky: Sky) {
        self.sky = self.are_distances_straight.then_some(sky);
    }

    /// Checks the samples of a beam.
    pub fn samples(&self, key: BeamKey, samples: &[Sample]) -> Result<(), Implausible> {
        let section = key.section;
        let farthest = self.farthest.get(usize::from(section)).copied();
        let farthest = farthest.unwrap_or(distance::NOTHING_HIT);
        for sample in samples {
            if sample.distance_code() == distance::NOTHING_HIT {
                let step = 2_f32.powi(i32::from(sample.rgbe[3]) - 136);
                let direction = || {
                    let section = self.sections.get(usize::from(section))?;
                    let cells = section.cells(key.beam)?;
                    Some(section.ray(cells, sample.coords).direction)
                };
                self.miss(sample.rgb(), step, || direction().unwrap_or_default())?;
            } else if sample.distance_code() > farthest {
                return Err(Implausible::TooFar);
            }
            if sample.rgbe[3] > self.exponent {
                return Err(Implausible::TooBright);
            }
        }
        Ok(())
    }

    /// Checks the results of live rays, in the same order.
    pub fn live(&self, rays: &[LiveRay], hits: &[LiveHit]) -> Result<(), Implausible> {
        let most = self.limits.map_or(f32::MAX, |limits| most(&limits, IMPROBABLE));
        for (ray, hit) in rays.iter().zip(hits) {
            if hit.distance.is_infinite() {
                if ray.origin.iter().all(|x| x.abs() < FAR) {
                    self.miss(hit.radiance, 0.0, || DVec3::from_array(ray.direction))?;
                }
            } else if let Some(limits) = self.limits.filter(|_| self.are_distances_straight)
                && f64::from(hit.distance) > limits.farthest(ray.origin) * (1.0 + ROUNDING)
            {
                return Err(Implausible::TooFar);
            }
            if hit.radiance.iter().any(|&radiance| radiance > most) {
                return Err(Implausible::TooBright);
            }
        }
        Ok(())
    }

    /// Checks cells of surface light.
    pub fn cells(&self, cells: &[WireCell]) -> Result<(), Implausible> {
        let most = self.limits.map_or(f32::MAX, |limits| most(&limits, IMPROBABLE_CELL));
        // The mean light of a cell is the first sum over the second. Surfaces reflect at most what
        // arrives, so the first alone has the same bound for each estimate.
        let is_bright =
            |cell: &WireCell| cell.light.iter().any(|&light| light > most * cell.count as f32);
        if cells.iter().any(is_bright) { Err(Implausible::TooBright) } else { Ok(()) }
    }

    /// Checks the light of a ray that hit nothing, which may differ from the sky's by a `step`.
    fn miss(
        &self,
        light: [f32; 3],
        step: f32,
        direction: impl FnOnce() -> DVec3,
    ) -> Result<(), Implausible> {
        let Some(sky) = self.sky.as_ref().filter(|_| light != [0.0; 3]) else { return Ok(()) };
        let is_within = |sky: [f32; 3], rounding: f32| {
            light.iter().zip(sky).all(|(light, sky)| (light - sky).abs() <= step + rounding * sky)
        };
        let is_sky = match sky.as_even() {
            Some(radiance) => is_within(radiance, 0.0),
            None => around(direction()).any(|near| is_within(sky.radiance(near), SKY_ROUNDING)),
        };
        if is_sky { Ok(()) } else { Err(Implausible::NotTheSky) }
    }
}

/// Returns a unit direction and others within its rounding, which may lie beyond the horizon.
fn around(direction: DVec3) -> impl Iterator<Item = DVec3> {
    let shifts = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| axis * DIRECTION_ROUNDING);
    let shifts = shifts.into_iter().flat_map(|shift| [shift, -shift]);
    std::iter::once(DVec3::ZERO)
        .chain(shifts)
        .map(move |shift| (direction + shift).normalize_or_zero())
}

/// Returns so many times the brightest light, as far as there are such numbers.
fn most(limits: &RadianceLimits, times: f64) -> f32 {
    // Conversions saturate at infinity, which no radiance exceeds.
    (f64::from(limits.brightest) * times) as f32
}

/// Returns the corners of a section.
fn corners(section: &Section) -> [[f64; 3]; 8] {
    let spec = section.spec();
    std::array::from_fn(|corner| {
        std::array::from_fn(|at| {
            let sides = (0..3).filter(|side| corner >> side & 1 == 1);
            spec.origin[at] + sides.map(|side| spec.axes[side][at]).sum::<f64>()
        })
    })
}

#[cfg(test)]
mod tests {
    use holo_proto::control::RenderSettings;
    use holo_scene::SkyAxes;
    use holo_section::{BeamId, RayCoords, SectionSpec, ViewClass};

    use super::*;

    const SKY: [f32; 3] = [0.3, 17.0, 900.1];
    const KEY: BeamKey = BeamKey { section: 0, beam: BeamId(0) };
    const LIMITS: RadianceLimits =
        RadianceLimits { low: [-3.0, 0.0, 0.0], high: [2.0, 1.0, 4.0], brightest: 900.1 };

    fn plausible(limits: Option<RadianceLimits>, virtual_distance: bool) -> (Plausible, Section) {
        let spec = SectionSpec {
            origin: [0.0; 3],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            grid: [4, 4, 4],
            class: ViewClass::Interior,
            obstructions: true,
        };
        let settings = RenderSettings { virtual_distance, ..RenderSettings::default() };
        let section = Section::new(spec.clone()).unwrap();
        let mut about = HolodeckDescription::new(vec![spec], settings, b"a scene", "a test".into());
        (about.sky, about.limits) = (SKY, limits);
        (Plausible::new(&about, &Arc::from([section.clone()])), section)
    }

    fn sample(rgb: [f32; 3], distance: f64, section: &Section, dither: u32) -> Sample {
        Sample::encode(RayCoords::default(), rgb, distance, section.diagonal(), dither)
    }

    #[test]
    fn whatever_the_dither_a_miss_brings_the_sky_or_nothing_and_no_other_light() {
        let (plausible, section) = plausible(None, false);
        for dither in (0..1000u32).map(|at| at.wrapping_mul(0x9e37_79b9)) {
            let sky = sample(SKY, f64::INFINITY, &section, dither);
            assert_eq!(plausible.samples(KEY, &[sky]), Ok(()));
        }
        let none = sample([0.0; 3], f64::INFINITY, &section, 0);
        let dim = sample([0.3, 17.0, 880.0], f64::INFINITY, &section, 0);
        assert_eq!(plausible.samples(KEY, &[none]), Ok(()));
        assert_eq!(plausible.samples(KEY, &[none, dim]), Err(Implausible::NotTheSky));
    }

    #[test]
    fn a_miss_brings_the_light_of_its_own_direction_if_the_sky_differs() {
        let (mut plausible, section) = plausible(None, false);
        let formula = holo_daylight::overcast_sky(DVec3::new(0.6, 0.0, 0.8)).sky;
        let overcast = Sky::of_formula(formula, 3.0, SkyAxes::new(DVec3::Z, 0.0));
        plausible.set_sky(overcast.clone());
        let ray = section.ray(section.cells(KEY.beam).unwrap(), RayCoords::default());
        let true_light = overcast.radiance(ray.direction);
        for dither in (0..100u32).map(|at| at.wrapping_mul(0x9e37_79b9)) {
            let sky = sample(true_light, f64::INFINITY, &section, dither);
            assert_eq!(plausible.samples(KEY, &[sky]), Ok(()));
        }
        let wrong = sample(true_light.map(|c| c * 1.05), f64::INFINITY, &section, 0);
        assert_eq!(plausible.samples(KEY, &[wrong]), Err(Implausible::NotTheSky));
        let live = |direction: [f64; 3], radiance: [f32; 3]| {
            let ray = LiveRay { origin: [0.0; 3], direction, number: 0 };
            let hit = LiveHit { radiance, distance: f32::INFINITY };
            plausible.live(&[ray], &[hit])
        };
        let [up, level] = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0]];
        let above = overcast.radiance(DVec3::from_array(up));
        assert_eq!(live(up, above), Ok(()));
        assert_eq!(live(level, above), Err(Implausible::NotTheSky));
        // On the horizon, rounding decides between sky and ground.
        let [sky, ground] = [1e-9, -1e-9].map(|z| overcast.radiance(DVec3::new(1.0, 0.0, z)));
        assert_ne!(sky, ground);
        assert_eq!((live(level, sky), live(level, ground)), (Ok(()), Ok(())));
    }

    #[test]
    fn a_hit_lies_within_the_scene_and_its_light_is_possible() {
        let (plausible, section) = plausible(Some(LIMITS), false);
        // From the corner (1, 0, 0) or (1, 1, 0) to the opposite one of the bounds.
        let farthest = 33_f64.sqrt();
        let of = |distance: f64, light: f32| {
            plausible.samples(KEY, &[sample([light, 0.0, 0.0], distance, &section, 0)])
        };
        assert_eq!(of(farthest, 0.0), Ok(()));
        assert_eq!(of(farthest * 1.01, 0.0), Err(Implausible::TooFar));
        assert_eq!(of(1.0, 1e27), Ok(()), "luck");
        assert_eq!(of(1.0, 1e29), Err(Implausible::TooBright));
        let random = Sample::from_codes(RayCoords::default(), [77, 200, 3, 255], 500);
        assert_eq!(plausible.samples(KEY, &[random]), Err(Implausible::TooBright));
    }

    #[test]
    fn live_rays_and_cells_are_checked_alike() {
        let (plausible, _) = plausible(Some(LIMITS), false);
        let of = |origin: [f64; 3], radiance: [f32; 3], distance: f32| {
            let ray = LiveRay { number: 1, origin, direction: [1.0, 0.0, 0.0] };
            plausible.live(&[ray], &[LiveHit { radiance, distance }])
        };
        let (near, far) = ([1.0, 0.0, 0.0], [-1000.0, 0.0, 0.0]);
        assert_eq!(of([1e200, 0.0, 0.0], [1.0; 3], f32::INFINITY), Ok(()));
        assert_eq!(of(near, SKY, f32::INFINITY), Ok(()));
        assert_eq!(of(near, [1.0; 3], f32::INFINITY), Err(Implausible::NotTheSky));
        assert_eq!(of(near, [1.0; 3], 5.0), Ok(()));
        assert_eq!(of(near, [1.0; 3], 6.0), Err(Implausible::TooFar));
        assert_eq!(of(far, [1.0; 3], 1002.0), Ok(()));
        assert_eq!(of(near, [1e29, 0.0, 0.0], 1.0), Err(Implausible::TooBright));
        let cell = |light: f32| WireCell {
            point: [0.0; 3],
            normal: [0.0, 0.0, 1.0],
            material: 0,
            bounces: 1,
            level: 1,
            maker: 0,
            count: 10,
            light: [0.0, light, 0.0],
            albedo: [5.0; 3],
        };
        assert_eq!(plausible.cells(&[cell(1e21)]), Ok(()));
        assert_eq!(plausible.cells(&[cell(1e24)]), Err(Implausible::TooBright));
    }

    #[test]
    fn behind_mirrors_things_are_farther_away_and_the_sky_is_dimmer() {
        let (plausible, section) = plausible(Some(LIMITS), true);
        let reflected = sample([1.0; 3], f64::INFINITY, &section, 0);
        let far = sample([1.0; 3], 50.0, &section, 0);
        assert_eq!(plausible.samples(KEY, &[reflected, far]), Ok(()));
    }
}
