//! The mean of estimates of light, in which old ones fade.

use glam::Vec3;

/// Exponent of the number of estimates that count, as a power of the number there were. The first
/// estimates end in cells that know little. In a plain mean they would count for a long time. With
/// 0.75, the error that neighbouring pixels share fell by a third.
const REMEMBERED: f32 = 0.75;

/// Factor of that power.
const REMEMBERED_FACTOR: f32 = 2.0;

/// Sums over estimates of reflected light, each with its albedo.
///
/// Their quotient is the light divided by reflectance. A texture's dark places therefore count
/// little, and black ones not at all.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Estimates {
    pub light: Vec3,
    pub albedo: Vec3,
    /// Number of estimates that the sums stand for.
    pub count: f32,
}

impl Estimates {
    /// Returns the light divided by reflectance; 0 in channels that reflect nothing.
    #[inline]
    pub(super) fn mean(&self) -> Vec3 {
        let channel = |c: usize| {
            if self.albedo[c] > 0.0 { self.light[c] / self.albedo[c] } else { 0.0 }
        };
        Vec3::new(channel(0), channel(1), channel(2))
    }

    /// Adds estimates without fading.
    #[inline]
    pub(super) fn sum(&mut self, new: &Estimates) {
        self.light += new.light;
        self.albedo += new.albedo;
        self.count += new.count;
    }

    /// Adds estimates. `total` is the number of estimates so far, with these.
    #[inline]
    pub(super) fn add(&mut self, new: &Estimates, total: f32) {
        let most = REMEMBERED_FACTOR * total.powf(REMEMBERED);
        let of_new = (most / new.count).min(1.0);
        let room = most - of_new * new.count;
        let of_old = if self.count > room { room / self.count } else { 1.0 };
        self.light = self.light * of_old + new.light * of_new;
        self.albedo = self.albedo * of_old + new.albedo * of_new;
        self.count = self.count * of_old + new.count * of_new;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn one(light: f32) -> Estimates {
        Estimates { light: Vec3::splat(light), albedo: Vec3::splat(0.5), count: 1.0 }
    }

    #[test]
    fn old_estimates_fade_and_the_mean_of_equal_ones_is_exact() {
        let mut estimates = Estimates::default();
        for total in 1..=1000 {
            estimates.add(&one(if total <= 100 { 10.0 } else { 2.0 }), total as f32);
        }
        let expected = REMEMBERED_FACTOR * 1000_f32.powf(REMEMBERED);
        assert!((estimates.count - expected).abs() < 0.01 * expected);
        // In a plain mean, the first hundred would leave 5.6.
        let mean = estimates.mean().x;
        assert!(mean > 4.0 && mean < 4.2, "{mean}");
    }

    #[test]
    fn many_estimates_at_once_count_as_one_by_one() {
        let (mut single, mut together) = (Estimates::default(), Estimates::default());
        for total in 1..=64 {
            single.add(&one(3.0), total as f32);
        }
        let mut many = one(3.0);
        (many.light, many.albedo, many.count) =
            (many.light * 64.0, many.albedo * 64.0, many.count * 64.0);
        together.add(&many, 64.0);
        assert!((single.mean() - together.mean()).abs().max_element() < 1e-5);
        assert!((single.count - together.count).abs() < 1e-3 * single.count);
    }

    #[test]
    fn black_places_of_a_texture_leave_the_light_as_it_is() {
        let mut estimates = Estimates::default();
        let light = Vec3::new(1.0, 2.0, 3.0);
        for (total, albedo) in [(1, Vec3::new(0.5, 0.0, 0.0)), (2, Vec3::new(0.2, 0.8, 0.0))] {
            let new = Estimates { light: light * albedo, albedo, count: 1.0 };
            estimates.add(&new, total as f32);
        }
        assert!((estimates.mean() - Vec3::new(1.0, 2.0, 0.0)).abs().max_element() < 1e-6);
    }
}
