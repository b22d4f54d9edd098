//! One record: the indirect light at a point of a surface, and how it changes around it.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;

use crate::gather::luminance;

/// Standard errors of two records together from which on they contradict each other. With 2 in place of 3, records that are too bright by
/// chance give up so much of the surface that a bedroom is 0.3 % too dark; with 3, it is as bright as without.
const CONTRADICTION: f32 = 3.0;

/// Irradiance by indirect light at a point, its gradients, and how far from the point it may be used (Ward and Heckbert 1992,
/// "Irradiance Gradients"). Plain data: 136 bytes without padding, little-endian on the wire and in the file.
///
/// Lengths are the scene's, positions relative to its origin.
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Record {
    /// Where.
    pub point: [f32; 3],
    /// How far away it may be used.
    pub radius: f32,
    /// Unit, on the side that is lit.
    pub normal: [f32; 3],
    /// Distance to the nearest surface that its rays met; infinity if none did.
    pub nearest: f32,
    /// W·m⁻² per channel.
    pub irradiance: [f32; 3],
    /// Standard error of the luminance, relative to it.
    pub error: f32,
    /// Change of each channel with a step along the surface, per unit of length.
    pub shift: [[f32; 3]; 3],
    /// Change of each channel as the normal turns: its scalar product with (old normal × new normal).
    pub turn: [[f32; 3]; 3],
    /// Rays that were traced for it.
    pub rays: u32,
    /// 0 if it is as exact as was asked for, 1 if it is coarse: for the rays of other records.
    pub flags: u32,
    /// Unique among all records of a scene: what makes merging idempotent.
    pub id: u64,
}

impl Record {
    /// Whether it is what a tracer could have made: finite, of positive radius, with a normal of unit length and no negative light.
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
    }

    /// The irradiance that this record predicts at a point whose normal is `normal`: never negative.
    #[must_use]
    #[inline]
    pub fn extrapolate(&self, point: Vec3, normal: Vec3) -> Vec3 {
        let step = point - Vec3::from(self.point);
        let turned = Vec3::from(self.normal).cross(normal);
        let channel = |c: usize| {
            self.irradiance[c]
                + Vec3::from(self.shift[c]).dot(step)
                + Vec3::from(self.turn[c]).dot(turned)
        };
        // Gradients are noisy: at most half of the light is theirs to give or take.
        let held = Vec3::from(self.irradiance);
        Vec3::new(channel(0), channel(1), channel(2)).clamp(held * 0.5, held * 1.5)
    }

    /// How far this record and another may be used, as a share of their distance: less than all of it if what either predicts where the
    /// other was made is off by more than their noise explains. Light then changes on the way as no gradient tells, by the square of
    /// the distance: so far that it is as much as the noise.
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
