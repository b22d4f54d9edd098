//! The trait [`Renderer`]: draws one view at a time from a driver's light.

use std::ops::Range;

use holo_picture::Picture;

use crate::{
    DriverError, Frame, FramePhase, FrameRequest, Interrupt, LiveSample, PartsPlan, RayWishes,
};

/// Draws frames of one view after another from its [`Light`](crate::Light).
///
/// A session calls [`look`](Self::look) for each view. It then inserts what arrives and draws as
/// often as it likes. Frames at rest depend on the set of samples inserted since `look`, or since
/// the session began if the light has room, and not on earlier views.
pub trait Renderer: Send {
    /// Starts another view.
    ///
    /// # Errors
    /// If the driver cannot show the view.
    fn look(&mut self, look: &FrameRequest) -> Result<(), DriverError>;

    /// Inserts rays of the view itself, each the mean of `paths` paths, traced for the pixels that
    /// [`RayWishes::uncovered`] returned.
    fn insert_live(&mut self, paths: u16, rays: &[LiveSample]);

    /// Reports that all stored samples of the view have arrived.
    fn settle(&mut self);

    /// Draws a frame. `None` before the first view, and if `interrupt` ended the frame, which may
    /// happen only in [`FramePhase::Rest`]. Renderers that draw fast ignore the interrupt.
    ///
    /// Calls `stage_ended` with the name of each stage as it ends, so that the caller can measure
    /// the stages. Renderers without stages never call it.
    fn draw(
        &mut self,
        phase: FramePhase,
        interrupt: &Interrupt,
        stage_ended: &mut dyn FnMut(&'static str),
    ) -> Option<Frame>;

    /// Returns whether drawing again would improve the frame without any new sample.
    fn refines(&self) -> bool;

    /// Does a piece of work in advance for the next frame, which has this phase. Returns true if
    /// more is left. Called while no samples arrive.
    fn prepare(&mut self, phase: FramePhase) -> bool;

    /// Switches a part of the driver's method on or off from the next frame on. Returns whether
    /// the driver has a part of this name.
    fn switch(&mut self, part: &str, on: bool) -> bool;

    /// Returns what draws pictures in parts; `None` if the driver cannot.
    fn parts(&mut self) -> Option<&mut dyn PartsRenderer>;

    /// Returns what the view would gain from.
    fn wishes(&mut self) -> &mut dyn RayWishes;
}

/// Draws pictures in parts, as well as the driver can, from the samples that it has. The view that
/// is shown does not change.
pub trait PartsRenderer {
    /// Plans a picture.
    fn plan(&mut self, look: &FrameRequest) -> PartsPlan;

    /// Draws these columns and rows of a planned picture, counted from its left and top. `None` if
    /// it was interrupted.
    fn part(
        &mut self,
        plan: &PartsPlan,
        columns: Range<u32>,
        rows: Range<u32>,
        interrupt: &Interrupt,
    ) -> Option<Picture>;
}
