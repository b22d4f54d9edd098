//! Which rays of a beam its sample numbers stand for.
//!
//! Invariant: a sample's ray is a function of (section, beam, sample number, viewpoint), so that restarts repeat
//! nothing and two runs ask for the same rays.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use crate::cells::{BeamId, CellPair, RayCoords};
use crate::hash::combine;
use crate::proximity::Proximity;
use crate::section::{Frame, Section, SectionRay};
use crate::sobol::ScrambledSobol;

/// An eye near which rays are wanted.
#[derive(Serialize, Deserialize, Copy, Clone, Debug, PartialEq)]
pub struct Viewpoint {
    /// Position, world.
    pub eye: [f64; 3],
    /// How near to the eye a ray should pass, world units.
    pub radius: f64,
}

/// Chooses the rays of one beam, by sample number.
#[derive(Clone, Debug)]
pub struct BeamSampler {
    frame: Frame,
    pair: CellPair,
    sequence: ScrambledSobol,
    proximity: Option<Proximity>,
}

impl Section {
    /// A sampler of the rays of a beam: those near the viewpoint if one is given, otherwise spread over the whole beam.
    /// `None` when the section has no such beam. A viewpoint that is not finite, or that no ray of the beam passes
    /// within its radius, gives uniform rays: see [`BeamSampler::is_limited`].
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
    /// Positions of a sample's ray in the beam's cells.
    pub fn coords(&self, sample_number: u32) -> RayCoords {
        match &self.proximity {
            Some(proximity) => proximity.coords(&self.sequence, sample_number),
            None => RayCoords(self.sequence.point(sample_number).map(|x| (x >> 24) as u8)),
        }
    }

    /// The ray at these positions.
    pub fn ray(&self, coords: RayCoords) -> SectionRay {
        self.frame.ray(self.pair, coords)
    }

    /// Whether rays pass near the viewpoint; false when none was given, or when no ray of the beam does.
    pub fn is_limited(&self) -> bool {
        self.proximity.is_some()
    }
}
