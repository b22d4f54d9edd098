//! The meaning of the three channels of a radiance: their primaries and their luminance.
//!
//! Colours of models and samples are those of Rec. 709. Every luminance in the program follows from
//! the weights here.
//!
//! Invariant: radiance with three equal channels has the luminance 179 lm/W times one of them, and
//! stays grey between all primaries.
#![forbid(unsafe_code)]

mod temperature;

pub use temperature::{TEMPERATURES, channels_of, chromaticity_of};

use glam::{DMat3, DVec2, DVec3};

/// Weights of red, green and blue in a luminance, for the primaries [`Primaries::REC709`]. Their
/// sum is 1.
pub const WEIGHTS: [f32; 3] = [0.2126, 0.7152, 0.0722];

/// Luminous efficacy of white light, lumens per watt, as in Radiance.
pub const EFFICACY: f32 = 179.0;

/// Returns the luminance of a radiance in the unit of its channels: 0.2126R + 0.7152G + 0.0722B.
#[inline(always)]
pub fn relative_luminance([red, green, blue]: [f32; 3]) -> f32 {
    WEIGHTS[0] * red + WEIGHTS[1] * green + WEIGHTS[2] * blue
}

/// Returns the luminance in cd/m² of a radiance in W·sr⁻¹·m⁻² per channel.
#[inline]
pub fn luminance(rgb: [f32; 3]) -> f32 {
    EFFICACY * relative_luminance(rgb)
}

/// Chromaticities (CIE 1931 x and y) of three channels and of white.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Primaries {
    /// Red, green and blue.
    pub channels: [[f64; 2]; 3],
    /// The colour of three equal channels.
    pub white: [f64; 2],
}

/// Difference of chromaticities that is rounding.
const SAME: f64 = 2e-3;

/// Least area of the triangle of three primaries for colours to be determined by it.
const LEAST_AREA: f64 = 1e-6;

/// Conversion of XYZ to the responses of the three cones (Bradford).
const CONES: DMat3 = DMat3::from_cols(
    DVec3::new(0.8951, -0.7502, 0.0389),
    DVec3::new(0.2664, 1.7135, -0.0685),
    DVec3::new(-0.1614, 0.0367, 1.0296),
);

impl Primaries {
    /// Rec. 709, with the white of a standard day (D65).
    pub const REC709: Primaries =
        Primaries { channels: [[0.64, 0.33], [0.3, 0.6], [0.15, 0.06]], white: [0.3127, 0.329] };

    /// Makes primaries from eight numbers: x and y of red, green, blue and white. `None` if they
    /// determine no colours.
    pub fn new(numbers: [f64; 8]) -> Option<Primaries> {
        let pair = |at: usize| [numbers[at], numbers[at + 1]];
        let primaries = Primaries { channels: [pair(0), pair(2), pair(4)], white: pair(6) };
        let [red, green, blue] = primaries.channels.map(DVec2::from_array);
        let area = (green - red).perp_dot(blue - red).abs() / 2.0;
        let plain = numbers.iter().all(|x| x.is_finite() && x.abs() <= 4.0);
        let is_sound = plain && area > LEAST_AREA && primaries.white[1] > 0.0;
        is_sound.then_some(primaries)
    }

    /// Returns x and y of red, green, blue and white.
    pub fn numbers(&self) -> [f64; 8] {
        let [[rx, ry], [gx, gy], [bx, by]] = self.channels;
        [rx, ry, gx, gy, bx, by, self.white[0], self.white[1]]
    }

    /// Returns the conversion of these channels to those of [`Primaries::REC709`]. `None` if they
    /// are the same within rounding. White is adapted, so that greys stay the same.
    pub fn to_rec709(&self) -> Option<DMat3> {
        let ours = Primaries::REC709;
        let mut pairs = self.numbers().into_iter().zip(ours.numbers());
        if pairs.all(|(a, b)| (a - b).abs() <= SAME) {
            return None;
        }
        let [here, there] = [self, &ours].map(|primaries| CONES * xyz(primaries.white));
        let adapted = CONES.inverse() * DMat3::from_diagonal(there / here) * CONES;
        let conversion = ours.to_xyz().inverse() * adapted * self.to_xyz();
        conversion.is_finite().then_some(conversion)
    }

    /// Returns the conversion of channels to XYZ. White has Y = 1.
    fn to_xyz(self) -> DMat3 {
        let [red, green, blue] = self.channels.map(|[x, y]| DVec3::new(x, y, 1.0 - x - y));
        let columns = DMat3::from_cols(red, green, blue);
        columns * DMat3::from_diagonal(columns.inverse() * xyz(self.white))
    }
}

/// Returns XYZ of a chromaticity with Y = 1.
fn xyz([x, y]: [f64; 2]) -> DVec3 {
    DVec3::new(x / y, 1.0, (1.0 - x - y) / y)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Radiance's primaries, with the white of equal energy.
    const RADIANCE: [f64; 8] = [0.64, 0.33, 0.29, 0.6, 0.15, 0.06, 1.0 / 3.0, 1.0 / 3.0];

    #[test]
    fn the_weights_are_those_of_the_primaries() {
        let y = Primaries::REC709.to_xyz().row(1).to_array();
        for (weight, y) in WEIGHTS.into_iter().zip(y) {
            assert!((f64::from(weight) - y).abs() < 1e-4, "{weight} {y}");
        }
        assert_eq!(WEIGHTS.iter().sum::<f32>(), 1.0);
        let lamps = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]];
        for (lamp, candela) in lamps.into_iter().zip([38.0554, 128.0208, 12.9238, 179.0]) {
            assert!((luminance(lamp) - candela).abs() < 1e-3, "{lamp:?}");
        }
    }

    #[test]
    fn greys_stay_the_same_between_all_primaries_and_luminances_of_one_white_too() {
        let adobe = [0.64, 0.33, 0.21, 0.71, 0.15, 0.06, 0.3127, 0.329];
        for numbers in [RADIANCE, adobe] {
            let primaries = Primaries::new(numbers).unwrap();
            assert_eq!(primaries.numbers(), numbers);
            let conversion = primaries.to_rec709().unwrap();
            assert!((conversion * DVec3::ONE).distance(DVec3::ONE) < 1e-9, "{numbers:?}");
        }
        // Adobe's red is the red of Rec. 709, stronger; its green lies outside.
        let conversion = Primaries::new(adobe).unwrap().to_rec709().unwrap();
        assert!(conversion.x_axis.distance(DVec3::new(1.3983, 0.0, 0.0)) < 1e-3);
        assert!(conversion.y_axis.x < -0.3);
    }

    #[test]
    fn primaries_that_determine_no_colours_are_refused() {
        assert_eq!(Primaries::new([0.3; 8]), None);
        assert_eq!(Primaries::new([f64::NAN; 8]), None);
        assert_eq!(Primaries::new([0.64, 0.33, 0.3, 0.6, 0.15, 0.06, 0.3, 0.0]), None);
        assert_eq!(Primaries::REC709.to_rec709(), None);
    }
}
