//! The trait [`RayWishes`]: samples that a renderer's view would gain from.

use holo_picture::View;
use holo_section::{BeamKey, RayCoords};

use crate::{BeamSearch, DriverError, FrameRequest, PixelWeights, Search, WantedBeam};

/// What a renderer's view would gain from: beams by weight, single rays, and rays of the view
/// itself. Each renderer states all of them, also those that it has no use for.
pub trait RayWishes {
    /// Returns `beams` with weights that consider the driver's samples.
    ///
    /// The session calls it before [`Renderer::look`](crate::Renderer::look), with the beams of the
    /// view to come. It must be quick, because the request to the server waits for it.
    ///
    /// # Errors
    /// If the driver cannot show the view.
    fn weigh(
        &mut self,
        look: &FrameRequest,
        beams: Vec<WantedBeam>,
    ) -> Result<Vec<WantedBeam>, DriverError>;

    /// Returns the weights of the pixels of the last frame at rest, by the error that a further
    /// sample would remove. `None` if the driver does not know its error, or has drawn no such
    /// frame.
    ///
    /// The session divides later rays of the view between its beams accordingly.
    fn pixel_weights(&mut self) -> Option<PixelWeights>;

    /// Returns the single rays that would improve the next frames most. `None` if the driver never
    /// wants any.
    ///
    /// `expected` is the view that is expected when their samples arrive, if the eye moves.
    fn rays(&mut self, expected: Option<&View>) -> Option<Vec<(BeamKey, RayCoords)>>;

    /// Returns the distance from the eye within which rays for a view should pass, scene units. The
    /// nearest visible surface is at distance `nearest`.
    fn viewpoint_radius(&mut self, look: &FrameRequest, nearest: f64) -> f64;

    /// Returns the known distances from the eye, scene units, of points spread over the picture.
    fn depths(&mut self) -> Vec<f32>;

    /// Returns the pixels that live rays can improve, by number, row by row from the top. No
    /// section covers them, and their rays may hit something. Empty while the eye moves, because it
    /// leaves the view soon.
    fn uncovered(&mut self) -> Vec<u32>;

    /// Returns a search for beams that the view does not cross but whose stored samples are useful.
    /// `None` without such beams.
    fn surface_beams(&mut self, search: Search) -> Option<BeamSearch>;
}
