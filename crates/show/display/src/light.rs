//! The trait [`Light`]: what a driver knows of the scene's light, for a session.

use holo_section::{BeamKey, Sample};

use crate::Renderer;

/// The scene that a sample shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Age {
    /// The scene as it is.
    Present,
    /// The scene before an edit. Such samples are shown where few others are.
    Earlier,
}

/// Light of a session. Several views may be drawn from it, each by a [`Renderer`] of its own.
pub trait Light: Send {
    /// Returns a renderer that draws from this light, besides those that there are.
    fn renderer(&mut self) -> Box<dyn Renderer>;

    /// Returns how many samples can be stored for later views, besides those of the present ones.
    /// 0 if samples only serve the view that they were requested for.
    ///
    /// With room, a session inserts each sample once, and not once for each view. It loads a file
    /// with fewer samples whole.
    fn room(&self) -> u64;

    /// Inserts samples of one beam, each the mean of `paths` paths. Ignores unknown sections and
    /// beams.
    fn insert(&mut self, age: Age, beam: BeamKey, paths: u16, samples: &[Sample]);

    /// Takes out samples that were inserted as [`Age::Earlier`] with the same arguments. They may
    /// be a part of those inserted at once. Returns whether the driver can do that; if not, they
    /// stay.
    fn remove_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) -> bool;

    /// Marks a beam as unseen: none of its rays can hit anything.
    fn insert_unseen(&mut self, beam: BeamKey);
}
