//! Light from all directions as spherical harmonics of order 2 (Ramamoorthi & Hanrahan 2001).

use std::f32::consts::PI;

use glam::Vec3;

use holo_reflection_cube::CubeGrid;

/// Number of harmonics up to order 2.
const COUNT: usize = 9;

/// The factors by which a cosine lobe weighs the harmonics of each order.
const LOBE: [f32; COUNT] = {
    let (first, second) = (2.0 * PI / 3.0, PI / 4.0);
    [PI, first, first, first, second, second, second, second, second]
};

/// Radiance as a function of direction, smoothed.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Harmonics([Vec3; COUNT]);

impl Harmonics {
    /// Returns the harmonics of the light of a grid's texels: radiance times solid angle.
    pub(crate) fn of(grid: CubeGrid, light: impl Fn(usize) -> Vec3) -> Harmonics {
        let mut harmonics = Harmonics::default();
        for texel in 0..grid.len() {
            harmonics.add(grid.direction_of(texel), light(texel));
        }
        harmonics
    }

    /// Adds light that comes from a direction: radiance times solid angle.
    fn add(&mut self, direction: Vec3, light: Vec3) {
        for (sum, basis) in self.0.iter_mut().zip(basis(direction)) {
            *sum += light * basis;
        }
    }

    /// Returns the radiance from a direction. It may be below 0 beside bright parts.
    pub(crate) fn radiance(&self, direction: Vec3) -> Vec3 {
        self.0.iter().zip(basis(direction)).map(|(sum, basis)| *sum * basis).sum()
    }

    /// Returns the irradiance of a surface with this normal.
    pub(crate) fn irradiance(&self, normal: Vec3) -> Vec3 {
        self.irradiance_unbounded(normal).max(Vec3::ZERO)
    }

    /// Returns the integral of [`radiance`](Self::radiance) over the hemisphere of a normal, times
    /// the cosine.
    pub(crate) fn irradiance_unbounded(&self, normal: Vec3) -> Vec3 {
        let terms = self.0.iter().zip(basis(normal)).zip(LOBE);
        terms.map(|((sum, basis), lobe)| *sum * (basis * lobe)).sum()
    }
}

fn basis(Vec3 { x, y, z }: Vec3) -> [f32; COUNT] {
    [
        0.282_095,
        0.488_603 * y,
        0.488_603 * z,
        0.488_603 * x,
        1.092_548 * x * y,
        1.092_548 * y * z,
        0.315_392 * (3.0 * z * z - 1.0),
        1.092_548 * x * z,
        0.546_274 * (x * x - y * y),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the harmonics of a radiance.
    fn of(radiance: impl Fn(Vec3) -> Vec3) -> Harmonics {
        let grid = CubeGrid::new(32);
        Harmonics::of(grid, |texel| radiance(grid.direction_of(texel)) * grid.solid_angle_of(texel))
    }

    #[test]
    fn an_even_sphere_and_a_bright_half_have_their_known_irradiance() {
        let even = of(|_| Vec3::ONE);
        let half = of(|direction| Vec3::splat(if direction.z > 0.0 { 1.0 } else { 0.0 }));
        for normal in [Vec3::X, Vec3::NEG_Z, Vec3::new(0.6, 0.0, 0.8)] {
            assert!((even.irradiance(normal).x - PI).abs() < 1e-2);
            assert!((even.radiance(normal).x - 1.0).abs() < 1e-2);
            // The form factor of a half space: (1 + cos) / 2.
            let expected = PI * (1.0 + normal.z) / 2.0;
            let found = half.irradiance(normal).x;
            assert!((found - expected).abs() < 0.06, "{normal}: {found}, not {expected}");
        }
    }
}
