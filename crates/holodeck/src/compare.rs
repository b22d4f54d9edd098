//! The difference between a picture and a reference.

use anyhow::Result;
use holo_picture::Picture;
use serde::Serialize;

/// Pictures of one view that are compared. Exposures are divided out.
#[derive(Clone, Copy)]
pub struct ComparedPictures<'a> {
    /// The picture.
    pub picture: &'a Picture,
    /// The picture that it should be.
    pub reference: &'a Picture,
    /// Standard errors of the picture's pixels.
    pub standard_errors: Option<&'a Picture>,
    /// Standard errors of the reference's pixels.
    pub reference_errors: Option<&'a Picture>,
    /// An earlier picture.
    pub before: Option<&'a Picture>,
}

/// The difference between a picture and a reference.
#[derive(Clone, Debug, Serialize)]
pub struct PictureComparison {
    /// The measures of the whole picture.
    #[serde(flatten)]
    pub measures: holo_picture::Measures,
    /// The worst block's error as displayed, clipped at white.
    pub worst_block_shown: f64,
    /// The largest growth of a block's error as displayed, since the earlier picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_block_away: Option<f64>,
    /// Half the width of the 99 % confidence interval of the bias, if there are standard errors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bias_99: Option<f64>,
    /// The worst block's error beyond its noise, if there are standard errors.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub worst_block_beyond_noise: Option<f64>,
}

/// Measures the difference between a picture and a reference.
///
/// # Errors
/// If the pictures differ in size, or cannot be compared for another reason.
pub fn compare(pictures: &ComparedPictures) -> Result<PictureComparison> {
    let ComparedPictures { picture, reference, before, .. } = *pictures;
    let (se, reference_se) = (pictures.standard_errors, pictures.reference_errors);
    let away = before.map(|before| holo_picture::worst_block_away(picture, before, reference));
    let (bias_99, worst_block_beyond_noise) = match se.or(reference_se) {
        None => (None, None),
        Some(_) => (
            Some(holo_picture::bias_interval(picture, se, reference, reference_se)?.1),
            Some(holo_picture::worst_block_beyond_noise(picture, se, reference, reference_se)?),
        ),
    };
    Ok(PictureComparison {
        measures: holo_picture::compare(picture, reference)?,
        worst_block_shown: holo_picture::worst_block_shown(picture, reference)?,
        worst_block_away: away.transpose()?,
        bias_99,
        worst_block_beyond_noise,
    })
}
