//! How many pixels a ray stands for while an object moves.

/// Time in which cells of a moving object and of its shadow are drawn, seconds. A frame also has to
/// be copied and handed over: a person sees it 50 ms after the hand.
const SECONDS: f64 = 0.022;

/// Greatest side of a cell, pixels: larger ones would not show what is carried.
const MOST: u32 = 4;

/// Weight of the last frame in the running mean.
const NEWEST: f64 = 0.3;

/// Chooses the side of cells by the time that earlier frames took.
pub(super) struct CellSides {
    /// Time of a frame whose cells are pixels; 0 if none is known.
    seconds: f64,
    side: u32,
}

impl Default for CellSides {
    fn default() -> CellSides {
        CellSides { seconds: 0.0, side: 3 }
    }
}

impl CellSides {
    /// Returns the side of the next frame's cells, pixels.
    pub(super) fn side(&self) -> u32 {
        self.side
    }

    /// Records how long a frame with cells of this side took.
    pub(super) fn note(&mut self, side: u32, seconds: f64) {
        let whole = seconds * f64::from(side * side);
        let newest = if self.seconds == 0.0 { 1.0 } else { NEWEST };
        self.seconds += newest * (whole - self.seconds);
        let affordable = (self.seconds / SECONDS).sqrt();
        // A side that is nearly enough stays, so that cells do not change with every frame.
        let is_right = (0.7..1.1).contains(&(affordable / f64::from(self.side)));
        if !is_right {
            self.side = (affordable.ceil() as u32).clamp(1, MOST);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the side that settles if a frame whose cells are pixels takes this long.
    fn settled(seconds: f64) -> u32 {
        let mut sides = CellSides::default();
        for _ in 0..50 {
            let side = sides.side();
            sides.note(side, seconds / f64::from(side * side));
        }
        sides.side()
    }

    #[test]
    fn small_objects_have_a_ray_in_each_pixel_and_large_ones_as_many_as_the_time_allows() {
        assert_eq!(settled(0.001), 1);
        assert_eq!(settled(0.08), 2);
        assert_eq!(settled(0.16), 3);
        assert_eq!(settled(10.0), MOST);
    }
}
