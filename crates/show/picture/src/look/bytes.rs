//! Display values to the bytes of an sRGB display, by tables.
//!
//! Invariants: bytes are exactly those of the rounded transfer function, and more light never
//! gives a smaller byte. Black and NaN give 0, infinity gives 255.

use std::sync::LazyLock;

/// Display value at which the shoulder begins. Below, display values are proportional to radiance.
/// Above, they bend towards 1, so that a lamp keeps some shape instead of clipping.
const SHOULDER: f64 = 0.6;

/// Bits of a float that do not choose the table's entry. The other 7 bits of the mantissa make
/// entries at most 0.8 % wide, less than the step between any two bytes.
const REST_BITS: u32 = 16;

/// Entries of the table, one for each choice of exponent and 7 mantissa bits.
const ENTRIES: usize = 1 << (31 - REST_BITS);

/// The linear curve: clips at 1.
pub(super) static CLIPPED: LazyLock<Bytes> = LazyLock::new(|| Bytes::new(|shown| shown));

/// The curve with a soft shoulder, which is the identity up to [`SHOULDER`] and then approaches 1
/// exponentially, with slope 1 at first.
pub(super) static SOFT: LazyLock<Bytes> = LazyLock::new(|| {
    Bytes::new(|shown| {
        let rest = 1.0 - SHOULDER;
        if shown <= SHOULDER { shown } else { SHOULDER - rest * ((1.0 - shown) / rest).ln() }
    })
});

/// A monotone curve from display values to bytes.
pub(super) struct Bytes {
    /// The byte of the least float of each entry.
    least: Vec<u8>,
    /// `steps[byte]` is the least value that gives `byte`. No value gives more than 255.
    steps: [f32; 257],
}

impl Bytes {
    /// Makes the table of a curve, from its inverse.
    fn new(inverse: impl Fn(f64) -> f64) -> Bytes {
        let mut steps = [f32::NAN; 257];
        steps[0] = 0.0;
        for (byte, step) in steps.iter_mut().enumerate().take(256).skip(1) {
            *step = inverse(linear((byte as f64 - 0.5) / 255.0)) as f32;
        }
        let mut byte = 0;
        let least = (0..ENTRIES)
            .map(|entry| {
                let value = f32::from_bits((entry as u32) << REST_BITS);
                while byte < 255 && value >= steps[byte + 1] {
                    byte += 1;
                }
                byte as u8
            })
            .collect();
        Bytes { least, steps }
    }

    /// Returns the byte of a display value.
    #[inline]
    pub fn byte(&self, value: f32) -> u8 {
        // Also false for NaN.
        if value > 0.0 {
            let least = self.least[(value.to_bits() >> REST_BITS) as usize];
            least + u8::from(value >= self.steps[usize::from(least) + 1])
        } else {
            0
        }
    }

    /// Returns the bytes of a colour.
    #[inline]
    pub fn color(&self, rgb: [f32; 3]) -> [u8; 3] {
        rgb.map(|value| self.byte(value))
    }
}

/// Returns the display value of an sRGB value from 0 to 1 (IEC 61966-2-1).
pub(super) fn linear(srgb: f64) -> f64 {
    if srgb <= 0.040_45 { srgb / 12.92 } else { ((srgb + 0.055) / 1.055).powf(2.4) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn srgb(x: f64) -> f64 {
        if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
    }

    fn shoulder(x: f64) -> f64 {
        let rest = 1.0 - SHOULDER;
        if x <= SHOULDER { x } else { SHOULDER + rest * (1.0 - ((SHOULDER - x) / rest).exp()) }
    }

    #[test]
    fn bytes_are_those_of_the_transfer_function() {
        for i in 0..200_000 {
            let x = 1e-5 * 1.000_08_f64.powi(i);
            for (table, value) in [(&*CLIPPED, x.min(1.0)), (&*SOFT, shoulder(x))] {
                let exact = 255.0 * srgb(value);
                // Floats at a step may fall on either side.
                if (exact.fract() - 0.5).abs() > 1e-4 {
                    assert_eq!(table.byte(x as f32), exact.round() as u8, "{x}");
                }
            }
        }
    }

    #[test]
    fn an_entry_holds_at_most_one_step() {
        for table in [&*CLIPPED, &*SOFT] {
            assert!(
                table.least.windows(2).all(|pair| pair[0] <= pair[1] && pair[1] - pair[0] <= 1)
            );
        }
    }

    #[test]
    fn no_light_is_black_and_endless_light_is_white() {
        for table in [&*CLIPPED, &*SOFT] {
            assert_eq!(table.color([0.0, f32::NAN, -1.0]), [0; 3]);
            assert_eq!(table.color([f32::INFINITY, f32::MAX, 1e30]), [255; 3]);
            assert_eq!(table.byte(f32::MIN_POSITIVE / 2.0), 0);
        }
    }
}
