//! Copying a file's rays into other sections.
//!
//! A stored ray is a line and what it met first from some point on. The line is known between this
//! point and what it hit. Another section that it crosses stores the ray too if that section's rays
//! begin on the known part. A ray is then snapped to the lattice of the section. It must
//! still hit the same place, except for the steps of the lattice.

use std::{collections::HashMap, ops::ControlFlow, path::Path};

use anyhow::{Result, bail};
use glam::DVec3;
use holo_beamfile::{Caching, Maker};
use holo_section::{BeamKey, NumberRun, RayCoords, Sample, SampleKind, Section, SectionSpec};
use serde::Serialize;

use crate::holodeck::Holodeck;
use crate::merge::by_maker;

/// Samples that are sorted by their new beams at a time: 60 MB.
pub(crate) const SORTED: usize = 2_000_000;

/// Largest distance of a snapped ray from the place that the ray hit, in steps of the section.
const MOST_STEPS: f64 = 3.0;

/// How many samples of a file were copied into other sections.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Reframed {
    /// Samples of the old file.
    pub samples: u64,
    /// Those of them that at least one new section stores.
    pub kept: u64,
    /// Samples in the new file. A ray that crosses several sections is stored in each.
    pub stored: u64,
    /// `kept` as a share of `samples`.
    pub share: f64,
}

/// A ray of the old file.
struct KnownRay {
    origin: DVec3,
    direction: DVec3,
    /// Where the known part begins, scene units from `origin`.
    start: f64,
    /// What it hit, scene units from `origin`; infinite for nothing.
    hit: f64,
    /// Longest step of its section, scene units.
    step: f64,
}

/// A sample on its way to a new beam.
pub(crate) struct MovedSample {
    pub key: BeamKey,
    pub maker: Maker,
    pub paths: u16,
    pub sample: Sample,
}

impl Holodeck {
    /// Makes a new file of the same scene and settings with other sections, and copies the present
    /// samples into it where the new sections can store their rays.
    ///
    /// Surface light is copied. Unseen beams belong to the old sections, and are found anew; so
    /// are simpler scenes for displays.
    ///
    /// # Errors
    /// If the new file exists or cannot be written, a section is not valid, or this file cannot be
    /// read. If the copy fails, no new file is left.
    pub fn reframe(&self, path: &Path, sections: Vec<SectionSpec>) -> Result<Reframed> {
        let mut about = self.about.clone();
        (about.sections, about.stand_ins) = (sections, None);
        let new = Self::create(path, about, &self.packed_scene()?, 0)?;
        let reframed = self.copy_models(&new).and_then(|()| self.copy_rays(&new));
        if reframed.is_err() {
            drop(new);
            // Nothing of value is in it.
            let _ = std::fs::remove_file(path);
        }
        reframed
    }

    fn copy_rays(&self, new: &Holodeck) -> Result<Reframed> {
        let makers: HashMap<Maker, Maker> =
            new.makers_mut().merge(&self.makers()).into_iter().collect();
        new.file.begin_generation(self.about.generation)?;
        let mut reframed = Reframed::default();
        let mut moved = Vec::new();
        let mut keys = Vec::new();
        self.file.for_each_beam(&mut |key, _| keys.push(key));
        let mut written = Ok(());
        self.file.read_many(&keys, Caching::Bypass, &mut |key, beam| {
            let made = self.file.makers(key);
            let parts = beam.iter().flat_map(|(run, samples)| by_maker(run, samples, &made));
            for (run, samples, maker) in parts {
                let maker = makers.get(&maker).copied().unwrap_or_default();
                for sample in samples {
                    reframed.samples += 1;
                    let places = self.known_ray(key, sample).map(|ray| new.places(&ray, sample));
                    let places = places.unwrap_or_default();
                    reframed.kept += u64::from(!places.is_empty());
                    moved.extend(places.into_iter().map(|(key, sample)| MovedSample {
                        key,
                        maker,
                        paths: run.paths,
                        sample,
                    }));
                }
            }
            if moved.len() >= SORTED {
                written = new.store(&mut moved);
            }
            if written.is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        })?;
        written?;
        new.store(&mut moved)?;
        if reframed.samples > 0 && reframed.kept == 0 {
            bail!(
                "none of the {} samples of {} fits into these sections",
                reframed.samples,
                self.path().display()
            );
        }
        let maker = |maker| makers.get(&maker).copied().unwrap_or_default();
        new.cells_mut().merge(&self.cells(), maker);
        new.save_makers()?;
        new.save_cells(true)?;
        new.file.flush()?;
        reframed.stored = new.file.stats().samples;
        reframed.share = reframed.kept as f64 / (reframed.samples as f64).max(1.0);
        Ok(reframed)
    }

    fn known_ray(&self, key: BeamKey, sample: &Sample) -> Option<KnownRay> {
        let section = self.sections.get(usize::from(key.section))?;
        let ray = section.ray(section.cells(key.beam)?, sample.coords);
        let (origin, direction) = (ray.origin, ray.direction);
        let (start, hit) = (section.trace_start(&ray), sample.distance(section.diagonal()));
        Some(KnownRay { origin, direction, start, hit, step: step(section) })
    }

    /// Returns the beams of this file that can store a ray, each with its sample.
    fn places(&self, ray: &KnownRay, sample: &Sample) -> Vec<(BeamKey, Sample)> {
        let placed = |(number, section): (usize, &Section)| {
            let (beam, coords, distance) = place(section, ray)?;
            let code = holo_section::distance::encode(distance, section.diagonal());
            let key = BeamKey { section: u16::try_from(number).ok()?, beam };
            Some((key, Sample::from_codes(coords, sample.rgbe, code)))
        };
        self.sections.iter().enumerate().filter_map(placed).collect()
    }

    /// Appends samples as single rays of their beams, and empties the list.
    pub(crate) fn store(&self, moved: &mut Vec<MovedSample>) -> Result<(), holo_beamfile::Error> {
        moved.sort_by_key(|moved| (moved.key, moved.maker, moved.paths));
        let is_run = |a: &MovedSample, b: &MovedSample| {
            (a.key, a.maker, a.paths) == (b.key, b.maker, b.paths)
        };
        for run in moved.chunk_by(is_run) {
            let MovedSample { key, maker, paths, .. } = run[0];
            let samples: Vec<Sample> = run.iter().map(|moved| moved.sample).collect();
            let first = self.file.counts(key).single;
            let kind = SampleKind::SingleRay;
            let run = NumberRun { key, kind, first, count: samples.len() as u32, paths };
            self.file.append(run, maker, &samples)?;
        }
        moved.clear();
        Ok(())
    }
}

/// Returns the beam and the coordinates with which a section can store a ray, and the distance of
/// the hit from its entry point. `None` if it cannot.
fn place(section: &Section, ray: &KnownRay) -> Option<(holo_section::BeamId, RayCoords, f64)> {
    let from = if ray.hit.is_finite() { ray.hit } else { ray.start };
    let point = ray.origin + ray.direction * from;
    let line = section.line(point, ray.direction)?;
    let new = section.ray(line.pair, line.coords);
    let step = step(section);
    // The new ray's beginning, on the old ray.
    let start = new.origin + new.direction * section.trace_start(&new);
    let start = (start - ray.origin).dot(ray.direction);
    if start < ray.start - step.max(ray.step) || start > ray.hit {
        return None;
    }
    let along = (point - new.origin).dot(new.direction);
    let aside = (new.origin + new.direction * along).distance(point);
    if aside > MOST_STEPS * step {
        return None;
    }
    let distance = if ray.hit.is_finite() { along } else { f64::INFINITY };
    Some((section.beam(line.pair), line.coords, distance))
}

/// Returns the longest step of a section's ray coordinates, scene units.
fn step(section: &Section) -> f64 {
    let spec = section.spec();
    let cell =
        |axis: usize| DVec3::from_array(spec.axes[axis]).length() / f64::from(spec.grid[axis]);
    (0..3).map(cell).fold(0.0, f64::max) / 256.0
}

#[cfg(test)]
mod tests {
    use holo_section::ViewClass;

    use super::*;

    fn section(origin: [f64; 3], side: f64, cells: u32, obstructions: bool) -> Section {
        let axes = [[side, 0.0, 0.0], [0.0, side, 0.0], [0.0, 0.0, side]];
        let (grid, class) = ([cells; 3], ViewClass::Interior);
        Section::new(SectionSpec { origin, axes, grid, class, obstructions }).unwrap()
    }

    /// Rays of a section of side 4 around (2, 2, 2) that hit a sphere of radius 3.5 around it.
    fn rays(old: &Section) -> Vec<KnownRay> {
        let mut rays = Vec::new();
        for number in 0..4000_u64 {
            let unit =
                |salt| (holo_proto_mix(number * 4 + salt) >> 11) as f64 / (1u64 << 53) as f64;
            let from = DVec3::new(unit(0), unit(1), unit(2)) * 4.0;
            let turn = std::f64::consts::TAU * unit(3);
            let along = DVec3::new(turn.cos(), turn.sin(), 0.7 * unit(1) - 0.3).normalize();
            let Some(hit) = old.line(from, along) else { continue };
            let ray = old.ray(hit.pair, hit.coords);
            let from_middle = ray.origin - DVec3::splat(2.0);
            let b = from_middle.dot(ray.direction);
            let reach = (b * b - from_middle.length_squared() + 3.5 * 3.5).sqrt() - b;
            rays.push(KnownRay {
                origin: ray.origin,
                direction: ray.direction,
                start: old.trace_start(&ray),
                hit: reach,
                step: step(old),
            });
        }
        rays
    }

    /// SplitMix64.
    fn holo_proto_mix(number: u64) -> u64 {
        let mut z = number.wrapping_add(1).wrapping_mul(0x9E37_79B9_7F4A_7C15);
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    #[test]
    fn another_grid_of_the_same_box_keeps_nearly_all_rays_and_they_hit_the_same_places() {
        for obstructions in [false, true] {
            let (old, new) =
                (section([0.0; 3], 4.0, 8, obstructions), section([0.0; 3], 4.0, 13, obstructions));
            let rays = rays(&old);
            let mut kept = 0;
            for ray in &rays {
                let Some((beam, coords, distance)) = place(&new, ray) else { continue };
                let moved = new.ray(new.cells(beam).unwrap(), coords);
                let was = ray.origin + ray.direction * ray.hit;
                let is = moved.origin + moved.direction * distance;
                assert!(was.distance(is) <= MOST_STEPS * step(&new), "{was} {is}");
                kept += 1;
            }
            let share = f64::from(kept) / rays.len() as f64;
            assert!(share > 0.9, "obstructions {obstructions}: {share}");
        }
    }

    #[test]
    fn a_ray_is_stored_only_where_the_new_ray_begins_on_its_known_part() {
        let old = section([0.0; 3], 4.0, 8, true);
        let inside = section([1.0; 3], 2.0, 8, true);
        let around = section([-1.0; 3], 6.0, 8, true);
        let beyond = section([4.1, 0.0, 0.0], 4.0, 8, true);
        let ray = |hit| {
            let line = old.line(DVec3::new(2.0, 2.1, 1.9), DVec3::new(1.0, 0.01, 0.02)).unwrap();
            let ray = old.ray(line.pair, line.coords);
            let (origin, direction) = (ray.origin, ray.direction);
            KnownRay { origin, direction, start: 0.0, hit, step: step(&old) }
        };
        assert!(place(&inside, &ray(9.0)).is_some(), "it begins inside the old section");
        assert!(place(&around, &ray(9.0)).is_none(), "something may stand before the old section");
        assert!(place(&beyond, &ray(9.0)).is_some(), "nothing stands between");
        assert!(place(&beyond, &ray(3.0)).is_none(), "it hit something before");
        assert!(place(&inside, &ray(f64::INFINITY)).is_some_and(|(.., hit)| hit == f64::INFINITY));
    }
}
