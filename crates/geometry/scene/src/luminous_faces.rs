//! Luminaires whose faces are a model's own: those of a material with a photometric file.
//!
//! Faces that touch each other are one luminaire. Its nadir is the side that its faces show, or
//! down if they enclose a body. Its long side lies along theirs.

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_photometry::Photometry;

use crate::geometry::doubled_area_normal;
use crate::hanging::even_emission;
use crate::{Bsdf, Luminaire, Rgb, Scene, SceneError};

/// How luminaires hang in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hanging {
    /// The scene's up axis.
    pub up: DVec3,
    /// Metres in its unit.
    pub unit: f64,
    /// Degrees by which they are turned about their axis.
    pub turn: f64,
}

/// Share of their area that faces must show on one side, if that side is to be their nadir.
const SHOWN: f64 = 0.5;

impl Scene {
    /// Makes luminaires of the faces of a material. Returns the scene and their number.
    ///
    /// # Errors
    /// As [`Scene::with_luminaires`].
    pub fn with_luminous_material(
        mut self,
        material: u32,
        photometry: &Photometry,
        colour: Rgb,
        hanging: Hanging,
    ) -> Result<(Scene, usize), SceneError> {
        let Hanging { up, unit, turn } = hanging;
        let name = self.materials[material as usize].name.clone();
        let web = Arc::new(photometry.web.clone());
        let halves = web.halves();
        let components = self.components(material);
        let mut all = self.luminaires().to_vec();
        let many = components.len() > 1;
        for (number, triangles) in components.iter().enumerate() {
            let id = if number == 0 { material } else { self.copy_of_material(material) };
            triangles.iter().for_each(|&triangle| self.material_ids.to_mut()[triangle] = id);
            let faces = FacesOfLuminaire::new(&self, triangles);
            let down = faces.nadir(halves, up);
            let is_open = faces.is_open();
            let two_sided = is_open && halves == [true; 2];
            let axes = faces.axes(down, photometry.opening.size, turn);
            let sides = if two_sided { 2.0 } else { 1.0 };
            let area = sides * faces.area * unit * unit;
            let made = &mut self.materials[id as usize];
            made.emission = even_emission(web.flux(), area, colour);
            made.two_sided_emission = two_sided;
            if matches!(made.bsdf, Bsdf::ThinGlass { .. } | Bsdf::Dielectric { .. }) {
                made.bsdf = Bsdf::Diffuse { kd: [0.0; 3] };
            }
            let own = if many { format!("{name} {}", number + 1) } else { name.clone() };
            let axes = axes.map(|axis| axis.as_vec3());
            all.push(Luminaire::new([own, name.clone()], id, axes, web.clone()));
        }
        let count = components.len();
        Ok((self.validated()?.with_luminaires(all)?, count))
    }

    /// Adds a copy of a material, with its textures.
    fn copy_of_material(&mut self, material: u32) -> u32 {
        let at = material as usize;
        self.materials.push(self.materials[at].clone());
        if let Some(shading) = &mut self.shading {
            shading.maps.extend(shading.maps.get(at).copied());
            shading.covers.extend(shading.covers.get(at).copied());
        }
        self.materials.len() as u32 - 1
    }

    /// Returns the scene's own triangles of a material, those that touch each other together.
    fn components(&self, material: u32) -> Vec<Vec<usize>> {
        let own = self.own();
        let members: Vec<usize> =
            (0..own.triangles.len()).filter(|&t| own.material_ids[t] == material).collect();
        let mut group: Vec<usize> = (0..members.len()).collect();
        fn root(group: &mut [usize], mut at: usize) -> usize {
            while group[at] != at {
                group[at] = group[group[at]];
                at = group[at];
            }
            at
        }
        let mut at_corner = HashMap::new();
        for (member, &triangle) in members.iter().enumerate() {
            for corner in own.triangles[triangle] {
                // Adding 0 turns -0 into 0.
                let place = own.positions[corner as usize].map(|c| (c + 0.0).to_bits());
                let other = *at_corner.entry(place).or_insert(member);
                let (a, b) = (root(&mut group, member), root(&mut group, other));
                group[a.max(b)] = a.min(b);
            }
        }
        let mut places = HashMap::new();
        let mut components: Vec<Vec<usize>> = Vec::new();
        for (member, &triangle) in members.iter().enumerate() {
            let root = root(&mut group, member);
            let place = *places.entry(root).or_insert(components.len());
            if place == components.len() {
                components.push(Vec::new());
            }
            components[place].push(triangle);
        }
        components
    }
}

/// The faces of one luminaire.
struct FacesOfLuminaire {
    corners: Vec<[DVec3; 3]>,
    area: f64,
    /// Sum of the normals times their areas.
    shown: DVec3,
}

impl FacesOfLuminaire {
    fn new(scene: &Scene, triangles: &[usize]) -> FacesOfLuminaire {
        let corners = |&triangle: &usize| scene.corners(triangle as u32).map(Vec3::as_dvec3);
        let normal = |&triangle: &usize| {
            doubled_area_normal(scene.corners(triangle as u32)).unwrap_or_default() * 0.5
        };
        FacesOfLuminaire {
            corners: triangles.iter().map(corners).collect(),
            area: triangles.iter().map(|triangle| normal(triangle).length()).sum(),
            shown: triangles.iter().map(normal).sum(),
        }
    }

    /// Returns whether they show one side rather than enclosing a body.
    fn is_open(&self) -> bool {
        self.shown.length() > SHOWN * self.area
    }

    /// Returns the direction of the nadir, for light below and above it.
    fn nadir(&self, halves: [bool; 2], up: DVec3) -> DVec3 {
        let (side, down) = (self.shown.normalize_or_zero(), -up.normalize_or(DVec3::Z));
        match halves {
            _ if !self.is_open() => down,
            [true, false] => side,
            [false, true] => -side,
            _ if side.dot(down).abs() > SHOWN => side * side.dot(down).signum(),
            _ => side,
        }
    }

    /// Returns the axes of their frame. The longer side of an opening of this size lies along them.
    fn axes(&self, nadir: DVec3, [across, along, _]: [f64; 3], turn: f64) -> [DVec3; 3] {
        let z = -nadir;
        let first = z.any_orthonormal_vector();
        let second = z.cross(first);
        // Second moments of the faces in the plane across the axis.
        let area = |[a, b, c]: &[DVec3; 3]| 0.5 * (*b - *a).cross(*c - *a).length();
        let weighted = self.corners.iter().map(|face| face.iter().sum::<DVec3>() * area(face));
        let middle = weighted.sum::<DVec3>() / (3.0 * self.area);
        let (mut uu, mut uv, mut vv) = (0.0, 0.0, 0.0);
        for face in &self.corners {
            let corners = face.map(|corner| corner - middle);
            let sum = corners[0] + corners[1] + corners[2];
            for point in corners.into_iter().chain([sum]) {
                let (u, v, weight) = (point.dot(first), point.dot(second), area(face));
                (uu, uv, vv) = (uu + weight * u * u, uv + weight * u * v, vv + weight * v * v);
            }
        }
        let is_long = (uu - vv).hypot(2.0 * uv) > 0.05 * (uu + vv);
        let angle = 0.5 * (2.0 * uv).atan2(uu - vv);
        let mut long = if is_long {
            first * angle.cos() + second * angle.sin()
        } else {
            let axis = if z.x.abs() > 0.9 { DVec3::Y } else { DVec3::X };
            (axis - z * axis.dot(z)).normalize_or(first)
        };
        // One of its two directions, the same for all luminaires of a row.
        let most = long.abs().max_position();
        if long[most] < 0.0 {
            long = -long;
        }
        let x = if is_long && along > across { long.cross(z) } else { long };
        let y = z.cross(x);
        let (sin, cos) = turn.to_radians().sin_cos();
        [x * cos + y * sin, y * cos - x * sin, z]
    }
}
