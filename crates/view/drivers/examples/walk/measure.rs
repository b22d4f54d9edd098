//! Truths of frames, similarity to them, and strips of pictures to look at.

use crate::tracing::Engine;
use holo_picture::{Exposure, Look, Picture, View, auto_exposure, compare};
use std::error::Error;
use std::path::Path;

/// Relative error that a truth may have, as a squared error.
const TRUTH_ERROR: f64 = 0.005;
/// Paths per pixel that half of a truth gains in one step.
const TRUTH_PATHS: u32 = 16;
/// Side of the windows that are compared, pixels. Windows lie half a side apart.
const WINDOW: usize = 8;

/// Returns the true picture of a view; reads it from `file` if that exists. Two halves are traced
/// until their difference shows a small error, or the truth has `most` paths per pixel.
pub fn truth(
    engine: &Engine,
    view: &View,
    file: &Path,
    most: u32,
) -> Result<Picture, Box<dyn Error>> {
    if file.exists() {
        return Ok(Picture::read(file)?);
    }
    let mut halves = [0, 1].map(|_| Picture::new(crate::SIZE.0, crate::SIZE.1));
    let mut paths = 0;
    loop {
        for (seed, half) in (1..).zip(&mut halves) {
            engine.add_picture(view, half, paths, paths + TRUTH_PATHS, seed);
        }
        paths += TRUTH_PATHS;
        let measures = compare(&halves[0], &halves[1])?;
        // Squared, the halves differ by twice the error of one half, and their mean has half of
        // that error.
        if measures.relmse_trim / 4.0 < TRUTH_ERROR || 2 * paths >= most {
            eprintln!(
                "{}: {} paths, relMSE {:.4}",
                file.display(),
                2 * paths,
                measures.relmse_trim / 4.0
            );
            break;
        }
    }
    let [mut mean, other] = halves;
    for (pixel, other) in mean.pixels.iter_mut().zip(&other.pixels) {
        *pixel = [0, 1, 2].map(|channel| 0.5 * (pixel[channel] + other[channel]));
    }
    mean.write(file)?;
    Ok(mean)
}

/// Returns the PSNR of [`compare`], and the structural similarity (Wang, Bovik, Sheikh & Simoncelli
/// 2004) of displayed luminance.
pub fn likeness(picture: &Picture, truth: &Picture) -> Result<(f64, f64), Box<dyn Error>> {
    let psnr = compare(picture, truth)?.psnr_disp;
    let exposure = Exposure::Factor(auto_exposure(truth));
    let shown = Look { exposure, ..Look::default() };
    let grey = |picture: &Picture| -> Vec<f64> {
        let bytes = shown.show(picture).rgb;
        let weights = [0.2126, 0.7152, 0.0722];
        bytes
            .chunks_exact(3)
            .map(|rgb| (0..3).map(|i| weights[i] * f64::from(rgb[i]) / 255.0).sum())
            .collect()
    };
    let (a, b) = (grey(picture), grey(truth));
    let (width, height) = (truth.size().0 as usize, truth.size().1 as usize);
    let (mut sum, mut windows) = (0.0, 0.0);
    for top in (0..=height - WINDOW).step_by(WINDOW / 2) {
        for left in (0..=width - WINDOW).step_by(WINDOW / 2) {
            let [mut ma, mut mb, mut aa, mut bb, mut ab] = [0.0; 5];
            for row in top..top + WINDOW {
                for index in row * width + left..row * width + left + WINDOW {
                    let (a, b) = (a[index], b[index]);
                    (ma, mb, aa, bb, ab) = (ma + a, mb + b, aa + a * a, bb + b * b, ab + a * b);
                }
            }
            let n = (WINDOW * WINDOW) as f64;
            let (ma, mb) = (ma / n, mb / n);
            let (va, vb, cov) = (aa / n - ma * ma, bb / n - mb * mb, ab / n - ma * mb);
            let (c1, c2) = (0.01 * 0.01, 0.03 * 0.03);
            sum += (2.0 * ma * mb + c1) * (2.0 * cov + c2)
                / ((ma * ma + mb * mb + c1) * (va + vb + c2));
            windows += 1.0;
        }
    }
    Ok((psnr, sum / windows))
}

/// Writes pictures at half size into one PNG, a row for each list, with the exposures of the first
/// row.
pub fn strip(rows: &[Vec<Picture>], file: &Path) -> Result<(), Box<dyn Error>> {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let (width, height) = (crate::SIZE.0 / 2, crate::SIZE.1 / 2);
    let mut whole = Picture::new(width * columns as u32, height * rows.len() as u32);
    let across = whole.size().0 as usize;
    for (number, row) in rows.iter().enumerate() {
        for (place, picture) in row.iter().enumerate() {
            // Each column is scaled by the truth's exposure, so that the PNG's own exposure is near
            // 1.
            let exposure = rows[0].get(place).map_or(1.0, auto_exposure);
            for y in 0..height as usize {
                for x in 0..width as usize {
                    let mut sum = [0.0; 3];
                    for part in 0..4 {
                        let index = (2 * y + part / 2) * crate::SIZE.0 as usize + 2 * x + part % 2;
                        let pixel = picture.pixels[index];
                        (0..3).for_each(|channel| {
                            sum[channel] += 0.25 * (exposure * pixel[channel]).min(1.5)
                        });
                    }
                    whole.pixels
                        [(number * height as usize + y) * across + place * width as usize + x] =
                        sum;
                }
            }
        }
    }
    whole.write(file)?;
    Ok(())
}
