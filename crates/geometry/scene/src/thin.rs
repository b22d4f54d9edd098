//! Finds the triangles of shared meshes that have no area at some place, without a look at all
//! triangles of all instances.
//!
//! Corners of instances are rounded to f32. A triangle keeps an area if its height in the mesh is
//! several roundings. So heights are computed once for each mesh, and only *thin* triangles are
//! placed and tested. Small files can place 2²⁸ triangles: tests of all of them took seconds in
//! each process that reads the scene.

use glam::{DVec3, Vec3};

use crate::Geometry;
use crate::geometry::doubled_area_normal;
use crate::limits::MAX_COORDINATE;
use crate::placement::Placement;

/// What is wrong with an instance.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum InstanceFault {
    /// The box of its mesh is not finite or reaches too far away.
    TooFar,
    /// A triangle of its mesh has no area there.
    NoArea(usize),
}

/// The bounds of a mesh, and its triangles that are thin somewhere.
struct MeshShape {
    /// The corners of its box. Rounding is monotonic, so placed points lie between them.
    corners: [[f32; 3]; 8],
    /// Heights and numbers of triangles, lowest first.
    thin: Vec<(f64, u32)>,
}

/// The shapes of meshes.
pub(crate) struct Shapes<'a> {
    meshes: &'a [Geometry<'a>],
    shapes: Vec<MeshShape>,
}

impl<'a> Shapes<'a> {
    /// Prepares meshes for instances. Indices of meshes and positions exist.
    pub(crate) fn new<'p>(
        meshes: &'a [Geometry<'a>],
        instances: impl Iterator<Item = (u32, &'p Placement)>,
    ) -> Shapes<'a> {
        let mut shapes: Vec<MeshShape> = meshes
            .iter()
            .map(|mesh| MeshShape { corners: box_corners(mesh.positions), thin: Vec::new() })
            .collect();
        let mut greatest = vec![0.0_f64; meshes.len()];
        for (mesh, placement) in instances {
            let height = shapes[mesh as usize].thin_height(placement);
            let most = &mut greatest[mesh as usize];
            *most = most.max(height);
        }
        for ((shape, mesh), most) in shapes.iter_mut().zip(meshes).zip(greatest) {
            let heights = mesh.triangles.iter().map(|&triangle| height(mesh, triangle));
            shape.thin = heights.zip(0..).filter(|(height, _)| *height <= most).collect();
            shape.thin.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        }
        Shapes { meshes, shapes }
    }

    /// Returns the number of triangles that [`fault`](Self::fault) tests. The instance is one of
    /// those given to [`new`](Self::new).
    pub(crate) fn tests(&self, mesh: u32, placement: &Placement) -> usize {
        self.shapes[mesh as usize].thin_at(placement).len()
    }

    /// Returns what is wrong with an instance, which is one of those given to [`new`](Self::new).
    pub(crate) fn fault(&self, mesh: u32, placement: &Placement) -> Option<InstanceFault> {
        let (shape, mesh) = (&self.shapes[mesh as usize], &self.meshes[mesh as usize]);
        let is_within = |point: Vec3| f64::from(point.abs().max_element()) <= MAX_COORDINATE;
        if !shape.corners.iter().all(|&corner| is_within(placement.point(corner))) {
            return Some(InstanceFault::TooFar);
        }
        let place = |corner: u32| placement.point(mesh.positions[corner as usize]);
        let is_flat = |triangle: u32| {
            doubled_area_normal(mesh.triangles[triangle as usize].map(place)).is_none()
        };
        let flat = shape.thin_at(placement).iter().find(|thin| is_flat(thin.1));
        flat.map(|thin| InstanceFault::NoArea(thin.1 as usize))
    }
}

impl MeshShape {
    fn thin_at(&self, placement: &Placement) -> &[(f64, u32)] {
        let height = self.thin_height(placement);
        &self.thin[..self.thin.partition_point(|thin| thin.0 <= height)]
    }

    /// Returns the height in the mesh up to which triangles are thin at a place.
    ///
    /// Rounding moves a placed corner by at most √3 times the error of a coordinate. Three corners
    /// that come to lie on a line are those of a triangle whose height was at most twice that. The
    /// factor 8 instead of 2√3 leaves room for the roundings of this computation and of the test.
    fn thin_height(&self, placement: &Placement) -> f64 {
        let reach = self.corners.map(|corner| placement.point(corner).abs().max_element());
        let reach = f64::from(reach.into_iter().fold(0.0, f32::max));
        let sizes = self.corners.map(|corner| Vec3::from(corner).abs().as_dvec3());
        let size = sizes.into_iter().fold(DVec3::ZERO, DVec3::max);
        let sum = |[x, y, z, sum]: [f64; 4]| DVec3::new(x, y, z).abs().dot(size) + sum.abs();
        let sum = placement.rows().map(sum).into_iter().fold(0.0, f64::max);
        // The rounding to f32, the roundings of f64 before it, and the least step of f32.
        let error = 2f64.powi(-24) * reach + 2f64.powi(-50) * sum + 2f64.powi(-149);
        let shrinking =
            placement.inverse().as_flattened().iter().map(|c| c * c).sum::<f64>().sqrt();
        8.0 * error * shrinking
    }
}

/// Returns the corners of a box around positions.
pub(crate) fn box_corners(positions: &[[f32; 3]]) -> [[f32; 3]; 8] {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for position in positions {
        for axis in 0..3 {
            low[axis] = low[axis].min(position[axis]);
            high[axis] = high[axis].max(position[axis]);
        }
    }
    let sides = [low, high];
    std::array::from_fn(|k| [0, 1, 2].map(|axis| sides[k >> axis & 1][axis]))
}

/// Returns the least height of a triangle.
fn height(mesh: &Geometry, triangle: [u32; 3]) -> f64 {
    let [a, b, c] = triangle.map(|corner| Vec3::from(mesh.positions[corner as usize]).as_dvec3());
    let longest = (b - a).length().max((c - a).length()).max((c - b).length());
    if longest > 0.0 { (b - a).cross(c - a).length() / longest } else { 0.0 }
}
