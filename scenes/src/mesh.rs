//! Triangle meshes of furniture: points, faces, and the material of each face.
//!
//! Invariant: faces are counter-clockwise seen from outside, even after affine maps with a
//! negative determinant. So lamps shine outwards, and glass knows its inside.

use crate::material::NamedMaterial;
use glam::{DAffine3, DMat3, DVec3};

/// One triangle of a [`Mesh`].
#[derive(Clone, Copy, Debug)]
pub struct MeshFace {
    /// Indices into the mesh's points, counter-clockwise from outside.
    pub corners: [u32; 3],
    /// Its material.
    pub material: &'static NamedMaterial,
}

/// Points and triangles.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Corners, in metres.
    pub points: Vec<DVec3>,
    /// Triangles.
    pub faces: Vec<MeshFace>,
}

impl Mesh {
    /// Joins several meshes.
    pub fn of(parts: impl IntoIterator<Item = Self>) -> Self {
        let mut whole = Self::default();
        for part in parts {
            whole.add(part);
        }
        whole
    }

    /// Adds all of `part`.
    pub fn add(&mut self, part: Self) {
        let base = self.points.len() as u32;
        self.points.extend(part.points);
        self.faces.extend(
            part.faces
                .iter()
                .map(|face| MeshFace { corners: face.corners.map(|c| c + base), ..*face }),
        );
    }

    /// Adds a point; returns its index.
    pub fn point(&mut self, p: DVec3) -> u32 {
        self.points.push(p);
        (self.points.len() - 1) as u32
    }

    /// Adds a quadrilateral of four point indices, counter-clockwise. If sides have length zero, a
    /// triangle or nothing is added.
    pub fn quad(&mut self, material: &'static NamedMaterial, [a, b, c, d]: [u32; 4]) {
        for corners in [[a, b, c], [a, c, d]] {
            let [p, q, r] = corners.map(|i| self.points[i as usize]);
            if (q - p).cross(r - p).length_squared() > 1e-18 {
                self.faces.push(MeshFace { corners, material });
            }
        }
    }

    /// Applies an affine map.
    pub fn transformed(mut self, map: DAffine3) -> Self {
        for p in &mut self.points {
            *p = map.transform_point3(*p);
        }
        if map.matrix3.determinant() < 0.0 { self.inside_out() } else { self }
    }

    /// Moves the mesh.
    pub fn at(self, x: f64, y: f64, z: f64) -> Self {
        self.transformed(DAffine3::from_translation(DVec3::new(x, y, z)))
    }

    /// Turns the mesh about +z, counter-clockwise seen from above.
    pub fn turned(self, degrees: f64) -> Self {
        self.transformed(DAffine3::from_mat3(DMat3::from_rotation_z(degrees.to_radians())))
    }

    /// Tilts the mesh about +x: at 90 degrees, what pointed up points to -y.
    pub fn tilted(self, degrees: f64) -> Self {
        self.transformed(DAffine3::from_mat3(DMat3::from_rotation_x(degrees.to_radians())))
    }

    /// Stretches the mesh along the axes; a negative factor mirrors it.
    pub fn scaled(self, x: f64, y: f64, z: f64) -> Self {
        self.transformed(DAffine3::from_scale(DVec3::new(x, y, z)))
    }

    /// Turns all faces: what was outside is inside.
    pub fn inside_out(mut self) -> Self {
        self.faces.iter_mut().for_each(|face| face.corners.swap(1, 2));
        self
    }

    /// Returns the corners of each triangle, with its material.
    #[cfg(test)]
    pub fn triangles(&self) -> impl Iterator<Item = ([DVec3; 3], &'static NamedMaterial)> + '_ {
        self.faces.iter().map(|face| (face.corners.map(|c| self.points[c as usize]), face.material))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::material::PLASTER;
    use crate::shapes::{block, cushion, lathe, rounded, tube};

    /// Returns the volume by the divergence theorem: positive if the faces of a closed mesh face
    /// outwards.
    fn volume(mesh: &Mesh) -> f64 {
        mesh.triangles().map(|([a, b, c], _)| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn closed_shapes_look_outwards_and_mirroring_keeps_that() {
        let shapes = [
            ("block", block(&PLASTER, [1.0, 2.0, 3.0])),
            ("rounded", rounded(&PLASTER, [1.0, 2.0, 3.0], 0.1)),
            ("cushion", cushion(&PLASTER, [1.0, 1.0, 0.4])),
            ("lathe", lathe(&PLASTER, 24, &[(0.0, 0.0), (0.5, 0.0), (0.3, 1.0), (0.0, 1.0)])),
            ("tube", tube(&PLASTER, &[DVec3::ZERO, DVec3::X, DVec3::ONE], 0.1, 12)),
        ];
        for (name, shape) in shapes {
            let outwards = volume(&shape);
            assert!(outwards > 0.0, "{name}: {outwards}");
            let mirrored = volume(&shape.scaled(-2.0, 1.0, 1.0).turned(30.0).at(1.0, 2.0, 3.0));
            assert!(
                (mirrored - 2.0 * outwards).abs() < 1e-9 * outwards.max(1.0),
                "{name}: {mirrored}"
            );
        }
    }

    #[test]
    fn volumes_are_those_of_the_solids() {
        assert!((volume(&block(&PLASTER, [1.0, 2.0, 3.0])) - 6.0).abs() < 1e-12);
        // Inscribed in the solid with rounded edges: slightly less than the box, and more than the
        // box without its edges.
        let soft = volume(&rounded(&PLASTER, [1.0, 2.0, 3.0], 0.1));
        assert!((0.8 * 1.8 * 2.8..6.0).contains(&soft), "{soft}");
        // A prism over a regular n-gon.
        let n = 64.0_f64;
        let prism = volume(&lathe(&PLASTER, 64, &[(0.0, 0.0), (1.0, 0.0), (1.0, 2.0), (0.0, 2.0)]));
        assert!((prism - n * (std::f64::consts::TAU / n).sin()).abs() < 1e-12);
    }
}
