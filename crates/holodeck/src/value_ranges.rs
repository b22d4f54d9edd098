//! The ranges of values, of options and of the configuration alike.

/// Returns the radiance if it is one.
///
/// # Errors
/// The reason why it is none, for people.
pub fn check_sky(radiance: [f32; 3]) -> Result<[f32; 3], String> {
    let is_plausible = radiance.iter().all(|channel| channel.is_finite() && *channel >= 0.0);
    is_plausible
        .then_some(radiance)
        .ok_or_else(|| "radiance cannot be negative or infinite".to_owned())
}
