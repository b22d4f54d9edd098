//! Facets: the triangles of a scene, checked, with their normals.
//!
//! Invariant: every coordinate is finite and at most [`MAX_COORDINATE`].

use std::fmt;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use holo_scene::Geometry;
use rayon::prelude::*;

use crate::surface::edge_margin;

/// Most triangles of a scene. Spatial splits may refer to each several times, and references have
/// 31 bits.
pub const MAX_TRIANGLES: usize = 1 << 27;

/// Greatest coordinate relative to the scene's origin, because the triangle test multiplies three
/// of them in f32.
pub const MAX_COORDINATE: f32 = 1e12;

/// The reason why a hierarchy cannot be built.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum BuildError {
    /// There are more than [`MAX_TRIANGLES`].
    TooManyTriangles(usize),
    /// A triangle refers to a vertex that does not exist.
    Index {
        /// Index of the triangle.
        triangle: usize,
    },
    /// A vertex is not finite or beyond [`MAX_COORDINATE`].
    Coordinate {
        /// Index of the triangle.
        triangle: usize,
    },
}

impl fmt::Display for BuildError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooManyTriangles(found) => {
                write!(f, "{found} triangles; at most {MAX_TRIANGLES} can be traced")
            }
            Self::Index { triangle } => {
                write!(f, "triangle {triangle} names a vertex that does not exist")
            }
            Self::Coordinate { triangle } => {
                write!(f, "triangle {triangle} has a vertex too far out to be traced")
            }
        }
    }
}

impl std::error::Error for BuildError {}

/// Vertices and normal of a triangle. They share a cache line because they are used together.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(crate) struct Facet {
    pub vertices: [Vec3; 3],
    pub normal: Vec3,
    /// Least barycentric coordinate of a surface point: see [`edge_margin`].
    pub margin: f32,
}

const _: () = assert!(size_of::<Facet>() == 52);

impl Facet {
    pub(crate) fn new(vertices: [Vec3; 3]) -> Facet {
        // In f64, because the normal of a sliver is a difference of nearly equal products.
        let [a, b, c] = vertices.map(|v| v.as_dvec3());
        let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
        Facet { vertices, normal, margin: edge_margin(vertices) }
    }
}

/// Returns the facets of triangles, in the same order.
pub(crate) fn facets(geometry: &Geometry) -> Result<Vec<Facet>, BuildError> {
    let Geometry { positions, triangles, .. } = *geometry;
    if triangles.len() > MAX_TRIANGLES {
        return Err(BuildError::TooManyTriangles(triangles.len()));
    }
    let position = |index: u32| positions.get(index as usize).map(|&p| Vec3::from(p));
    let is_usable = |v: Vec3| v.is_finite() && v.abs().max_element() <= MAX_COORDINATE;
    let problem = |(triangle, indices): (usize, &[u32; 3])| {
        let problem = |&index: &u32| match position(index) {
            None => Some(BuildError::Index { triangle }),
            Some(vertex) => (!is_usable(vertex)).then_some(BuildError::Coordinate { triangle }),
        };
        indices.iter().find_map(problem)
    };
    if let Some(problem) = triangles.par_iter().enumerate().find_map_first(problem) {
        return Err(problem);
    }
    let facet =
        |indices: &[u32; 3]| Facet::new(indices.map(|index| Vec3::from(positions[index as usize])));
    // On all cores: half of the time is the system's clearing of new memory.
    let mut facets = holo_cpu::reserved(triangles.len());
    facets.par_extend(triangles.par_iter().map(facet));
    Ok(facets)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_that_cannot_be_traced_are_refused_with_their_number() {
        let refused = |positions: &[[f32; 3]]| {
            let geometry = Geometry { positions, triangles: &[[0, 1, 2]], material_ids: &[0] };
            facets(&geometry).err()
        };
        let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(refused(&corners), None);
        assert_eq!(refused(&corners[..2]), Some(BuildError::Index { triangle: 0 }));
        let not_finite = [[0.0; 3], [f32::NAN, 0.0, 0.0], [0.0, 1.0, 0.0]];
        assert_eq!(refused(&not_finite), Some(BuildError::Coordinate { triangle: 0 }));
    }
}
