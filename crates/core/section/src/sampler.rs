//! The ray of each sample number of a beam.
//!
//! Invariant: a sample's ray is a function of (section, beam, sample number, viewpoint). So a
//! restart repeats no ray, and two runs trace the same rays.

use glam::DVec3;

use crate::cells::{BeamId, CellPair, RayCoords};
use crate::hash::combine;
use crate::proximity::Proximity;
use crate::section::{Section, SectionRay, StepMap};
use crate::sobol::ScrambledSobol;

/// An eye near which rays are wanted.
#[derive(Copy, Clone, Debug, PartialEq)]
pub struct Viewpoint {
    /// Position, world.
    pub eye: [f64; 3],
    /// Greatest distance of a ray from the eye, world units.
    pub radius: f64,
}

/// Chooses the rays of one beam, by sample number.
#[derive(Clone, Debug)]
pub struct BeamSampler {
    frame: StepMap,
    pair: CellPair,
    sequence: ScrambledSobol,
    proximity: Option<Proximity>,
}

impl Section {
    /// Returns a sampler of the rays of a beam; `None` if the section has no such beam.
    ///
    /// With a viewpoint, rays pass near its eye. Without one, they are spread over the whole beam.
    /// They are also spread over the whole beam if the viewpoint is not finite, or if no ray of the
    /// beam passes within its radius. [`BeamSampler::is_limited`] returns which of the two holds.
    pub fn beam_sampler(
        &self,
        section_index: u16,
        beam: BeamId,
        viewpoint: Option<&Viewpoint>,
    ) -> Option<BeamSampler> {
        let pair = self.cells(beam)?;
        let sequence = ScrambledSobol::new(combine(beam.0, u64::from(section_index)));
        let proximity = viewpoint.and_then(|v| {
            let (eye, radius) = (
                DVec3::from_array(v.eye),
                if v.radius.is_finite() { v.radius.max(0.0) } else { 0.0 },
            );
            Proximity::new(self.frame, pair, eye, radius, &sequence)
        });
        Some(BeamSampler { frame: self.frame, pair, sequence, proximity })
    }
}

impl BeamSampler {
    /// Returns the positions of a sample's ray in the beam's cells.
    pub fn coords(&self, sample_number: u32) -> RayCoords {
        match &self.proximity {
            Some(proximity) => proximity.coords(&self.sequence, sample_number),
            None => RayCoords(self.sequence.point(sample_number).map(|x| (x >> 24) as u8)),
        }
    }

    /// Returns the ray at these positions.
    pub fn ray(&self, coords: RayCoords) -> SectionRay {
        self.frame.ray(self.pair, coords)
    }

    /// Returns whether rays pass near the viewpoint: false if none was given, or if no ray of the
    /// beam does.
    pub fn is_limited(&self) -> bool {
        self.proximity.is_some()
    }
}
