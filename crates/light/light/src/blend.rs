//! The weighted mean of what several records predict at a point.
//!
//! Let f be the irradiance along a surface, and H its second derivative. A record at x - s knows
//! f and its gradient there. With the whole gradient, it predicts f(x) too high by -½ s·H·s, which
//! has one sign wherever the light is concave. Without the gradient, the error is -s·∇f + ½ s·H·s.
//! With half of the gradient, the terms with H cancel, and -½ s·∇f is left. The mean over records
//! is off by half the mean gradient times the mean of s, which is then added. The error that remains
//! is -½ m·H·m, where m is the mean of s. It is almost 0 if records surround the point. A single
//! record predicts the same as with its whole gradient. The gradient by rotation is used whole.
//!
//! The error is measured in `docs/notes/indirect-light.md`.

use glam::Vec3;

use crate::record::Record;

/// Sums over records, each with a weight.
#[derive(Default)]
pub(crate) struct Blend {
    /// Number of records.
    pub(crate) records: u32,
    /// Sum of the weights.
    pub(crate) weight: f32,
    /// Predictions with half of the gradient.
    halves: Vec3,
    /// Steps from the records to the point.
    steps: Vec3,
    /// Translation gradients of each channel.
    shifts: [Vec3; 3],
}

impl Blend {
    /// Adds a record.
    #[inline]
    pub(crate) fn add(&mut self, record: &Record, point: Vec3, normal: Vec3, weight: f32) {
        let step = point - Vec3::from(record.point);
        self.records += 1;
        self.weight += weight;
        self.halves += record.predict(step * 0.5, normal) * weight;
        self.steps += step * weight;
        for (sum, shift) in self.shifts.iter_mut().zip(record.shift) {
            *sum += Vec3::from(shift) * weight;
        }
    }

    /// Returns the irradiance per channel; never negative. There must be a record.
    #[inline]
    pub(crate) fn irradiance(&self) -> Vec3 {
        let mean = self.halves / self.weight;
        let step = self.steps * (0.5 / self.weight);
        let [r, g, b] = self.shifts.map(|shift| shift.dot(step) / self.weight);
        // Gradients change the light by at most half, as in the prediction of one record.
        (mean + Vec3::new(r, g, b)).clamp(mean * 0.5, mean * 1.5)
    }
}
