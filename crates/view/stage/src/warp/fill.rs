//! Fills the gaps of a projected frame from the farther of the surfaces around them, in all
//! directions.
//!
//! Gaps appear where a near surface has moved away from a farther one, and beyond the edge of all
//! earlier frames. A pyramid of ever coarser pictures has the mean of the farthest known surface of
//! each square. A gap takes the finest picture that knows something there, so narrow gaps show what
//! is beside them, and wide ones become soft (pull-push: Gortler et al., "The Lumigraph", 1996,
//! section 3.4.3).

/// Pixels belong to one surface if their inverse depths differ by less than this factor.
const SAME: f32 = 0.95;

/// Stands for an unknown texel.
const UNKNOWN: Texel = Texel { colour: [0.0; 3], nearness: -1.0 };

/// The mean of a square's farthest surface.
#[derive(Clone, Copy, Debug)]
struct Texel {
    colour: [f32; 3],
    /// The inverse of the depth: 0 for the sky, less if nothing is known.
    nearness: f32,
}

/// A picture of texels.
struct FillLevel {
    width: usize,
    height: usize,
    texels: Vec<Texel>,
}

/// Fills the pixels that are gaps. Pixels with a depth of 0 or less have no known light: they stay,
/// and fill no gap. Returns false if no pixel is known.
pub(super) fn fill(
    pixels: &mut [[f32; 3]],
    depths: &mut [f32],
    (width, height): (u32, u32),
    is_gap: impl Fn(usize) -> bool,
) -> bool {
    let (width, height) = (width as usize, height as usize);
    let texel = |pixel: usize| match depths[pixel] > 0.0 && !is_gap(pixel) {
        true => Texel { colour: pixels[pixel], nearness: depths[pixel].recip() },
        false => UNKNOWN,
    };
    let mut levels = vec![FillLevel::pulled(width, height, |x, y| texel(y * width + x))];
    while let Some(last) = levels.last().filter(|last| last.width > 1 || last.height > 1) {
        let next =
            FillLevel::pulled(last.width, last.height, |x, y| last.texels[y * last.width + x]);
        levels.push(next);
    }
    if levels.last().is_none_or(|last| last.texels[0].nearness < 0.0) {
        // Nothing is known. Unknown pixels of an earlier frame still count as a frame.
        return (0..pixels.len()).any(|pixel| !is_gap(pixel));
    }
    for at in (1..levels.len()).rev() {
        let (finer, coarser) = levels.split_at_mut(at);
        if let (Some(finer), Some(coarser)) = (finer.last_mut(), coarser.first()) {
            finer.push_from(coarser);
        }
    }
    for pixel in (0..pixels.len()).filter(|&pixel| is_gap(pixel)) {
        let texel = levels[0].between(pixel % width, pixel / width);
        (pixels[pixel], depths[pixel]) = (texel.colour, texel.nearness.recip());
    }
    true
}

impl FillLevel {
    /// Returns the next coarser picture of one of this width and height.
    fn pulled(width: usize, height: usize, texel: impl Fn(usize, usize) -> Texel) -> FillLevel {
        let (own_width, own_height) = (width.div_ceil(2), height.div_ceil(2));
        let mut texels = Vec::with_capacity(own_width * own_height);
        for y in 0..own_height {
            for x in 0..own_width {
                let (right, below) = ((2 * x + 1).min(width - 1), (2 * y + 1).min(height - 1));
                let four = [(2 * x, 2 * y), (right, 2 * y), (2 * x, below), (right, below)];
                texels.push(farthest(four.map(|(x, y)| (texel(x, y), 1.0))));
            }
        }
        FillLevel { width: own_width, height: own_height, texels }
    }

    /// Fills unknown texels from a coarser level whose texels are all known.
    fn push_from(&mut self, coarser: &FillLevel) {
        for at in 0..self.texels.len() {
            if self.texels[at].nearness < 0.0 {
                self.texels[at] = coarser.between(at % self.width, at / self.width);
            }
        }
    }

    /// Returns what this level shows at a texel of the next finer one: the farthest of the four
    /// surfaces around, by their distances.
    fn between(&self, x: usize, y: usize) -> Texel {
        let beside = |at: usize, most: usize| {
            let other = if at.is_multiple_of(2) { (at / 2).wrapping_sub(1) } else { at / 2 + 1 };
            (at / 2, if other < most { other } else { at / 2 })
        };
        let ((x, other_x), (y, other_y)) = (beside(x, self.width), beside(y, self.height));
        let four = [(x, y, 9.0), (other_x, y, 3.0), (x, other_y, 3.0), (other_x, other_y, 1.0)];
        farthest(four.map(|(x, y, weight)| (self.texels[y * self.width + x], weight)))
    }
}

/// Returns the mean of the farthest surface among four weighted texels.
fn farthest(four: [(Texel, f32); 4]) -> Texel {
    let known = four.iter().map(|(texel, _)| texel.nearness).filter(|nearness| *nearness >= 0.0);
    let least = known.fold(f32::INFINITY, f32::min);
    if least == f32::INFINITY {
        return UNKNOWN;
    }
    let (mut mean, mut sum) = (Texel { nearness: 0.0, ..UNKNOWN }, 0.0);
    for (texel, weight) in four {
        if texel.nearness >= 0.0 && texel.nearness * SAME <= least {
            (0..3).for_each(|c| mean.colour[c] += weight * texel.colour[c]);
            mean.nearness += weight * texel.nearness;
            sum += weight;
        }
    }
    mean.colour.iter_mut().for_each(|c| *c /= sum);
    mean.nearness /= sum;
    mean
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: (u32, u32) = (13, 9);
    const PIXELS: usize = 117;

    /// Fills a picture whose pixels are of this colour and depth, except gaps.
    fn filled(of: impl Fn(usize, usize) -> Option<(f32, f32)>) -> Option<(Vec<f32>, Vec<f32>)> {
        let all: Vec<_> = (0..PIXELS).map(|pixel| of(pixel % 13, pixel / 13)).collect();
        let mut pixels: Vec<_> = all.iter().map(|at| [at.map_or(0.0, |at| at.0); 3]).collect();
        let mut depths: Vec<_> = all.iter().map(|at| at.map_or(0.0, |at| at.1)).collect();
        let has = fill(&mut pixels, &mut depths, SIZE, |pixel| all[pixel].is_none());
        has.then(|| (pixels.iter().map(|pixel| pixel[0]).collect(), depths))
    }

    #[test]
    fn a_gap_between_two_surfaces_shows_the_farther_one_on_every_side() {
        for is_turned in [false, true] {
            let of = |x: usize, y: usize| match if is_turned { y } else { x } {
                0..3 => Some((9.0, 1.0)),
                3..6 => None,
                _ => Some((2.0, 5.0)),
            };
            let (colours, depths) = filled(of).unwrap();
            for pixel in 0..PIXELS {
                let near = of(pixel % 13, pixel / 13) == Some((9.0, 1.0));
                let wanted = if near { (9.0, 1.0) } else { (2.0, 5.0) };
                assert!((colours[pixel] - wanted.0).abs() < 1e-4, "{is_turned} {pixel}");
                assert!((depths[pixel] - wanted.1).abs() < 1e-3, "{is_turned} {pixel}");
            }
        }
    }

    #[test]
    fn the_sky_fills_gaps_and_unknown_light_fills_none() {
        let (colours, depths) = filled(|x, _| {
            (x != 5).then_some(if x < 5 { (1.0, f32::INFINITY) } else { (0.0, 0.0) })
        })
        .unwrap();
        assert_eq!((colours[5], depths[5]), (1.0, f32::INFINITY));
        assert_eq!((colours[6], depths[6]), (0.0, 0.0));
        assert!(filled(|_, _| None).is_none());
        assert!(filled(|_, _| Some((0.0, 0.0))).is_some());
    }

    #[test]
    fn a_single_known_pixel_fills_all() {
        let (colours, _) = filled(|x, y| (x == 3 && y == 7).then_some((4.0, 2.0))).unwrap();
        assert!(colours.iter().all(|colour| (colour - 4.0).abs() < 1e-5));
    }
}
