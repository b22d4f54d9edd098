//! A ray in the form that the tests of boxes and triangles use.

use glam::Vec3;

/// A ray, transformed once for all tests.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Prepared {
    pub origin: [f32; 3],
    /// Reciprocals of the direction: finite, not 0, and so small that products with any coordinate
    /// are finite.
    pub inverse: [f32; 3],
    /// 1 for an axis along which the direction is negative: the first row of `Node::bounds` to use.
    pub reversed: [usize; 3],
    /// The two minor axes and, last, the main axis, along which the direction is greatest.
    pub axes: [usize; 3],
    /// The origin along `axes`.
    pub sheared_origin: [f32; 3],
    /// Slopes of the direction along the two minor axes against the main axis.
    pub shear: [f32; 2],
    pub direction: [f32; 3],
}

/// Squared lengths of acceptable directions. For others, inverses and products overflow.
pub(crate) const LENGTH_SQUARED: std::ops::Range<f32> = 1e-24..1e24;

impl Prepared {
    /// A placeholder that fills arrays.
    pub(crate) const NONE: Self = Self {
        origin: [0.0; 3],
        inverse: [0.0; 3],
        reversed: [0; 3],
        axes: [0; 3],
        sheared_origin: [0.0; 3],
        shear: [0.0; 2],
        direction: [0.0; 3],
    };

    /// Prepares a ray. `None` if it cannot hit anything: it is not finite, or its direction has no
    /// usable length.
    #[inline(always)]
    pub(crate) fn new(origin: Vec3, direction: Vec3) -> Option<Self> {
        let mut prepared = Self::for_triangles(origin, direction)?;
        let d = prepared.direction;
        // For boxes only. Over the whole scene, a slope of 1e-12 moves the ray by far less than the
        // padding of boxes. Directions are longer than 1e-12, so inverses stay below 2e24.
        let least = d[prepared.axes[2]].abs() * 1e-12;
        prepared.inverse = d.map(|c| 1.0 / c.abs().max(least).copysign(c));
        prepared.reversed = prepared.inverse.map(|i| usize::from(i < 0.0));
        Some(prepared)
    }

    /// Prepares a ray for triangles only: `inverse` and `reversed` have no meaning.
    #[inline(always)]
    pub(crate) fn for_triangles(origin: Vec3, direction: Vec3) -> Option<Self> {
        // The range test rejects a direction with NaN or infinity.
        if !origin.is_finite() || !LENGTH_SQUARED.contains(&direction.length_squared()) {
            return None;
        }
        let d = direction.to_array();
        let a = d.map(f32::abs);
        let axes = if a[0] >= a[1] && a[0] >= a[2] {
            [1, 2, 0]
        } else if a[1] >= a[2] {
            [2, 0, 1]
        } else {
            [0, 1, 2]
        };
        let z = d[axes[2]];
        let shear = [d[axes[0]] / z, d[axes[1]] / z];
        let origin = origin.to_array();
        Some(Self {
            origin,
            inverse: [0.0; 3],
            reversed: [0; 3],
            axes,
            sheared_origin: axes.map(|k| origin[k]),
            shear,
            direction: d,
        })
    }
}
