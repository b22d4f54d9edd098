//! Names of beams and of samples in a whole holodeck.

use std::fmt;

use crate::cells::BeamId;
use crate::sample::SampleKind;
use crate::section::Section;

/// One beam of a holodeck: the section and the beam within it.
///
/// Keys are ordered by section, then by beam.
#[derive(Copy, Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct BeamKey {
    /// Index of the section in the holodeck.
    pub section: u16,
    /// The beam within its section.
    pub beam: BeamId,
}

impl BeamKey {
    /// Returns the beam's section; `None` if `sections` has no such section, or it no such beam.
    pub fn section_in(self, sections: &[Section]) -> Option<&Section> {
        let section = sections.get(usize::from(self.section))?;
        (self.beam.0 < section.beam_count()).then_some(section)
    }
}

impl fmt::Display for BeamKey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "beam {} of section {}", self.beam.0, self.section)
    }
}

/// Samples of one beam with consecutive numbers and an equal number of paths.
///
/// A sample's name is its beam, its kind and its number. Numbers of different kinds are independent
/// of each other.
#[derive(Copy, Clone, Debug, PartialEq, Eq)]
pub struct NumberRun {
    /// The beam.
    pub key: BeamKey,
    /// How the rays were chosen.
    pub kind: SampleKind,
    /// Number of the first sample.
    pub first: u32,
    /// Number of samples.
    pub count: u32,
    /// Paths averaged into each sample.
    pub paths: u16,
}
