//! The screens of a wall or a room around a person (Larson & Simmons 1999, §2.4.1).

use holo_display::{Certainty, DriverError, Frame, FrameRequest};
use holo_picture::{View, ViewError, ViewKind, ViewParams};

/// Greatest distance of a screen's edge from its axis, as a multiple of its distance. At 1000, a
/// screen is seen at less than 0.1°.
const MOST_TANGENT: f64 = 1e3;

/// A rectangle that a person looks at, and through it at the scene. Lengths are in any unit: only
/// their ratios matter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WallScreen {
    /// Its edges, from the point of its plane that is nearest to the eye: left, right, bottom and
    /// top. Left and bottom are usually negative.
    pub edges: [f64; 4],
    /// Distance of its plane from the eye.
    pub distance: f64,
    /// Direction in which its plane is nearest: degrees to the right of the view's direction.
    pub turn: f64,
    /// The same: degrees above.
    pub tilt: f64,
}

impl WallScreen {
    /// Parses `LEFT,RIGHT,BOTTOM,TOP,DISTANCE[,TURN[,TILT]]`.
    ///
    /// # Errors
    /// A text for the user.
    pub fn parse(text: &str) -> Result<WallScreen, String> {
        let numbers: Result<Vec<f64>, _> =
            text.split(',').map(|word| word.trim().parse()).collect();
        let numbers = numbers.map_err(|error| format!("`{text}`: {error}"))?;
        let (&[left, right, bottom, top, distance], rest) =
            numbers.split_first_chunk::<5>().filter(|(_, rest)| rest.len() <= 2).ok_or_else(
                || format!("`{text}` has {} numbers: 5 to 7 are possible", numbers.len()),
            )?;
        let [turn, tilt] = [0, 1].map(|at| rest.get(at).copied().unwrap_or(0.0));
        let screen = WallScreen { edges: [left, right, bottom, top], distance, turn, tilt };
        // Comparisons are false for NaN.
        let is_seen = distance > 0.0
            && left < right
            && bottom < top
            && screen.tangents().iter().all(|tangent| tangent.abs() <= MOST_TANGENT);
        let is_turned = turn.abs() <= 360.0 && tilt.abs() <= 90.0;
        if !is_seen {
            return Err(format!(
                "`{text}` is no screen: LEFT must be below RIGHT, BOTTOM below TOP, DISTANCE above \
                 0, and edges within {MOST_TANGENT} distances"
            ));
        }
        if !is_turned {
            return Err(format!("`{text}`: TURN is at most 360°, and TILT at most 90°"));
        }
        Ok(screen)
    }

    /// Returns its edges at distance 1.
    fn tangents(&self) -> [f64; 4] {
        self.edges.map(|edge| edge / self.distance)
    }

    /// Returns what the leader's eye sees through a part of the screen, from `start` to `end` in
    /// widths of the screen from its left edge: a perspective view whose axis is perpendicular to
    /// the screen.
    ///
    /// # Errors
    /// If the eye is at no finite place.
    pub fn view(&self, leader: &View, [start, end]: [f64; 2]) -> Result<View, ViewError> {
        let [left, right, bottom, top] = self.tangents();
        let (left, right) = (left + (right - left) * start, left + (right - left) * end);
        let (width, height) = (right - left, top - bottom);
        let (turn_sine, turn_cosine) = self.turn.to_radians().sin_cos();
        let (tilt_sine, tilt_cosine) = self.tilt.to_radians().sin_cos();
        let level = leader.vd * turn_cosine + leader.right() * turn_sine;
        let angle = |extent: f64| 2.0 * (0.5 * extent).atan().to_degrees();
        View::try_from(ViewParams {
            kind: ViewKind::Perspective,
            vp: leader.vp,
            vd: level * tilt_cosine + leader.up() * tilt_sine,
            vu: leader.up() * tilt_cosine - level * tilt_sine,
            vh: angle(width),
            vv: angle(height),
            vs: 0.5 * (left + right) / width,
            vl: 0.5 * (bottom + top) / height,
            vo: leader.vo,
            va: leader.va,
        })
    }
}

/// Screens of one person, the leader. A frame has a column of equal width for each, in order.
#[derive(Clone, Debug, PartialEq)]
pub struct Wall {
    screens: Vec<WallScreen>,
}

impl Wall {
    /// Most screens: a room has six, and a frame of eight is as wide as browsers show.
    pub const MOST_SCREENS: usize = 8;

    /// Returns a wall of these screens.
    ///
    /// # Errors
    /// A text for the user, if there are none, or too many.
    pub fn new(screens: Vec<WallScreen>) -> Result<Wall, String> {
        match screens.len() {
            1..=Self::MOST_SCREENS => Ok(Wall { screens }),
            count => Err(format!("a wall has 1 to {} screens, not {count}", Self::MOST_SCREENS)),
        }
    }

    /// Returns the number of its screens.
    pub fn count(&self) -> usize {
        self.screens.len()
    }

    /// Returns the first column of each screen in a frame of `width`, and the end of the last.
    fn columns(&self, width: u32) -> Vec<u32> {
        let count = self.screens.len() as u64;
        (0..=count).map(|at| ((u64::from(width) * at + count / 2) / count) as u32).collect()
    }

    /// Returns what each screen shows, for a request of the leader's view.
    ///
    /// # Errors
    /// If the eye is at no finite place, or the frame is narrower than the wall has screens.
    pub fn requests(&self, look: &FrameRequest) -> Result<Vec<FrameRequest>, DriverError> {
        let failed = |reason: String| DriverError { driver: "wall", reason };
        let columns = self.columns(look.size.0);
        let per_pixel = self.screens.len() as f64 / f64::from(look.size.0.max(1));
        let request = |(at, screen): (usize, &WallScreen)| {
            let (first, end) = (columns[at], columns[at + 1]);
            if first == end {
                return Err(failed(format!("{} columns are too few", look.size.0)));
            }
            // A column of the frame may lie across the edge of two screens. The next screen begins
            // where this one ends.
            let part = [first, end].map(|column| f64::from(column) * per_pixel - at as f64);
            let view = screen.view(&look.view, part).map_err(|error| failed(error.to_string()))?;
            let size = (end - first, look.size.1);
            Ok(FrameRequest { view, size, is_moving: look.is_moving })
        };
        self.screens.iter().enumerate().map(request).collect()
    }

    /// Arranges the frames of the screens in a frame of `size` pixels.
    pub fn arrange(&self, size: (u32, u32), screens: &[Frame]) -> Frame {
        let mut frame = Frame::black(size);
        frame.is_stereo = true;
        let has_certainty = screens.iter().all(|screen| !screen.certainty.is_empty());
        if has_certainty {
            let unknown = Certainty { error: f32::INFINITY, samples: 0 };
            frame.certainty = vec![unknown; frame.depth.len()];
        }
        let width = size.0 as usize;
        for (screen, first) in screens.iter().zip(self.columns(size.0)) {
            let across = screen.picture.width as usize;
            for row in 0..screen.picture.height as usize {
                let from = row * across..(row + 1) * across;
                let start = row * width + first as usize;
                let to = start..start + across;
                let pixels = &screen.picture.pixels[from.clone()];
                frame.picture.pixels[to.clone()].copy_from_slice(pixels);
                frame.depth[to.clone()].copy_from_slice(&screen.depth[from.clone()]);
                if has_certainty {
                    frame.certainty[to].copy_from_slice(&screen.certainty[from]);
                }
            }
            frame.uncovered_pixels += screen.uncovered_pixels;
            frame.empty_pixels += screen.empty_pixels;
            frame.unseen_pixels += screen.unseen_pixels;
            frame.guessed_pixels += screen.guessed_pixels;
            frame.gleam_pixels += screen.gleam_pixels;
            frame.samples_used += screen.samples_used;
        }
        frame
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn impossible_screens_are_refused_with_a_reason() {
        for (text, reason) in [
            ("x,1,-1,1,1", "invalid float"),
            ("-1,1,-1,1", "4 numbers"),
            ("-1,1,-1,1,1,0,0,0", "8 numbers"),
            ("1,-1,-1,1,1", "LEFT must be below RIGHT"),
            ("-1,1,1,1,1", "BOTTOM below TOP"),
            ("-1,1,-1,1,0", "DISTANCE above"),
            ("-1,1,-1,1,1e-9", "within 1000 distances"),
            ("NaN,1,-1,1,1", "no screen"),
            ("-1,1,-1,inf,1", "no screen"),
            ("-1,1,-1,1,1,NaN", "TURN"),
            ("-1,1,-1,1,1,0,91", "TILT"),
        ] {
            let error = WallScreen::parse(text).unwrap_err();
            assert!(error.contains(reason), "{text}: {error}");
        }
        assert!(WallScreen::parse("-1, 1, -0.5, 0.5, 2, -90").is_ok());
    }
}
