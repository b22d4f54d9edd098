//! Samples kept across views.
//!
//! Invariant: as long as no more samples came than are kept, a picture after any number of [`Quadtree::look`]s within
//! [`REFETCH_DEGREES`] is that of a new driver with the same samples.

use super::Quadtree;
use super::reproject::Landing;
use holo_picture::View;
use holo_section::{BeamId, Sample};

/// Rotation of the view beyond which kept samples are of no more use than their beams would be: what shines is seen too
/// differently (Larson & Simmons 1999, §3).
pub const REFETCH_DEGREES: f64 = 20.0;
/// Samples in the order in which they came, in runs of one beam.
#[derive(Clone, Default)]
pub(crate) struct Kept {
    runs: Vec<Run>,
    samples: Vec<Sample>,
}

#[derive(Clone, Copy)]
struct Run {
    section: u16,
    beam: BeamId,
    paths: u16,
    count: usize,
}

impl Kept {
    pub fn clear(&mut self) {
        self.runs.clear();
        self.samples.clear();
    }

    /// Adds a run; beyond `most` samples the older half goes.
    pub fn add(&mut self, section: u16, beam: BeamId, paths: u16, samples: &[Sample], most: usize) {
        if most == 0 {
            return;
        }
        self.runs.push(Run { section, beam, paths, count: samples.len() });
        self.samples.extend_from_slice(samples);
        if self.samples.len() > most {
            let (mut runs, mut gone) = (0, 0);
            while self.samples.len() - gone > most / 2 && runs < self.runs.len() {
                gone += self.runs[runs].count;
                runs += 1;
            }
            self.runs.drain(..runs);
            self.samples.drain(..gone);
        }
    }
}

impl Quadtree {
    /// Takes another view of the same size, and what is kept of the samples so far: within [`REFETCH_DEGREES`] of rotation those
    /// of [`QuadtreeParams::keep`](super::QuadtreeParams::keep), else none. Whether they were kept; unseen beams always are.
    ///
    /// Kept samples count: their beams need not be sent again, and must not be, or they would count twice.
    pub fn look(&mut self, view: View) -> bool {
        self.look_and_tell(view, &mut |_, _, _| {})
    }

    /// As [`look`](Self::look), telling of each kept sample that landed its pixel, where in it, and its colour.
    pub(crate) fn look_and_tell(
        &mut self,
        view: View,
        also: &mut impl FnMut(usize, &Landing, [u8; 4]),
    ) -> bool {
        let keeps =
            self.params.keep > 0 && view.vd.dot(self.view.vd) >= REFETCH_DEGREES.to_radians().cos();
        let (mut kept, unseen) = (std::mem::take(&mut self.kept), std::mem::take(&mut self.unseen));
        self.reset(view);
        for (section, beam) in unseen {
            self.insert_unseen(section, beam);
        }
        if !keeps {
            kept.clear();
            return false;
        }
        let mut rest = kept.samples.as_slice();
        for run in &kept.runs {
            let (samples, tail) = rest.split_at(run.count);
            self.land(run.section, run.beam, run.paths, samples, also);
            rest = tail;
        }
        self.kept = kept;
        true
    }
}
