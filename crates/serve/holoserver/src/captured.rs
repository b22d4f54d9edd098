//! Files of rays that were captured, not traced: pixels of pictures with distances.
//!
//! Such a file has no scene, and the engine `captured`. Nothing can be traced for it. Each picture
//! has a maker's number of its own, so `forget` removes one picture.
//!
//! Invariant: a section stores a ray only if the ray is known from where it enters the section, or
//! if its eye is inside. In the second case the part before the eye is unknown, and the section's
//! ray goes through it. A display that looks from there along the ray sees what the eye saw.

use std::path::Path;

use anyhow::{Context, Result, ensure};
use glam::DVec3;
use holo_proto::control::Engine;
use holo_section::{BeamKey, Sample, Section, distance, rgbe, seed};
use serde::Serialize;

use crate::{
    about::HolodeckDescription,
    holodeck::{Holodeck, beside},
    reframe::{MovedSample, SORTED},
};

/// A captured ray.
#[derive(Clone, Copy, Debug)]
pub struct CapturedRay {
    /// Where it begins, scene units.
    pub eye: DVec3,
    /// Its direction; unit length.
    pub direction: DVec3,
    /// What it hit, scene units from `eye`; infinite for nothing.
    pub distance: f64,
    /// Its radiance, W·sr⁻¹·m⁻².
    pub radiance: [f32; 3],
}

/// Counts of captured rays.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct CapturedCounts {
    /// Rays that at least one section stores.
    pub kept: u64,
    /// Samples. A ray that crosses several sections is stored in each.
    pub stored: u64,
    /// Rays that no section stores.
    pub outside: u64,
}

impl HolodeckDescription {
    /// Returns whether the file's rays were captured, so that nothing can be traced for it.
    pub fn is_captured(&self) -> bool {
        self.settings.engine == Engine::Captured
    }

    /// Checks that rays can be traced for the file that is at `path`.
    ///
    /// # Errors
    /// If its rays were captured. The error says what the user can do.
    pub fn check_traced(&self, path: &Path) -> Result<()> {
        let path = path.display();
        ensure!(
            !self.is_captured(),
            "{path} holds captured rays and has no scene, so nothing can be traced for it: show it \
             with `holodeck replay {path}`"
        );
        Ok(())
    }
}

impl Holodeck {
    /// Makes a new file of captured rays, which `store` stores. The file appears whole or not at
    /// all.
    ///
    /// # Errors
    /// If the file exists or cannot be written, a section is not valid, or `store` fails.
    pub fn capture<T>(
        path: &Path,
        about: HolodeckDescription,
        store: impl FnOnce(&Holodeck) -> Result<T>,
    ) -> Result<T> {
        ensure!(!path.exists(), "{} exists already: name a new file", path.display());
        let fresh = beside(path)?;
        let fill = || {
            let new = Holodeck::create(&fresh, about, &[], 0)?;
            let stored = store(&new)?;
            new.save_makers()?;
            new.file.flush()?;
            Ok(stored)
        };
        let made = fill().and_then(|stored| {
            std::fs::rename(&fresh, path)
                .with_context(|| format!("making {}", path.display()))
                .map(|()| stored)
        });
        if made.is_err() {
            // Nothing of value is in it.
            let _ = std::fs::remove_file(&fresh);
        }
        made
    }

    /// Stores the rays of one picture as single rays of their beams. `source` names the picture.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn store_captured(
        &self,
        source: &str,
        rays: impl IntoIterator<Item = CapturedRay>,
    ) -> Result<CapturedCounts> {
        let maker = self.makers_mut().of(source, None, None);
        let mut counts = CapturedCounts::default();
        let mut waiting = Vec::new();
        for (number, ray) in (0..).zip(rays) {
            let before = waiting.len();
            for (index, section) in (0..).zip(self.sections.iter()) {
                if let Some((key, sample)) = place(section, index, &ray, number) {
                    waiting.push(MovedSample { key, maker, paths: 1, sample });
                }
            }
            let placed = (waiting.len() - before) as u64;
            counts.stored += placed;
            counts.kept += u64::from(placed > 0);
            counts.outside += u64::from(placed == 0);
            if waiting.len() >= SORTED {
                self.store(&mut waiting)?;
            }
        }
        self.store(&mut waiting)?;
        Ok(counts)
    }
}

/// Returns the beam and the sample with which a section stores a ray; `None` if it does not.
/// `number` makes the rounding of colours random.
fn place(
    section: &Section,
    index: u16,
    ray: &CapturedRay,
    number: u32,
) -> Option<(BeamKey, Sample)> {
    let CapturedRay { eye, direction, distance, radiance } = *ray;
    let crossed = section.line(eye, direction)?;
    let starts = crossed.entry_t.max(0.0);
    if crossed.exit_t <= 0.0 || distance < starts {
        return None;
    }
    let stored = section.ray(crossed.pair, crossed.coords);
    let along = |from_eye: f64| (eye + direction * from_eye - stored.origin).dot(stored.direction);
    let beam = section.beam(crossed.pair);
    let key = BeamKey { section: index, beam };
    let hit = if distance.is_finite() { along(distance) } else { f64::INFINITY };
    let dither = seed(index, beam, number) as u32;
    let code = distance::encode(hit, section.diagonal());
    Some((key, Sample::from_codes(crossed.coords, rgbe::encode(radiance, dither), code)))
}

#[cfg(test)]
mod tests {
    use holo_section::{SectionSpec, ViewClass};

    use super::*;

    fn section() -> Section {
        let axes = [[4.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 0.0, 3.0]];
        let (origin, grid) = ([1.0, 2.0, 0.0], [8, 10, 6]);
        let class = ViewClass::Interior;
        Section::new(SectionSpec { origin, axes, grid, class, obstructions: true }).unwrap()
    }

    fn ray(eye: [f64; 3], towards: [f64; 3], distance: f64) -> CapturedRay {
        let (eye, direction) = (eye.into(), DVec3::from_array(towards).normalize());
        CapturedRay { eye, direction, distance, radiance: [1.0, 0.5, 0.25] }
    }

    #[test]
    fn a_stored_ray_passes_its_eye_and_ends_at_what_it_showed_within_the_steps_of_the_file() {
        let section = section();
        // A step is half a metre by 256. Distances below the diagonal, 7.07 m, have 2048 codes.
        let (step, half_code) = (0.5 / 256.0, section.diagonal() / 4096.0);
        for number in 0..2000_u32 {
            let unit = |salt: f64| (f64::from(number) * salt).fract();
            let eye = [1.5 + 3.0 * unit(0.618), 3.0 + 3.0 * unit(0.414), 0.5 + 2.0 * unit(0.732)];
            let towards = [unit(0.236) - 0.5, unit(0.302) - 0.5, 0.7 * unit(0.449) - 0.35];
            let ray = ray(eye, towards, 0.2 + unit(0.162));
            let (key, sample) = place(&section, 3, &ray, number).unwrap();
            let stored = section.ray(section.cells(key.beam).unwrap(), sample.coords);
            let away = holo_section::ray_eye_distance(&stored, ray.eye);
            assert!(away < step, "{number}: {away}");
            let end = stored.origin + stored.direction * sample.distance(section.diagonal());
            let was = ray.eye + ray.direction * ray.distance;
            assert!(end.distance(was) < step + half_code, "{number}: {end} {was}");
            assert_eq!(key.section, 3);
            assert_eq!(sample.rgb(), ray.radiance, "powers of 2 are exact");
        }
    }

    #[test]
    fn a_ray_is_stored_where_it_is_known_and_nowhere_else() {
        let section = section();
        let is_stored =
            |eye, towards, distance| place(&section, 0, &ray(eye, towards, distance), 0).is_some();
        assert!(is_stored([3.0, 4.0, 1.0], [1.0, 0.1, 0.0], 9.0), "from inside to beyond");
        assert!(is_stored([0.0, 4.0, 1.0], [1.0, 0.1, 0.0], 3.0), "from outside into it");
        assert!(!is_stored([0.0, 4.0, 1.0], [1.0, 0.1, 0.0], 0.9), "it ends before the section");
        assert!(!is_stored([0.0, 4.0, 1.0], [-1.0, 0.1, 0.0], 9.0), "it leads away");
        assert!(!is_stored([0.0, 4.0, 9.0], [1.0, 0.1, 0.0], 9.0), "it passes by");
        let sky = ray([3.0, 4.0, 1.0], [0.0, 0.1, 1.0], f64::INFINITY);
        let (_, sample) = place(&section, 0, &sky, 0).unwrap();
        assert_eq!(sample.distance(section.diagonal()), f64::INFINITY);
    }
}
