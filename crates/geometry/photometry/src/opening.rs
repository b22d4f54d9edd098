//! The part of a luminaire that shines: a point, a face or a convex body.
//!
//! Invariant: a mesh is convex, and its faces' corners are counter-clockwise seen from outside. So
//! the area that is seen from a direction is the sum of the faces' areas times their cosines.

use std::f64::consts::TAU;

use glam::DVec3;

/// Radius of the body that stands for a point, metres: that of a small bulb.
const POINT_RADIUS: f64 = 0.005;

/// Least side of an opening that has an extent, metres: that of a strip of light-emitting diodes.
const LEAST_SIDE: f64 = 0.002;

/// Corners of a circle.
const CORNERS: usize = 12;

/// The kinds of openings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum OpeningShape {
    /// No extent.
    Point,
    /// A horizontal rectangle.
    Rectangle,
    /// A horizontal ellipse or circle.
    Ellipse,
    /// A box.
    Box,
    /// A lying tube along x.
    CylinderAlongX,
    /// A lying tube along y.
    CylinderAlongY,
    /// A standing tube.
    CylinderAlongZ,
    /// A sphere or ellipsoid.
    Ellipsoid,
}

/// The part of a luminaire that shines, around the zero of its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LuminousOpening {
    /// Its kind.
    pub shape: OpeningShape,
    /// Its extent along x, y and z, metres.
    pub size: [f64; 3],
}

/// The faces of an opening.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OpeningMesh {
    /// Corners, metres.
    pub corners: Vec<DVec3>,
    /// Triangles, counter-clockwise seen from where they shine.
    pub triangles: Vec<[u32; 3]>,
    /// True if they shine on both sides.
    pub is_two_sided: bool,
}

impl LuminousOpening {
    /// Makes an opening. One without extent is a point; other sides have at least 2 mm.
    pub(crate) fn new(shape: OpeningShape, size: [f64; 3]) -> LuminousOpening {
        let shape =
            if size[0].max(size[1]) <= 0.0 && size[2] <= 0.0 { OpeningShape::Point } else { shape };
        let [x, y, z] = size.map(|side| side.max(LEAST_SIDE));
        let size = match shape {
            OpeningShape::Point => [0.0; 3],
            OpeningShape::Rectangle | OpeningShape::Ellipse => [x, y, 0.0],
            _ => [x, y, z],
        };
        LuminousOpening { shape, size }
    }

    /// Returns its faces, for light downwards and upwards.
    #[must_use]
    pub fn mesh(&self, [below, above]: [bool; 2]) -> OpeningMesh {
        let half = DVec3::from(self.size) * 0.5;
        // Areas of polygons are those of their circles.
        let inner = TAU / CORNERS as f64;
        let swell = (inner / inner.sin()).sqrt();
        let circle = |at: usize| {
            let (sin, cos) = ((at as f64 + 0.5) * inner).sin_cos();
            [cos * swell, sin * swell]
        };
        let is_flipped = above && !below;
        let side = if is_flipped { 1.0 } else { -1.0 };
        let flat = |outline: Vec<DVec3>| {
            let mut mesh = OpeningMesh { is_two_sided: above && below, ..Default::default() };
            mesh.add_polygon(&outline, DVec3::Z * side);
            mesh
        };
        match self.shape {
            OpeningShape::Point => ellipsoid(DVec3::splat(POINT_RADIUS), false),
            OpeningShape::Ellipsoid => ellipsoid(half, true),
            OpeningShape::Rectangle => {
                let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
                flat(corners.map(|[x, y]| DVec3::new(x, y, 0.0) * half).to_vec())
            }
            OpeningShape::Ellipse => {
                let corner = |at| {
                    let [x, y] = circle(at);
                    DVec3::new(x, y, 0.0) * half
                };
                flat((0..CORNERS).map(corner).collect())
            }
            OpeningShape::Box => {
                let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
                prism(&corners, |[x, y], z| DVec3::new(x, y, z) * half)
            }
            OpeningShape::CylinderAlongZ => {
                prism(&outline(circle), |[x, y], z| DVec3::new(x, y, z) * half)
            }
            OpeningShape::CylinderAlongX => {
                prism(&outline(circle), |[y, z], x| DVec3::new(x, y, z) * half)
            }
            OpeningShape::CylinderAlongY => {
                prism(&outline(circle), |[z, x], y| DVec3::new(x, y, z) * half)
            }
        }
    }
}

fn outline(circle: impl Fn(usize) -> [f64; 2]) -> Vec<[f64; 2]> {
    (0..CORNERS).map(circle).collect()
}

/// Makes a body of an outline, counter-clockwise about its axis, from -1 to 1 along that axis.
fn prism(outline: &[[f64; 2]], place: impl Fn([f64; 2], f64) -> DVec3) -> OpeningMesh {
    let mut mesh = OpeningMesh::default();
    let count = outline.len();
    for end in [-1.0, 1.0] {
        let face: Vec<DVec3> = outline.iter().map(|&at| place(at, end)).collect();
        mesh.add_polygon(&face, place([0.0; 2], end));
    }
    for at in 0..count {
        let [from, to] = [outline[at], outline[(at + 1) % count]];
        let face = [place(from, -1.0), place(to, -1.0), place(to, 1.0), place(from, 1.0)];
        let outside = place([from[0] + to[0], from[1] + to[1]], 0.0);
        mesh.add_polygon(&face, outside);
    }
    mesh
}

/// Makes an octahedron, or a finer body of 32 faces, with its corners on an ellipsoid.
fn ellipsoid(half: DVec3, is_fine: bool) -> OpeningMesh {
    let mut mesh = OpeningMesh::default();
    for octant in 0..8 {
        let sign = |axis: u32| if octant >> axis & 1 == 0 { 1.0 } else { -1.0 };
        let [x, y, z] = [DVec3::X * sign(0), DVec3::Y * sign(1), DVec3::Z * sign(2)];
        let place = |at: DVec3| at.normalize() * half;
        let faces: Vec<[DVec3; 3]> = match is_fine {
            false => vec![[x, y, z]],
            true => {
                let [a, b, c] = [x + y, y + z, z + x].map(DVec3::normalize);
                vec![[x, a, c], [y, b, a], [z, c, b], [a, b, c]]
            }
        };
        for face in faces {
            let corners = face.map(place);
            mesh.add_polygon(&corners, corners[0] + corners[1] + corners[2]);
        }
    }
    mesh
}

impl OpeningMesh {
    /// Adds a convex polygon that faces `outside`.
    fn add_polygon(&mut self, corners: &[DVec3], outside: DVec3) {
        let first = self.corners.len() as u32;
        let [a, b, c] = [corners[0], corners[1], corners[2]];
        let is_turned = (b - a).cross(c - a).dot(outside) < 0.0;
        self.corners.extend(corners);
        for at in 1..corners.len() as u32 - 1 {
            let triangle = [first, first + at, first + at + 1];
            self.triangles.push(match is_turned {
                true => [triangle[0], triangle[2], triangle[1]],
                false => triangle,
            });
        }
    }

    /// Returns the normals of the triangles, each as long as its area.
    #[must_use]
    pub fn areas(&self) -> Vec<DVec3> {
        let of = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|corner| self.corners[corner as usize]);
            (b - a).cross(c - a) * 0.5
        };
        self.triangles.iter().map(of).collect()
    }
}
