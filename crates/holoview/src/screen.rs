//! From a frame's radiance to the colours of a screen: the one place where front ends say how a
//! frame looks.

use std::sync::LazyLock;

use holo_picture::ToneMap;

use crate::stage::Shown;

/// A person's display settings. None of them needs a new ray.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Display {
    /// The exposure before `stops` are applied.
    pub exposure: Exposure,
    /// Brighter by so many stops, each a factor of 2.
    pub stops: f32,
}

/// The base of an exposure.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Exposure {
    /// The frame: it adapts as an eye does.
    #[default]
    Automatic,
    /// This factor from radiance to linear display values.
    Locked(f32),
}

impl Display {
    /// Returns the factor from radiance to linear display values.
    pub fn factor(&self, shown: &Shown) -> f32 {
        let base = match self.exposure {
            Exposure::Automatic => shown.exposure,
            Exposure::Locked(factor) => factor,
        };
        base * self.stops.exp2()
    }

    /// Returns the frame's sRGB bytes, rows from the top.
    pub fn colours(&self, shown: &Shown) -> Vec<u8> {
        let curve = &*CURVE;
        let factor = self.factor(shown);
        let pixels = shown.frame.picture.pixels.iter();
        pixels.flat_map(|rgb| rgb.map(|radiance| curve.byte(radiance * factor))).collect()
    }
}

/// The tone curve as a table, indexed by the bits of a value. For 1280 × 720 pixels the table takes
/// 4 ms, and a power for each colour 21 ms, as long as a JPEG of them.
struct Curve {
    bytes: Vec<u8>,
}

/// Bits of a value's mantissa that do not count: 12 that count are finer than a byte's steps.
const IGNORED_BITS: u32 = 23 - 12;

/// Least value of the table: less is black.
const LEAST: f32 = 1.0 / (1 << 16) as f32;

/// End of the table. From here on a value is shown as 255.
const MOST: f32 = 64.0;

static CURVE: LazyLock<Curve> = LazyLock::new(|| {
    let tone = ToneMap::with_exposure(1.0);
    let middle = 1 << (IGNORED_BITS - 1);
    let value = |at: u32| f32::from_bits((at << IGNORED_BITS) | middle);
    let range = LEAST.to_bits() >> IGNORED_BITS..MOST.to_bits() >> IGNORED_BITS;
    Curve { bytes: range.map(|at| tone.map([value(at); 3])[0]).collect() }
});

impl Curve {
    fn byte(&self, value: f32) -> u8 {
        if value.is_nan() || value < LEAST {
            return 0;
        }
        let at = (value.to_bits() >> IGNORED_BITS) - (LEAST.to_bits() >> IGNORED_BITS);
        self.bytes.get(at as usize).copied().unwrap_or(255)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_the_tone_curve() {
        let tone = ToneMap::with_exposure(1.0);
        for step in 0..4000 {
            let value = 1e-6 * 1.005_f32.powi(step);
            let (exact, byte) = (tone.map([value; 3])[0], CURVE.byte(value));
            assert!(exact.abs_diff(byte) <= 1, "{value}: {exact}, in the table {byte}");
        }
        assert_eq!([0.0, -1.0, f32::NAN].map(|value| CURVE.byte(value)), [0; 3]);
        assert_eq!([65.0, f32::INFINITY].map(|value| CURVE.byte(value)), [255; 2]);
    }
}
