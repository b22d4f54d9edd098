//! Angles of a file, and the webs that are made of them.

use crate::{PhotometricWeb, PhotometryError, WebPole};

/// Angles that differ by less are equal, degrees.
pub(crate) const SAME: f64 = 0.01;

/// Half-planes of a web: their angle in degrees, and their intensities.
pub(crate) type Planes = Vec<(f64, Vec<f64>)>;

/// Brings the angles of planes to 0 to 360, sorts them, and removes what occurs twice. The first
/// plane also is the last.
pub(crate) fn closed(mut planes: Planes) -> Planes {
    planes.iter_mut().for_each(|(angle, _)| *angle = angle.rem_euclid(360.0));
    planes
        .iter_mut()
        .filter(|(angle, _)| 360.0 - *angle < SAME)
        .for_each(|(angle, _)| *angle = 0.0);
    planes.sort_by(|a, b| a.0.total_cmp(&b.0));
    planes.dedup_by(|later, earlier| later.0 - earlier.0 < SAME);
    if let Some((angle, plane)) = planes.first().cloned() {
        planes.push((angle + 360.0, plane));
    }
    planes
}

/// Makes a web of angles from its pole and of its half-planes.
pub(crate) fn make(
    line: usize,
    pole: WebPole,
    polar: &[f64],
    turns: &[(f64, Vec<f64>)],
) -> Result<PhotometricWeb, PhotometryError> {
    let candela = turns.iter().flat_map(|(_, plane)| plane.iter().map(|value| *value as f32));
    let angles: Vec<f64> = turns.iter().map(|(angle, _)| *angle).collect();
    let polar = polar.iter().map(|angle| angle.clamp(0.0, 180.0)).collect::<Vec<_>>();
    let web = PhotometricWeb::new(pole, radians(&polar), radians(&angles), candela.collect());
    web.ok_or_else(|| {
        let problem = "are too many, or lie too close to each other".to_owned();
        PhotometryError::Angles { line, what: "horizontal and vertical", problem }
    })
}

/// Returns angles in degrees as radians.
fn radians(degrees: &[f64]) -> Vec<f32> {
    degrees.iter().map(|angle| angle.to_radians() as f32).collect()
}

/// Checks that angles ascend.
pub(crate) fn check_ascent(
    angles: &[f64],
    line: usize,
    what: &'static str,
) -> Result<(), PhotometryError> {
    match angles.windows(2).find(|pair| pair[1] - pair[0] < 1e-3) {
        None => Ok(()),
        Some(pair) => {
            let problem = format!("must ascend, but {} follows {}", pair[1], pair[0]);
            Err(PhotometryError::Angles { line, what, problem })
        }
    }
}
