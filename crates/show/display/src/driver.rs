//! The trait that every driver implements, and its messages.

use holo_picture::{Picture, View};
use holo_section::{BeamKey, RayCoords, Sample};

use std::ops::Range;

use crate::{
    BeamSearch, Frame, Interrupt, LiveSample, PartsPlan, Search, WantedBeam, viewpoint_radius,
};

/// The number of pixels that a driver computes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Resolution {
    /// Every pixel of the picture.
    #[default]
    Full,
    /// Every other column and row, enlarged to the whole picture. It serves glances: views that
    /// follow each other faster than full frames can be drawn, and the first picture of a view.
    Half,
    /// Every pixel of a view that the eye will leave soon. The front end has chosen as many pixels
    /// as the time allows. A driver may trade accuracy for time.
    Moving,
}

impl Resolution {
    /// Returns the number of columns and rows computed for a picture of `size` pixels.
    pub fn computed(self, size: (u32, u32)) -> (u32, u32) {
        match self {
            Self::Full | Self::Moving => size,
            Self::Half => (size.0.div_ceil(2), size.1.div_ceil(2)),
        }
    }
}

/// A view to draw, with the frame's size and resolution.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Look {
    /// The view.
    pub view: View,
    /// Width and height of the frame, pixels. [`View::resolve`] returns them and bounds them.
    pub size: (u32, u32),
    /// The part of these pixels that is computed.
    pub resolution: Resolution,
}

impl Look {
    /// Most pixels of a small view.
    const SMALL: u64 = 100_000;

    /// Returns true if the view has so few pixels that its best picture can be its first, because
    /// nobody notices the delay.
    pub fn is_small(&self) -> bool {
        let (width, height) = self.size;
        self.resolution == Resolution::Full && u64::from(width) * u64::from(height) <= Self::SMALL
    }
}

/// The surface under a pixel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceAt {
    /// Distance from the eye, scene units; infinite if the pixel's ray hits nothing.
    pub distance: f32,
    /// Index of the triangle in the scene, if the driver knows the scene.
    pub triangle: Option<u32>,
}

/// The reason why a driver cannot show a view.
#[derive(Debug, thiserror::Error)]
#[error("driver {driver}: {reason}")]
pub struct DriverError {
    /// Name of the driver.
    pub driver: &'static str,
    /// The reason, as a sentence for people.
    pub reason: String,
}

/// Turns samples into frames, from view to view.
///
/// For each view a front end calls [`weigh`](Self::weigh), then [`look`](Self::look). It then
/// inserts what arrives and draws as often as it likes. [`settle`](Self::settle) reports that all
/// stored samples of the view have arrived. Later frames depend on the set of samples inserted
/// since `look`, and not on earlier views.
pub trait Driver: Send {
    /// Returns the driver's name, as reports give it.
    fn name(&self) -> &'static str;

    /// Returns whether samples inserted for one view count for all later ones. If so, a front end
    /// inserts each sample once in a session, and not once for each view.
    fn keeps_samples(&self) -> bool {
        false
    }

    /// Returns how many samples the driver can keep at most, besides those of the view; 0 unless it
    /// [`keeps_samples`](Self::keeps_samples). A front end loads a file with fewer samples whole.
    fn room(&self) -> u64 {
        0
    }

    /// Returns `beams` with weights that consider the driver's samples.
    ///
    /// The front end calls it before [`look`](Self::look), with the beams of the view to come. It
    /// must be quick, because the request to the server waits for it.
    ///
    /// # Errors
    /// If the driver cannot show the view.
    fn weigh(
        &mut self,
        _look: &Look,
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError> {
        Ok(beams)
    }

    /// Starts another view.
    ///
    /// # Errors
    /// If the driver cannot show the view.
    fn look(&mut self, look: &Look) -> Result<(), DriverError>;

    /// Inserts samples of one beam, each the mean of `paths` paths. Ignores unknown sections and
    /// beams.
    fn insert(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]);

    /// Inserts samples of the scene before an edit. They are shown where few others are.
    fn insert_earlier(&mut self, beam: BeamKey, paths: u16, samples: &[Sample]) {
        self.insert(beam, paths, samples);
    }

    /// Takes out samples that [`insert_earlier`](Self::insert_earlier) was given with the same
    /// arguments. They may be a part of those inserted at once. Returns whether the driver can do
    /// that; if not, they stay.
    fn remove_earlier(&mut self, _beam: BeamKey, _paths: u16, _samples: &[Sample]) -> bool {
        false
    }

    /// Marks a beam as unseen: none of its rays can hit anything.
    fn insert_unseen(&mut self, beam: BeamKey);

    /// Inserts rays of the view itself, each the mean of `paths` paths, traced for the pixels that
    /// [`uncovered`](Self::uncovered) returned.
    fn insert_live(&mut self, _paths: u16, _rays: &[LiveSample]) {}

    /// Reports that all stored samples of the view have arrived.
    fn settle(&mut self) {}

    /// Reports that the next frame is for a file. It may take longer than one that is displayed,
    /// after which the eye may move on.
    fn draw_for_file(&mut self) {}

    /// Gives the driver a signal. While it is set, a frame at rest may end early, with a single
    /// pixel, except a view's first one. Drivers that draw fast ignore it.
    fn end_early_by(&mut self, _interrupt: Interrupt) {}

    /// Draws the frame. Calls `stage_ended` with the name of each stage as it ends, so that the
    /// caller can measure the stages. Drivers without stages never call it.
    fn draw(&mut self, stage_ended: &mut dyn FnMut(&'static str)) -> Frame;

    /// Plans a picture that is drawn in parts, as well as the driver can, from the samples that it
    /// has. Neither this nor [`draw_part`](Self::draw_part) changes the view that is shown. `None`
    /// if the driver cannot draw parts.
    fn plan_parts(&mut self, _look: &Look) -> Option<PartsPlan> {
        None
    }

    /// Draws these columns and rows of a planned picture, counted from its left and top. `None` if
    /// the driver was interrupted, or cannot draw parts.
    fn draw_part(
        &mut self,
        _plan: &PartsPlan,
        _columns: Range<u32>,
        _rows: Range<u32>,
    ) -> Option<Picture> {
        None
    }

    /// Returns whether drawing again would improve the frame without any new sample.
    fn refines(&self) -> bool {
        false
    }

    /// Does a piece of work for the next frame in advance. Returns true if more is left. Called
    /// while no samples arrive.
    fn prepare(&mut self) -> bool {
        false
    }

    /// Returns the known distances from the eye, scene units, of points spread over the picture.
    fn depth(&mut self) -> Vec<f32>;

    /// Returns whether [`depth`](Self::depth) is complete before any sample has arrived.
    fn knows_depth(&self) -> bool {
        false
    }

    /// Returns the surface under a pixel; `None` where nothing is known.
    fn surface_at(&mut self, column: u32, row: u32) -> Option<SurfaceAt>;

    /// Returns the pixels that live rays can improve, by number, row by row from the top. No
    /// section covers them, and their rays may hit something. Empty while the eye moves, because it
    /// leaves the view soon.
    fn uncovered(&self) -> Vec<u32> {
        Vec::new()
    }

    /// Returns true if [`wanted_rays`](Self::wanted_rays) may return rays.
    fn wants_rays(&self) -> bool {
        false
    }

    /// Returns the single rays that would improve the frame most.
    fn wanted_rays(&mut self) -> Vec<(BeamKey, RayCoords)> {
        Vec::new()
    }

    /// Returns a search for beams that the view does not cross but whose stored samples are useful.
    /// `None` without such beams.
    fn surface_beams(&self, _search: Search) -> Option<BeamSearch> {
        None
    }

    /// Returns the distance from the eye within which traced rays should pass, scene units. The
    /// nearest visible surface is at distance `nearest`.
    fn viewpoint_radius(&self, view: &View, size: (u32, u32), nearest: f64) -> f64 {
        viewpoint_radius(view, size, nearest, 1.0)
    }

    /// Sets the distance of the nearest visible surface, scene units.
    fn set_nearest(&mut self, _nearest: f64) {}

    /// Switches a part of the driver's method on or off from the next frame on. Returns whether
    /// the driver has a part of this name.
    fn switch(&mut self, _part: &str, _on: bool) -> bool {
        false
    }
}
