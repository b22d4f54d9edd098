//! A record: the indirect light at a point of a surface, and how it changes nearby.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use holo_color::relative_luminance;

/// Number of standard errors, of both records together, beyond which a difference is a
/// contradiction. With 2, records that are too bright by chance lose so much of the surface that a
/// bedroom is 0.3 % too dark. With 3 there is no such bias.
const CONTRADICTION: f32 = 3.0;

/// Irradiance by indirect light at a point, its gradients, and its radius of use (Ward and Heckbert
/// 1992, "Irradiance Gradients"). Plain data: 136 bytes without padding, little-endian on the wire
/// and in the file.
///
/// Lengths are in scene units; positions are relative to the scene's origin.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Record {
    /// Position.
    pub point: [f32; 3],
    /// Distance within which the record may be used.
    pub radius: f32,
    /// Unit normal on the lit side.
    pub normal: [f32; 3],
    /// Distance to the nearest surface that the record's rays hit; infinity if they hit nothing.
    pub nearest: f32,
    /// Irradiance in W·m⁻² per channel.
    pub irradiance: [f32; 3],
    /// Relative standard error of the luminance.
    pub error: f32,
    /// Translation gradient of each channel, per unit of length along the surface.
    pub shift: [[f32; 3]; 3],
    /// Rotation gradient of each channel; the change is its dot product with (old normal × new
    /// normal).
    pub turn: [[f32; 3]; 3],
    /// Number of rays.
    pub rays: u32,
    /// Bits 0 to 7: 0 for an exact record; 1 for a coarse one, which only rays of other records
    /// use. Bits 8 to 15: the [grade](Self::grade). The others are 0.
    pub flags: u32,
    /// Unique among all records of a scene, so that merging a record twice changes nothing.
    pub id: u64,
}

/// Greatest [`Record::grade`].
pub const MAX_GRADE: u32 = 3;

impl Record {
    /// Returns 0 for an exact record and 1 for a coarse one.
    #[must_use]
    #[inline]
    pub fn kind(&self) -> u32 {
        self.flags & 0xFF
    }

    /// Returns how often the error of records was halved before this one, beyond the accuracy that
    /// all records have.
    #[must_use]
    #[inline]
    pub fn grade(&self) -> u32 {
        self.flags >> 8
    }

    /// Returns the weight of the record beside those of other grades.
    #[must_use]
    #[inline]
    pub fn grade_weight(&self) -> f32 {
        grade_weight(self.grade())
    }

    /// Returns true if a tracer could have made the record: it is finite, its radius is positive,
    /// its normal has unit length, no light is negative, and its kind and grade exist.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let finite = |values: &[f32]| values.iter().all(|v| v.is_finite());
        finite(&self.point)
            && finite(self.shift.as_flattened())
            && finite(self.turn.as_flattened())
            && self.irradiance.iter().all(|e| e.is_finite() && *e >= 0.0)
            && (Vec3::from(self.normal).length_squared() - 1.0).abs() < 1e-3
            && self.radius.is_finite()
            && self.radius > 0.0
            && self.nearest >= 0.0
            && self.error >= 0.0
            && self.kind() <= 1
            && self.grade() <= MAX_GRADE
    }

    /// Returns the irradiance that the record predicts at a point with normal `normal`; never
    /// negative.
    #[must_use]
    #[inline]
    pub fn extrapolate(&self, point: Vec3, normal: Vec3) -> Vec3 {
        self.predict(point - Vec3::from(self.point), normal)
    }

    /// Returns the same at `step` from the record.
    #[inline]
    pub(crate) fn predict(&self, step: Vec3, normal: Vec3) -> Vec3 {
        let turned = Vec3::from(self.normal).cross(normal);
        let channel = |c: usize| {
            self.irradiance[c]
                + Vec3::from(self.shift[c]).dot(step)
                + Vec3::from(self.turn[c]).dot(turned)
        };
        // Gradients are noisy, so they change the light by at most half.
        let held = Vec3::from(self.irradiance);
        Vec3::new(channel(0), channel(1), channel(2)).clamp(held * 0.5, held * 1.5)
    }

    /// Returns the radius, as a share of the distance between two records, up to which both may be
    /// used. It is below 1 if the prediction of either at the other is off by more than their noise
    /// explains.
    ///
    /// Then the light changes between them in a way that gradients do not predict. The error grows
    /// with the square of the distance, so the share is where it equals the noise.
    pub(crate) fn agreed_share(&self, other: &Self) -> f32 {
        let off = |from: &Self, to: &Self| {
            luminance(
                from.extrapolate(to.point.into(), to.normal.into()) - Vec3::from(to.irradiance),
            )
            .abs()
        };
        let difference = off(self, other).min(off(other, self));
        let [own, others] =
            [self, other].map(|record| record.error * luminance(record.irradiance.into()));
        let noise = own.hypot(others);
        if difference > CONTRADICTION * noise && noise > 0.0 {
            (noise / difference).sqrt()
        } else {
            1.0
        }
    }
}

/// Returns the weight of records of a grade beside those of grade 0: 16 to the power of the grade.
///
/// With each grade, the variance falls to a quarter. Weights in proportion to its inverse would be
/// best if records had no bias. But they also have a bias that often has one sign, so older records
/// should hardly count.
#[must_use]
#[inline]
pub fn grade_weight(grade: u32) -> f32 {
    (1_u32 << (4 * grade)) as f32
}

/// Returns the luminance in the unit of the channels.
#[inline]
pub(crate) fn luminance(c: Vec3) -> f32 {
    relative_luminance(c.to_array())
}
