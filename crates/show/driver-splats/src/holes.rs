//! Fills pixels between splats that show what is behind the surface, or nothing.
//!
//! Only small gaps are filled. Larger ones are left to the sky: nothing was seen there.

use rayon::prelude::*;

/// Distance in pixels within which a gap's edge is searched.
const REACH: i64 = 4;

/// Least number of directions, of eight, in which a surface is found around a gap.
const LEAST: usize = 6;

/// Eight directions.
const DIRECTIONS: [(i64, i64); 8] =
    [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];

/// A pixel that was filled.
pub(crate) struct FilledPixel {
    /// Its number.
    pub pixel: usize,
    /// Its radiance.
    pub light: [f32; 3],
    /// Its distance.
    pub depth: f32,
}

/// Returns the pixels of small gaps with the mean of what is around them. `depth` is 0 where no
/// splat is.
pub(crate) fn filled(pixels: &[[f32; 3]], depth: &[f32], size: (usize, usize)) -> Vec<FilledPixel> {
    let gaps = (0..depth.len()).into_par_iter().filter(|&at| depth[at] == 0.0);
    gaps.filter_map(|at| {
        let (x, y) = ((at % size.0) as i64, (at / size.0) as i64);
        let found = DIRECTIONS.iter().filter_map(|(dx, dy)| {
            (1..=REACH).find_map(|step| {
                let (x, y) = (x + dx * step, y + dy * step);
                let inside = (0..size.0 as i64).contains(&x) && (0..size.1 as i64).contains(&y);
                let other = inside.then(|| y as usize * size.0 + x as usize)?;
                (depth[other] > 0.0).then_some((other, 1.0 / step as f32))
            })
        });
        let found: Vec<(usize, f32)> = found.collect();
        if found.len() < LEAST {
            return None;
        }
        let weight: f32 = found.iter().map(|(_, weight)| weight).sum();
        let mean = |value: &dyn Fn(usize) -> f32| {
            found.iter().map(|&(other, weight)| value(other) * weight).sum::<f32>() / weight
        };
        let light = std::array::from_fn(|channel| mean(&|other| pixels[other][channel]));
        Some(FilledPixel { pixel: at, light, depth: mean(&|other| depth[other]) })
    })
    .collect()
}
