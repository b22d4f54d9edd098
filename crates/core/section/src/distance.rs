//! Distance codes: 16 bits, linear up to the section's diagonal, then logarithmic (Larson & Simmons
//! 1999, §2.1).
//!
//! Invariant: encoding is monotone, and every code decodes to a distance that encodes to it.

/// The code for a ray that hits nothing.
pub const NOTHING_HIT: u16 = u16::MAX;

/// Number of codes of the linear range, which ends at the diagonal. The logarithmic step is 1 plus
/// its reciprocal.
pub const LINEAR_CODES: f64 = 2048.0;

/// ln(1 + 2⁻¹¹).
const LN_STEP: f64 = 4.881_620_795_013_511_5e-4;

/// Returns the distance code for `distance` along a ray (Larson & Simmons 1999, §2.1, Table 1).
///
/// `distance` counts from the entry point, `diagonal` is the section's; both are in world units.
/// Codes are linear below the diagonal, then logarithmic with step 1 + 2⁻¹¹. Above the diagonal the
/// relative error is at most 2.5e-4.
///
/// Infinity and NaN give [`NOTHING_HIT`]. Finite distances beyond about 2.88e13 diagonals give the
/// last code before it, negative ones give 0.
pub fn encode(distance: f64, diagonal: f64) -> u16 {
    let diagonals = distance / diagonal;
    if distance.is_nan() || distance == f64::INFINITY {
        NOTHING_HIT
    } else if diagonals < 1.0 {
        // The conversion saturates: negative distances become 0.
        (diagonals * LINEAR_CODES) as u16
    } else {
        (LINEAR_CODES + diagonals.ln() / LN_STEP).min(65534.0) as u16
    }
}

/// Returns the middle of the code's step, in world units; infinity for [`NOTHING_HIT`].
pub fn decode(code: u16, diagonal: f64) -> f64 {
    let code_value = f64::from(code);
    if code == NOTHING_HIT {
        f64::INFINITY
    } else if code_value < LINEAR_CODES {
        diagonal * (code_value + 0.5) / LINEAR_CODES
    } else {
        diagonal * (1.0 + 0.5 / LINEAR_CODES) * ((code_value - LINEAR_CODES) * LN_STEP).exp()
    }
}
