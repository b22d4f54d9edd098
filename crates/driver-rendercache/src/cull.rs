//! Depth cull (Walter et al. 1999, §3.1): removes points that show through gaps of a nearer surface.
//!
//! Always true: a sample of this very view stays, since its ray was seen to reach it; whether a point stays depends on what was
//! there before any was removed.

use super::colour;
use holo_cpu::Kernel;

/// Pixels looked at together: colours are touched only where one of them has to go.
const PIECE: usize = 64;

/// Culls rows `from..` of a band as many as `colour` has.
pub(super) struct Cull<'a> {
    pub width: usize,
    pub from: usize,
    pub colour: &'a mut [u32],
    /// Of the whole band; what is beyond it is taken for empty.
    pub depth: &'a [u32],
    pub threshold: f32,
    pub scratch: &'a mut Scratch,
}

/// Rows of sums, to be used again.
#[derive(Debug)]
pub(super) struct Scratch {
    nothing: Vec<u32>,
    /// One column more at both ends, always 0.
    sums: Vec<f32>,
    counts: Vec<f32>,
}

impl Scratch {
    pub fn new(width: usize) -> Self {
        Self { nothing: vec![0; width], sums: vec![0.0; width + 2], counts: vec![0.0; width + 2] }
    }
}

impl Kernel for Cull<'_> {
    type Output = ();

    #[inline(always)]
    fn run(self) {
        let Self {
            width,
            from,
            colour,
            depth,
            threshold,
            scratch: Scratch { nothing, sums, counts },
        } = self;
        let row = |y: usize| depth.get(y.wrapping_mul(width)..).and_then(|rest| rest.get(..width));
        for (y, colour) in (from..).zip(colour.chunks_exact_mut(width)) {
            let rows =
                [y.wrapping_sub(1), y, y + 1].map(|y| if y == usize::MAX { None } else { row(y) });
            let [above, here, below] = rows.map(|row| row.unwrap_or(nothing));
            add_three(above, here, below, &mut sums[1..=width], &mut counts[1..=width]);
            cull_row(here, sums, counts, 1.0 + threshold, colour);
        }
    }
}

/// Sums of depths and numbers of points of three rows.
#[inline(always)]
fn add_three(above: &[u32], here: &[u32], below: &[u32], sums: &mut [f32], counts: &mut [f32]) {
    let depth = |bits: u32| f32::from_bits(bits & i32::MAX as u32);
    let one = |bits: u32| if bits != 0 { 1.0 } else { 0.0 };
    for ((((&a, &b), &c), sum), count) in above.iter().zip(here).zip(below).zip(sums).zip(counts) {
        *sum = depth(a) + depth(b) + depth(c);
        *count = one(a) + one(b) + one(c);
    }
}

#[inline(always)]
fn cull_row(depth: &[u32], sums: &[f32], counts: &[f32], factor: f32, colour: &mut [u32]) {
    let mut kept = [0; PIECE];
    for (piece, colour) in colour.chunks_mut(PIECE).enumerate() {
        let start = piece * PIECE;
        let (depth, sums, counts) = (&depth[start..], &sums[start..], &counts[start..]);
        if colour.len() == PIECE {
            // Of known length: no remainders.
            if !keep(depth, sums, counts, factor, &mut kept[..PIECE]) {
                remove(&kept[..PIECE], &mut colour[..PIECE]);
            }
        } else {
            let kept = &mut kept[..colour.len()];
            keep(depth, sums, counts, factor, kept);
            remove(kept, colour);
        }
    }
}

/// All ones for points that stay, else 0; whether all stay.
#[inline(always)]
fn keep(depth: &[u32], sums: &[f32], counts: &[f32], factor: f32, kept: &mut [u32]) -> bool {
    let width = kept.len();
    let (depth, s0, s1, s2) =
        (&depth[..width], &sums[..width], &sums[1..][..width], &sums[2..][..width]);
    let (c0, c1, c2) = (&counts[..width], &counts[1..][..width], &counts[2..][..width]);
    for x in 0..width {
        let sum = s0[x] + s1[x] + s2[x];
        let count = c0[x] + c1[x] + c2[x];
        // The sign says that the point is old.
        let is_deep = f32::from_bits(depth[x] & i32::MAX as u32) * count > factor * sum;
        let is_old = (depth[x] as i32) < 0;
        kept[x] = if is_deep & is_old { 0 } else { u32::MAX };
    }
    // A loop of its own: in the one above it kept all of it from becoming instructions for many pixels.
    kept.iter().fold(u32::MAX, |all, kept| all & kept) == u32::MAX
}

#[inline(always)]
fn remove(kept: &[u32], colour: &mut [u32]) {
    for (colour, kept) in colour.iter_mut().zip(kept) {
        *colour &= kept;
    }
}

// Removed points have no colour.
const _: () = assert!(colour::NONE == 0);
