//! Luminous intensity by direction.

use std::f32::consts::{PI, TAU};

use glam::Vec3;

/// Most angles of one kind. Files have at most a few hundred.
pub const MAX_ANGLES: usize = 4096;

/// Most intensities of a web: a quarter of a degree over a sphere.
pub const MAX_WEB_VALUES: usize = 1 << 20;

/// Greatest intensity, candela: beyond the brightest lighthouse.
pub(crate) const MAX_CANDELA: f64 = 1e12;

/// Angles that differ by less are equal, radians.
const SAME: f32 = 1e-5;

/// The axis that the half-planes of a web have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WebPole {
    /// The nadir: type C. Longitudes begin at x and turn to y.
    Nadir,
    /// The long axis x: type A. Longitudes begin at the nadir and turn to -y.
    Length,
    /// The axis -y: type B. Longitudes begin at the nadir and turn to x.
    Width,
}

impl WebPole {
    /// Returns the direction of longitude 0, that of 90°, and the pole.
    #[inline]
    fn frame(self) -> [Vec3; 3] {
        match self {
            WebPole::Nadir => [Vec3::X, Vec3::Y, Vec3::NEG_Z],
            WebPole::Length => [Vec3::NEG_Z, Vec3::NEG_Y, Vec3::X],
            WebPole::Width => [Vec3::NEG_Z, Vec3::X, Vec3::NEG_Y],
        }
    }
}

/// Luminous intensity in each direction of a luminaire's frame.
#[derive(Clone, Debug, PartialEq)]
pub struct PhotometricWeb {
    pole: WebPole,
    /// Angles from the pole, ascending, radians.
    polar: Vec<f32>,
    /// Longitudes, ascending, radians. One stands for all.
    turns: Vec<f32>,
    /// Candela: those of the first longitude first.
    candela: Vec<f32>,
}

impl PhotometricWeb {
    /// Makes a web of angles from the pole, of longitudes (both ascending, radians) and of the
    /// intensities of each longitude, the first longitude first. `None` if they are not possible.
    pub fn new(
        pole: WebPole,
        polar: Vec<f32>,
        turns: Vec<f32>,
        candela: Vec<f32>,
    ) -> Option<PhotometricWeb> {
        let ascends = |angles: &[f32]| angles.windows(2).all(|pair| pair[0] < pair[1]);
        let fits = |angles: &[f32]| (1..=MAX_ANGLES).contains(&angles.len()) && ascends(angles);
        let (first, last) = (*turns.first()?, *turns.last()?);
        let is_valid = fits(&polar)
            && fits(&turns)
            && *polar.first()? >= 0.0
            && *polar.last()? <= PI + SAME
            && (-PI - SAME..=TAU + SAME).contains(&first)
            && (0.0..=TAU + SAME).contains(&(last - first))
            && polar.len() * turns.len() == candela.len()
            && candela.len() <= MAX_WEB_VALUES
            && candela.iter().all(|value| (0.0..=MAX_CANDELA as f32).contains(value));
        is_valid.then_some(PhotometricWeb { pole, polar, turns, candela })
    }

    /// Returns the pole, the angles from it, the longitudes, and the intensities: what
    /// [`new`](Self::new) takes.
    #[must_use]
    pub fn parts(&self) -> (WebPole, &[f32], &[f32], &[f32]) {
        (self.pole, &self.polar, &self.turns, &self.candela)
    }

    /// Returns the same web with its intensities times a factor.
    #[must_use]
    pub fn scaled(mut self, factor: f32) -> PhotometricWeb {
        self.candela.iter_mut().for_each(|value| *value *= factor);
        self
    }

    /// Returns the intensity in a unit direction away from the lamp, candela.
    #[must_use]
    pub fn intensity(&self, away: Vec3) -> f32 {
        let [zero, right, pole] = self.pole.frame();
        // Close to the pole, an arc cosine has few digits.
        let (x, y, z) = (away.dot(zero), away.dot(right), away.dot(pole));
        let Some((row, share)) = place(&self.polar, (x * x + y * y).sqrt().atan2(z)) else {
            return 0.0;
        };
        let rows = self.polar.len();
        let next = (row + 1).min(rows - 1);
        let at = |turn: usize| {
            let values = &self.candela[turn * rows..];
            values[row] + (values[next] - values[row]) * share
        };
        if self.turns.len() == 1 {
            return at(0);
        }
        let turn = y.atan2(x);
        let turn = if turn < self.turns[0] - SAME { turn + TAU } else { turn };
        let Some((turn, share)) = place(&self.turns, turn) else { return 0.0 };
        let next = (turn + 1).min(self.turns.len() - 1);
        at(turn) + (at(next) - at(turn)) * share
    }

    /// Returns the luminous flux, lumens: the integral over all directions.
    #[must_use]
    pub fn flux(&self) -> f64 {
        // Between two angles the intensity is linear, so both integrals are exact.
        let rows = self.polar.len();
        let around: Vec<f64> = (0..rows)
            .map(|row| {
                let at = |turn: usize| f64::from(self.candela[turn * rows + row]);
                match self.turns.len() {
                    1 => std::f64::consts::TAU * at(0),
                    turns => (1..turns)
                        .map(|turn| {
                            let width = f64::from(self.turns[turn] - self.turns[turn - 1]);
                            0.5 * (at(turn) + at(turn - 1)) * width
                        })
                        .sum(),
                }
            })
            .collect();
        let between = |row: usize| {
            let (from, to) = (f64::from(self.polar[row - 1]), f64::from(self.polar[row]));
            let (low, high) = (around[row - 1], around[row]);
            let slope = (high - low) / (to - from);
            low * from.cos() - high * to.cos() + slope * (to.sin() - from.sin())
        };
        (1..rows).map(between).sum()
    }

    /// Returns the unit direction of the greatest intensity, which lies at two of the angles.
    #[must_use]
    pub fn brightest(&self) -> Vec3 {
        let place = |best: usize, at: usize| match self.candela[at] > self.candela[best] {
            true => at,
            false => best,
        };
        let at = (0..self.candela.len()).fold(0, place);
        let rows = self.polar.len();
        self.direction(self.turns[at / rows], self.polar[at % rows])
    }

    /// Returns the unit direction of a longitude and an angle from the pole, radians.
    fn direction(&self, turn: f32, polar: f32) -> Vec3 {
        let [zero, right, pole] = self.pole.frame();
        let across = zero * turn.cos() + right * turn.sin();
        across * polar.sin() + pole * polar.cos()
    }

    /// Returns whether it shines below and above the horizontal.
    #[must_use]
    pub fn halves(&self) -> [bool; 2] {
        const LEVEL: f32 = 1e-4;
        let rows = self.polar.len();
        let mut halves = [false; 2];
        // A web that is the same all around also is at its other end.
        let around = match self.turns.len() {
            1 => vec![0.0, PI],
            _ => self.turns.clone(),
        };
        for (turn, angle) in around.iter().enumerate() {
            for (row, polar) in self.polar.iter().enumerate() {
                let turn = turn.min(self.turns.len() - 1);
                if self.candela[turn * rows + row] > 0.0 {
                    let direction = self.direction(*angle, *polar);
                    halves[0] |= direction.z < -LEVEL;
                    halves[1] |= direction.z > LEVEL;
                }
            }
        }
        halves
    }
}

/// Returns the interval of ascending angles that contains an angle, and the place in it. `None`
/// outside.
#[inline]
fn place(angles: &[f32], angle: f32) -> Option<(usize, f32)> {
    let last = angles.len() - 1;
    if !(angle >= angles[0] - SAME && angle <= angles[last] + SAME) {
        return None;
    }
    let from = angles.partition_point(|&a| a <= angle).saturating_sub(1);
    if from == last {
        return Some((last, 0.0));
    }
    let share = (angle - angles[from]) / (angles[from + 1] - angles[from]);
    Some((from, share.clamp(0.0, 1.0)))
}
