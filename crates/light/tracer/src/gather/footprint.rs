//! The footprint of a path: how wide a piece of surface it stands for (Bekaert et al. 2003).

/// The footprint of a path at its present surface, and what it needs to grow on the way to the
/// next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    /// Width at the last surface that is neither a mirror nor glass; 0 at the first.
    width: f32,
    /// Density per solid angle of the direction in which the path left it.
    density: f32,
    /// Distance since then, over mirrors and glass too.
    distance: f32,
}

impl Footprint {
    /// Returns the footprint of a ray from an eye or a surface.
    pub(crate) fn none() -> Self {
        Self { width: 0.0, density: f32::INFINITY, distance: 0.0 }
    }

    /// Moves along a ray.
    #[inline]
    pub(crate) fn travel(&mut self, distance: f32) {
        self.distance += distance;
    }

    /// Leaves a surface in a direction that was sampled with this density.
    #[inline]
    pub(crate) fn leave(&mut self, density: f32) {
        (self.density, self.distance) = (density, 0.0);
    }

    /// Corrects the density of the direction, after other ways to sample it are known.
    #[inline]
    pub(crate) fn multiply_density(&mut self, factor: f32) {
        self.density *= factor;
    }

    /// Arrives at a surface at this cosine, and returns the width there.
    ///
    /// Of n paths, each stands for a solid angle of 1 / (n density), and so for an area of
    /// distance² / (n density cosine). The width is that of one path.
    #[inline]
    pub(crate) fn arrive(&mut self, cosine: f32) -> f32 {
        self.width += self.distance / (self.density * cosine).sqrt();
        self.width
    }
}

#[cfg(test)]
mod tests {
    use std::f32::consts::PI;

    use super::*;

    #[test]
    fn a_footprint_grows_with_distance_over_the_root_of_the_density_and_the_cosine() {
        let mut footprint = Footprint::none();
        footprint.travel(5.0);
        assert_eq!(footprint.arrive(1.0), 0.0, "an eye's ray stands for one point");
        footprint.leave(1.0 / PI);
        footprint.travel(1.5);
        // Over a mirror.
        footprint.travel(0.5);
        let first = footprint.arrive(0.25);
        assert!((first - 2.0 * (PI / 0.25).sqrt()).abs() < 1e-5);
        footprint.leave(4.0 / PI);
        footprint.multiply_density(0.25);
        footprint.travel(1.0);
        assert!((footprint.arrive(1.0) - first - PI.sqrt()).abs() < 1e-5);
    }
}
