//! Numbers to whole numbers in loops.

/// The whole part of `number` if it is in [0, `limit`), else 0; `limit` must be at most 2³¹ (more is taken for it).
///
/// `as i32` alone would do, but it also says what becomes of NaN and infinities, and compilers then convert one number after another.
#[inline(always)]
#[allow(unsafe_code)]
pub(super) fn truncate(number: f32, limit: f32) -> i32 {
    const MOST: f32 = 2_147_483_648.0;
    let within = if (number >= 0.0) & (number < limit) & (number < MOST) { number } else { 0.0 };
    // SAFETY: `within` is finite and its whole part is in 0..2³¹.
    unsafe { within.to_int_unchecked() }
}
