//! Samples that wait. Placing many together is faster than placing each when it arrives.

use std::ops::Range;

use holo_raycast::Raycaster;
use holo_section::{BeamKey, Sample, Section};
use rayon::prelude::*;

use super::materials::Materials;
use super::place::{Placed, Placer};

/// Most samples that one thread places in one go.
const PIECE: usize = 1 << 12;

/// Samples that wait to be placed together.
#[derive(Default)]
pub(crate) struct Waits {
    samples: Vec<Sample>,
    /// The beams and paths that they belong to, in pieces.
    pieces: Vec<(BeamKey, u16, Range<usize>)>,
}

impl Waits {
    pub(crate) fn push(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) {
        for piece in samples.chunks(PIECE) {
            let begin = self.samples.len();
            self.samples.extend_from_slice(piece);
            self.pieces.push((beam, paths, begin..self.samples.len()));
        }
    }

    /// Returns the number of samples.
    pub(crate) fn len(&self) -> usize {
        self.samples.len()
    }

    /// Returns the places of all samples, which wait no more.
    pub(crate) fn take_placed(
        &mut self,
        sections: &[Section],
        raycaster: &Raycaster,
        materials: &Materials,
    ) -> Vec<Placed> {
        let Waits { samples, pieces } = self;
        let placer = Placer::new(raycaster, materials);
        let place = |mut placed: Vec<Placed>,
                     (key, paths, range): &(BeamKey, u16, Range<usize>)| {
            if let Some(section) = sections.get(usize::from(key.section)) {
                placer.place_beam(section, key.beam, *paths, &samples[range.clone()], &mut placed);
            }
            placed
        };
        let placed: Vec<Vec<Placed>> = pieces.par_iter().fold(Vec::new, place).collect();
        samples.clear();
        pieces.clear();
        placed.concat()
    }
}
