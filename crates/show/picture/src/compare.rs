//! Measures of the difference between a picture and a reference, and confidence intervals of the
//! bias.
//!
//! The formulas are those of the reference data's `compare.py`, in f64, with numpy's percentile and
//! median. Luminance is relative here, as in [`relative_luminance`](crate::relative_luminance).

use crate::picture::Picture;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Weights of the channels, as the reference has them: in `f64` they are not those of
/// [`holo_color::WEIGHTS`] to the last bit.
const WEIGHTS: [f64; 3] = [0.2126, 0.7152, 0.0722];

/// Factor of the reference's median above which pixels do not count for the bias, because a lamp in
/// view would hide everything else.
const LAMP: f64 = 20.0;

/// Percentile of the reference's luminance that a display shows as white.
const WHITE: f64 = 95.0;

/// Side, in pixels, of the blocks of [`Measures::worst_block`].
const BLOCK: usize = 16;

/// Half width of a two-sided 99 % interval in standard errors of a normal distribution.
pub const BIAS_Z: f64 = 2.575_829_303_548_901;

/// The reason why two pictures cannot be compared.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CompareError {
    /// The sizes differ.
    #[error("sizes differ: {}x{} against the reference's {}x{}", picture.0, picture.1, reference.0, reference.1)]
    Sizes {
        /// Size of the picture.
        picture: (u32, u32),
        /// Size of the reference.
        reference: (u32, u32),
    },
    /// A picture has no pixels, or not as many as its size says.
    #[error("the {0} has no pixels, or not as many as its size says")]
    Pixels(&'static str),
    /// A pixel is infinite or NaN, so no measure would mean anything.
    #[error("the {which} has no finite value at column {column}, row {row} (from the top)")]
    NotFinite {
        /// The picture concerned.
        which: &'static str,
        /// Column, from 0.
        column: u32,
        /// Row from the top, from 0.
        row: u32,
    },
    /// A standard error is negative.
    #[error("the {which} is negative at column {column}, row {row} (from the top)")]
    NegativeError {
        /// The picture concerned.
        which: &'static str,
        /// Column, from 0.
        column: u32,
        /// Row from the top, from 0.
        row: u32,
    },
}

/// The measures of a picture against a reference. All are 0 (and `psnr_disp` is 120) for equal
/// pictures.
///
/// A measure that does not exist (such as a bias against black) is NaN, which JSON writes as
/// `null`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// Mean of (a-r)²/(r² + 0.01·mean(r)²) over pixels and channels, where each term is at most
    /// 10⁴.
    pub relmse: f64,
    /// The same without that limit, and without the worst 0.1 % of pixels. Elsewhere in this
    /// project, relMSE means this measure.
    pub relmse_trim: f64,
    /// Root mean square of the difference of log₁₀ luminance.
    pub log_rmse: f64,
    /// PSNR in dB of the picture as displayed: clipped at the reference's 95th percentile, gamma
    /// 2.2.
    pub psnr_disp: f64,
    /// Relative error of the mean luminance over pixels no brighter than 20 × the reference's
    /// median.
    pub bias: f64,
    /// Relative error of the mean luminance over all pixels.
    pub bias_all: f64,
    /// Largest relative error of the mean luminance of a 16×16 block of lit pixels.
    pub worst_block: f64,
    /// Share of pixels whose error exceeds 0.1 decades.
    pub bad: f64,
}

/// Prints the measures as `compare.py` does: `relmse=0.0123 … bad=0.4`, five significant digits.
impl fmt::Display for Measures {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Measures { relmse, relmse_trim, log_rmse, psnr_disp, bias, bias_all, worst_block, bad } =
            *self;
        let named = [
            ("relmse", relmse),
            ("relmse_trim", relmse_trim),
            ("log_rmse", log_rmse),
            ("psnr_disp", psnr_disp),
            ("bias", bias),
            ("bias_all", bias_all),
            ("worst_block", worst_block),
            ("bad", bad),
        ];
        for (index, (name, value)) in named.into_iter().enumerate() {
            let gap = if index == 0 { "" } else { " " };
            write!(f, "{gap}{name}={}", general(value))?;
        }
        Ok(())
    }
}

/// Returns the measures of `picture` against `reference`.
///
/// # Errors
/// Sizes that differ, or pixels that are not finite.
pub fn compare(picture: &Picture, reference: &Picture) -> Result<Measures, CompareError> {
    check(picture, "picture", reference)?;
    check(reference, "reference", reference)?;
    let (la, lr) = (luminances(picture), luminances(reference));
    let pixels = lr.len();
    let mean_rgb = mean(reference.pixels.as_flattened().iter().map(|value| f64::from(*value)));
    let floor = 1e-2 * mean_rgb * mean_rgb + 1e-12;
    let mut capped = 0.0;
    let mut relative: Vec<f64> = Vec::with_capacity(pixels);
    for (a, r) in picture.pixels.iter().zip(&reference.pixels) {
        let channels = [0, 1, 2].map(|c| {
            let (a, r) = (f64::from(a[c]), f64::from(r[c]));
            (a - r) * (a - r) / (r * r + floor)
        });
        capped += channels.iter().map(|x| x.min(1e4)).sum::<f64>();
        relative.push(channels.iter().sum::<f64>() / 3.0);
    }
    relative.sort_unstable_by(f64::total_cmp);
    let kept = (0.999 * f64::from(reference.height) * f64::from(reference.width)) as usize;

    let epsilon = 1e-3 * mean(lr.iter().copied());
    let logs: Vec<f64> =
        la.iter().zip(&lr).map(|(a, r)| (a + epsilon).log10() - (r + epsilon).log10()).collect();

    let mut sorted = lr.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let dim = dim_pixels(&lr, &sorted);
    let white = percentile(&sorted, WHITE) + 1e-9;
    let shown = |value: f32| (f64::from(value) / white).clamp(0.0, 1.0).powf(1.0 / 2.2);
    // Each channel is clipped at the percentile of the luminance, as in compare.py.
    let both = picture.pixels.as_flattened().iter().zip(reference.pixels.as_flattened());
    let display = mean(both.map(|(a, r)| (shown(*a) - shown(*r)).powi(2)));

    Ok(Measures {
        relmse: capped / (3 * pixels) as f64,
        relmse_trim: mean(relative[..kept].iter().copied()),
        log_rmse: mean(logs.iter().map(|x| x * x)).sqrt(),
        psnr_disp: -10.0 * (display + 1e-12).log10(),
        bias: masked_mean(&la, &dim) / masked_mean(&lr, &dim) - 1.0,
        bias_all: mean(la.iter().copied()) / mean(lr.iter().copied()) - 1.0,
        worst_block: worst_block(&la, &lr, &dim, reference.width as usize),
        bad: mean(logs.iter().map(|x| f64::from(u8::from(x.abs() > 0.1)))),
    })
}

/// Returns the bias of `picture` as in [`Measures::bias`], and the half width of its 99 %
/// confidence interval.
///
/// `picture_error` and `reference_error` hold the standard error of every pixel and channel; `None`
/// means exact. Pixels are assumed to be independent, as those of a path tracer are. The channels
/// of a pixel are assumed to be fully correlated, which makes the interval widest. The error of a
/// luminance is then the weighted *sum* of the channels' errors. The interval is that of the
/// linearised ratio, which is accurate if the reference's mean is known to a few per cent.
///
/// # Errors
/// As [`compare()`], or if standard errors are negative or have another size.
pub fn bias_interval(
    picture: &Picture,
    picture_error: Option<&Picture>,
    reference: &Picture,
    reference_error: Option<&Picture>,
) -> Result<(f64, f64), CompareError> {
    let LuminancePair { picture: la, reference: lr, dim } = LuminancePair::of(picture, reference)?;
    let (mean_a, mean_r) = (masked_mean(&la, &dim), masked_mean(&lr, &dim));
    let of_mean = |error: Option<&Picture>, which: &'static str| -> Result<f64, CompareError> {
        let squares = variances(error, which, reference)?;
        let sum: f64 =
            squares.iter().zip(&dim).filter(|(_, dim)| **dim).map(|(square, _)| square).sum();
        let count = dim.iter().filter(|dim| **dim).count() as f64;
        Ok(sum / (count * count))
    };
    let ratio = mean_a / mean_r;
    let of_picture = of_mean(picture_error, "picture's standard error")?;
    let of_reference = of_mean(reference_error, "reference's standard error")?;
    let deviation = (of_picture + ratio * ratio * of_reference).sqrt() / mean_r;
    Ok((ratio - 1.0, BIAS_Z * deviation))
}

/// Returns [`Measures::worst_block`] without noise. The variance that the standard errors explain
/// is subtracted from each block's squared relative error. The result is the root of the largest
/// difference; 0 if noise explains everything.
///
/// A block whose noise is as large as the error in question may still be the worst by chance. Use
/// enough paths for small noise.
///
/// # Errors
/// As [`bias_interval`].
pub fn worst_block_beyond_noise(
    picture: &Picture,
    picture_error: Option<&Picture>,
    reference: &Picture,
    reference_error: Option<&Picture>,
) -> Result<f64, CompareError> {
    let LuminancePair { picture: la, reference: lr, dim } = LuminancePair::of(picture, reference)?;
    let of_picture = variances(picture_error, "picture's standard error", reference)?;
    let of_reference = variances(reference_error, "reference's standard error", reference)?;
    let beyond = |block: Vec<usize>| {
        let sum = |values: &[f64]| block.iter().map(|&at| values[at]).sum::<f64>();
        let (a, r) = (sum(&la), sum(&lr));
        let ratio = a / r;
        (ratio - 1.0).powi(2) - (sum(&of_picture) + ratio * ratio * sum(&of_reference)) / (r * r)
    };
    Ok(lit_blocks(&lr, &dim, reference.width as usize).map(beyond).fold(0.0, f64::max).sqrt())
}

/// Returns the largest relative difference between displayed 16×16 blocks of lit pixels. It
/// measures flicker between two pictures of a view.
///
/// Before the mean of a block, everything above the reference's 95th percentile becomes white, as
/// in [`Measures::psnr_disp`]. So a pixel at a lamp's edge that shows more of the lamp counts at
/// most as white.
///
/// # Errors
/// As [`compare()`].
pub fn worst_block_shown(picture: &Picture, reference: &Picture) -> Result<f64, CompareError> {
    let ([la], lr) = displayed([(picture, "picture")], reference)?;
    Ok(worst_block(&la, &lr, &vec![true; lr.len()], reference.width as usize))
}

/// Returns the largest growth of the relative error of a displayed 16×16 block, from the picture
/// `before` to `picture`; 0 if no error grows. Blocks are displayed as in [`worst_block_shown`].
///
/// A view at rest that approaches the reference does not flicker, however much it changes.
///
/// # Errors
/// As [`compare()`].
pub fn worst_block_away(
    picture: &Picture,
    before: &Picture,
    reference: &Picture,
) -> Result<f64, CompareError> {
    let ([la, lb], lr) = displayed([(picture, "picture"), (before, "picture before")], reference)?;
    let away = |block: Vec<usize>| {
        let sum = |values: &[f64]| block.iter().map(|&at| values[at]).sum::<f64>();
        let (a, b, r) = (sum(&la), sum(&lb), sum(&lr));
        (a / r - 1.0).abs() - (b / r - 1.0).abs()
    };
    let all = vec![true; lr.len()];
    Ok(lit_blocks(&lr, &all, reference.width as usize).map(away).fold(0.0, f64::max))
}

/// Returns the luminances of pictures and of their reference as displayed: everything above the
/// reference's 95th percentile is white. The names of the pictures are for errors.
fn displayed<const N: usize>(
    pictures: [(&Picture, &'static str); N],
    reference: &Picture,
) -> Result<([Vec<f64>; N], Vec<f64>), CompareError> {
    for (picture, which) in pictures {
        check(picture, which, reference)?;
    }
    check(reference, "reference", reference)?;
    let mut sorted = luminances(reference);
    sorted.sort_unstable_by(f64::total_cmp);
    let white = percentile(&sorted, WHITE);
    let displayed =
        |picture| luminances(picture).into_iter().map(|value| value.min(white)).collect();
    Ok((pictures.map(|(picture, _)| displayed(picture)), displayed(reference)))
}

/// Luminances of two pictures, and the pixels of the reference that are not lamps.
struct LuminancePair {
    picture: Vec<f64>,
    reference: Vec<f64>,
    dim: Vec<bool>,
}

impl LuminancePair {
    fn of(picture: &Picture, reference: &Picture) -> Result<Self, CompareError> {
        check(picture, "picture", reference)?;
        check(reference, "reference", reference)?;
        let [picture, reference] = [picture, reference].map(luminances);
        let mut sorted = reference.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        let dim = dim_pixels(&reference, &sorted);
        Ok(Self { picture, reference, dim })
    }
}

/// Returns the squared standard errors of luminances; zeros without standard errors.
fn variances(
    error: Option<&Picture>,
    which: &'static str,
    reference: &Picture,
) -> Result<Vec<f64>, CompareError> {
    let Some(error) = error else { return Ok(vec![0.0; reference.pixels.len()]) };
    check(error, which, reference)?;
    if let Some(at) = error.pixels.iter().position(|rgb| rgb.iter().any(|value| *value < 0.0)) {
        let (column, row) = place(error, at);
        return Err(CompareError::NegativeError { which, column, row });
    }
    Ok(luminances(error).iter().map(|e| e * e).collect())
}

fn check(picture: &Picture, which: &'static str, reference: &Picture) -> Result<(), CompareError> {
    if picture.pixels.is_empty()
        || picture.pixels.len() != picture.width as usize * picture.height as usize
    {
        return Err(CompareError::Pixels(which));
    }
    if picture.size() != reference.size() {
        return Err(CompareError::Sizes { picture: picture.size(), reference: reference.size() });
    }
    match picture.pixels.iter().position(|rgb| !rgb.iter().all(|value| value.is_finite())) {
        Some(at) => {
            let (column, row) = place(picture, at);
            Err(CompareError::NotFinite { which, column, row })
        }
        None => Ok(()),
    }
}

fn place(picture: &Picture, at: usize) -> (u32, u32) {
    ((at % picture.width as usize) as u32, (at / picture.width as usize) as u32)
}

fn luminances(picture: &Picture) -> Vec<f64> {
    let weighted = |rgb: &[f32; 3]| (0..3).map(|c| f64::from(rgb[c]) * WEIGHTS[c]).sum();
    picture.pixels.iter().map(weighted).collect()
}

/// Returns which pixels of the reference are not lamps.
fn dim_pixels(lr: &[f64], sorted: &[f64]) -> Vec<bool> {
    let limit = LAMP * percentile(sorted, 50.0).max(1e-12);
    lr.iter().map(|l| *l <= limit).collect()
}

/// Returns the mean; NaN without values, as in numpy.
fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0u64), |(sum, count), value| (sum + value, count + 1));
    sum / count as f64
}

fn masked_mean(values: &[f64], mask: &[bool]) -> f64 {
    mean(values.iter().zip(mask).filter(|(_, kept)| **kept).map(|(value, _)| *value))
}

/// Returns numpy's default percentile: linear between the two nearest ranks. The 50th is the
/// median. NaN without values.
fn percentile(sorted: &[f64], percent: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else { return f64::NAN };
    let rank = percent / 100.0 * last as f64;
    let below = (rank as usize).min(last);
    let (low, high) = (sorted[below], sorted[(below + 1).min(last)]);
    low + (high - low) * (rank - below as f64)
}

fn worst_block(la: &[f64], lr: &[f64], dim: &[bool], width: usize) -> f64 {
    let error = |block: Vec<usize>| {
        let sum = |values: &[f64]| block.iter().map(|&at| values[at]).sum::<f64>();
        (sum(la) / sum(lr) - 1.0).abs()
    };
    lit_blocks(lr, dim, width).map(error).fold(0.0, f64::max)
}

/// Returns, for each lit block, its pixels that are not lamps. A lit block is whole, and at least
/// half of its pixels are without lamps. Their mean in the reference is above 5 % of the picture's.
fn lit_blocks(lr: &[f64], dim: &[bool], width: usize) -> impl Iterator<Item = Vec<usize>> {
    let floor = 0.05 * masked_mean(lr, dim);
    let height = lr.len() / width;
    let corners = move |size: usize| (0..(size + 1).saturating_sub(BLOCK)).step_by(BLOCK);
    corners(height).flat_map(move |top| corners(width).map(move |left| (top, left))).filter_map(
        move |(top, left)| {
            let rows =
                (top..top + BLOCK).flat_map(|row| row * width + left..row * width + left + BLOCK);
            let block: Vec<usize> = rows.filter(|&at| dim[at]).collect();
            let sum: f64 = block.iter().map(|&at| lr[at]).sum();
            (block.len() >= BLOCK * BLOCK / 2 && sum / block.len() as f64 > floor).then_some(block)
        },
    )
}

/// Formats like C's `%.5g`.
fn general(value: f64) -> String {
    if !value.is_finite() {
        return if value.is_nan() {
            "nan"
        } else if value > 0.0 {
            "inf"
        } else {
            "-inf"
        }
        .to_owned();
    }
    let scientific = format!("{value:.4e}");
    let Some((mantissa, exponent)) = scientific.split_once('e') else { return scientific };
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let trimmed = |text: &str| {
        if text.contains('.') {
            text.trim_end_matches('0').trim_end_matches('.').to_owned()
        } else {
            text.to_owned()
        }
    };
    if (-4..5).contains(&exponent) {
        trimmed(&format!("{value:.*}", (4 - exponent) as usize))
    } else {
        let sign = if exponent < 0 { '-' } else { '+' };
        format!("{}e{sign}{:02}", trimmed(mantissa), exponent.abs())
    }
}
