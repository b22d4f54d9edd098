//! The brightness that all pictures of a holodeck share, so that they can be compared.

use std::time::Duration;

use anyhow::Result;
use glam::DVec3;
use holo_picture::{Look, Picture, ViewSpec};
use holo_tracer::{Settings, Tracer};

use crate::opening::OpenedScene;
use crate::passes::{TraceJob, WorkLimit};

/// Width and height of the picture that determines the brightness, and its paths per pixel. The
/// log-average of so many paths is within a few percent of a good picture's.
const SIZE: (u32, u32) = (40, 30);
const PATHS: u32 = 16;

/// Returns the factor from radiance to display light that suits the first view. `None` if that view
/// shows no light.
///
/// # Errors
/// If there is no view, or the scene cannot be traced.
pub fn of_first_view(opened: &mut OpenedScene, bounces: Option<u32>) -> Result<Option<f32>> {
    let up = Some(DVec3::from_array(opened.up));
    let mut spec = ViewSpec { vu: up, ..ViewSpec::default() };
    if let Some((_, first)) = opened.views.first() {
        spec.apply_line(first)?;
    }
    let (view, size) = spec.resolve(SIZE)?;
    let settings = Settings { bounces, ..Settings::default() };
    let job = TraceJob {
        tracer: Tracer::with_raycaster(opened.raycaster()?, settings)?,
        view,
        size,
        seed: 0,
        threads: std::thread::available_parallelism().map_or(1, usize::from),
        limit: WorkLimit::Paths(PATHS),
        twin: None,
        has_errors: false,
    };
    let sums = job.run(|| Duration::ZERO, || false, |_| {}).sums;
    let mut picture = Picture::new(size.0, size.1);
    picture.pixels.iter_mut().zip(&sums).for_each(|(pixel, sums)| *pixel = sums.mean());
    let has_light = picture.pixels.iter().flatten().any(|&c| c > 0.0);
    Ok(Look::default().show(&picture).exposure.filter(|_| has_light))
}
