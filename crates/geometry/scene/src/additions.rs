//! Adding to a scene: faces of new materials, and whole models.
//!
//! Invariant: what is added has the last numbers of the scene's own triangles and of its materials.
//! All other triangles stay in their order, and all other materials keep their numbers.

use std::iter::repeat_n;
use std::sync::Arc;

use glam::{DMat3, DVec3, Vec3};
use holo_mapped::Array;

use crate::assemble::without;
use crate::geometry::doubled_area_normal;
use crate::limits::MAX_NAME_BYTES;
use crate::{
    Cover, Luminaire, Maps, Material, Placement, PunctualBeam, PunctualLight, Scene, SceneError,
    Shading, WHITE,
};

/// Triangles of a new material. Their corners are relative to the scene's origin.
pub(crate) struct NewPart {
    pub corners: Vec<[f32; 3]>,
    /// Indices into `corners`.
    pub triangles: Vec<[u32; 3]>,
    pub material: Material,
}

/// Triangles of new materials.
#[derive(Default)]
struct Addition {
    /// Corners, relative to the scene's origin.
    positions: Vec<[f32; 3]>,
    /// Indices into `positions`.
    triangles: Vec<[u32; 3]>,
    /// Indices into `materials`.
    material_ids: Vec<u32>,
    materials: Vec<Material>,
    /// Attributes of these triangles and materials.
    shading: Shading,
}

impl Scene {
    /// Adds triangles of a new material. `corners` are relative to the origin; a corner's index
    /// counts from the first one. The triangles have no texture and no smooth normals.
    ///
    /// # Errors
    /// As [`Scene::new`].
    pub fn with_faces(
        self,
        corners: &[[f32; 3]],
        triangles: &[[u32; 3]],
        material: Material,
    ) -> Result<Scene, SceneError> {
        let (corners, triangles) = (corners.to_vec(), triangles.to_vec());
        self.with_parts(vec![NewPart { corners, triangles, material }])
    }

    /// Adds parts, as [`with_faces`](Self::with_faces) adds one.
    pub(crate) fn with_parts(self, parts: Vec<NewPart>) -> Result<Scene, SceneError> {
        let mut new = Addition::default();
        for (id, part) in (0..).zip(parts) {
            let first = new.positions.len() as u32;
            new.triangles.extend(part.triangles.iter().map(|t| t.map(|corner| first + corner)));
            new.positions.extend(part.corners);
            new.material_ids.extend(repeat_n(id, part.triangles.len()));
            new.materials.push(part.material);
        }
        self.with_addition(new)
    }

    /// Adds a copy of a model, with its materials, textures and lamps. `to_world` are the rows of
    /// the map from the model's world coordinates to this scene's: turned, enlarged evenly, and
    /// moved. `name` and a slash stand before the names of its materials and lamps, so that none
    /// has two meanings.
    ///
    /// Surfaces keep their radiance, and a punctual light has the square of the factor of size as
    /// much intensity: what it lights keeps its irradiance. Triangles that rounding leaves without
    /// area are left out. The model's sky and suns are not added.
    ///
    /// # Errors
    /// As [`Scene::new`], and [`SceneError::Object`] if the model vanishes at this place.
    pub fn with_object(
        self,
        name: &str,
        model: &Scene,
        to_world: &[[f64; 4]; 3],
    ) -> Result<Scene, SceneError> {
        let vanishes = || SceneError::Object { name: name.chars().take(64).collect() };
        let place = ObjectPlace::new(model.origin, to_world, self.origin).ok_or_else(vanishes)?;
        let mut new = place.of_triangles(&model.flattened());
        if new.triangles.is_empty() {
            return Err(vanishes());
        }
        let first = self.materials.len() as u32;
        let prefix = prefix(&self, name);
        let named = |name: &String| shortened(&format!("{prefix}{name}"), MAX_NAME_BYTES);
        let group = |name: &String| if name.is_empty() { String::new() } else { named(name) };
        new.materials.iter_mut().for_each(|material| material.name = named(&material.name));
        let mut lights = self.punctual_lights.clone();
        lights.extend(model.punctual_lights.iter().map(|light| PunctualLight {
            name: named(&light.name),
            group: group(&light.group),
            ..place.of_light(light)
        }));
        let mut luminaires = self.luminaires().to_vec();
        luminaires.extend(model.luminaires().iter().map(|luminaire| {
            let axes = luminaire.axes.map(|axis| place.direction(axis.into()));
            let names = [named(&luminaire.name), group(&luminaire.group)];
            Luminaire::new(names, first + luminaire.material, axes, Arc::clone(&luminaire.web))
        }));
        self.with_addition(new)?.with_punctual_lights(lights)?.with_luminaires(luminaires)
    }

    fn with_addition(mut self, new: Addition) -> Result<Scene, SceneError> {
        // The arrays of shared meshes come after the scene's own triangles.
        let (positions, at) = (self.own().positions.len(), self.own().triangles.len());
        let (corners, count) = (new.positions.len(), new.triangles.len());
        let of_triangles = Joint { at, before: self.triangles.len(), count };
        let materials = self.materials.len();
        let of_materials = Joint { at: materials, before: materials, count: new.materials.len() };
        let moved = new.triangles.iter().map(|t| t.map(|corner| positions as u32 + corner));
        self.triangles.to_mut().splice(at..at, moved);
        self.positions.to_mut().splice(positions..positions, new.positions);
        let ids = new.material_ids.iter().map(|id| materials as u32 + id);
        self.material_ids.to_mut().splice(at..at, ids);
        self.materials.extend(new.materials);
        let shading = join_shading(self.shading.take(), new.shading, of_triangles, of_materials);
        if let Some(shared) = &mut self.shared {
            shared.shift(corners, count)?;
        }
        match shading {
            Some(shading) => self.validated()?.with_shading(shading),
            None => self.validated(),
        }
    }
}

/// Where an array takes the values of what is added.
#[derive(Clone, Copy)]
struct Joint {
    at: usize,
    /// Number of values of the scene.
    before: usize,
    /// Number of values that are added.
    count: usize,
}

impl Joint {
    /// Joins two arrays of a scene as [`join`](Self::join).
    fn join_arrays<T: Clone>(self, all: &mut Array<T>, mut new: Array<T>, usual: T) {
        if !(all.is_empty() && new.is_empty()) {
            self.join(all.to_mut(), std::mem::take(new.to_mut()), usual);
        }
    }

    /// Joins two arrays, each of which may be empty because all its values are `usual`.
    fn join<T: Clone>(self, all: &mut Vec<T>, mut new: Vec<T>, usual: T) {
        if all.is_empty() && new.is_empty() {
            return;
        }
        if all.is_empty() {
            all.resize(self.before, usual.clone());
        }
        if new.is_empty() {
            new.resize(self.count, usual);
        }
        let at = self.at.min(all.len());
        all.splice(at..at, new);
    }
}

/// Joins the attributes of a scene and of what is added. `None` if neither has any.
fn join_shading(
    of_scene: Option<Box<Shading>>,
    new: Shading,
    of_triangles: Joint,
    of_materials: Joint,
) -> Option<Shading> {
    if of_scene.is_none() && new == Shading::default() {
        return None;
    }
    let mut all = of_scene.map(|shading| *shading).unwrap_or_default();
    let textures = all.textures.len() as u32;
    let maps = new.maps.into_iter().map(|maps| maps.moved(textures)).collect();
    let covers = new.covers.into_iter().map(|cover| cover.moved(textures)).collect();
    of_triangles.join_arrays(&mut all.uvs, new.uvs, [[0.0; 2]; 3]);
    // Equal normals are those of facets.
    of_triangles.join_arrays(&mut all.normals, new.normals, [[0; 2]; 3]);
    of_triangles.join_arrays(&mut all.colours, new.colours, [WHITE; 3]);
    of_triangles.join_arrays(&mut all.opacities, new.opacities, [u8::MAX; 3]);
    of_materials.join(&mut all.maps, maps, Maps::default());
    of_materials.join(&mut all.covers, covers, Cover::default());
    all.textures.extend(new.textures);
    Some(all)
}

/// The place of a model in a scene.
struct ObjectPlace {
    /// From coordinates relative to the model's origin to those relative to the scene's.
    placement: Placement,
    turn: DMat3,
    scale: f64,
}

impl ObjectPlace {
    /// Returns `None` if the map is not finite, mirrors, or stretches too much.
    fn new(from: DVec3, to_world: &[[f64; 4]; 3], to: DVec3) -> Option<ObjectPlace> {
        let relative = |axis: usize| {
            let [x, y, z, sum] = to_world[axis];
            [x, y, z, DVec3::new(x, y, z).dot(from) + sum - to[axis]]
        };
        let placement = Placement::new([relative(0), relative(1), relative(2)])?;
        if placement.is_mirrored() {
            return None;
        }
        let map = DMat3::from_cols_array_2d(&to_world.map(|[x, y, z, _]| [x, y, z])).transpose();
        let scale = map.determinant().abs().cbrt();
        Some(ObjectPlace { placement, turn: map * scale.recip(), scale })
    }

    fn direction(&self, direction: Vec3) -> Vec3 {
        (self.turn * direction.as_dvec3()).normalize_or_zero().as_vec3()
    }

    /// Returns the triangles of a model without instances, except those without area.
    fn of_triangles(&self, model: &Scene) -> Addition {
        let place = |&position: &[f32; 3]| self.placement.point(position).to_array();
        let positions: Vec<[f32; 3]> = model.positions.iter().map(place).collect();
        let corners = |triangle: [u32; 3]| triangle.map(|c| Vec3::from(positions[c as usize]));
        let is_flat =
            |&triangle: &usize| doubled_area_normal(corners(model.triangles[triangle])).is_none();
        let flat: Vec<usize> = (0..model.triangles.len()).filter(is_flat).collect();
        let mut shading = model.shading.as_deref().cloned().unwrap_or_default();
        for (normals, triangle) in shading.normals.to_mut().iter_mut().zip(&model.triangles) {
            let corners = triangle.map(|corner| model.positions[corner as usize]);
            *normals = self.placement.normals(corners, *normals);
        }
        let is_kept = |&(triangle, _): &(usize, _)| flat.binary_search(&triangle).is_err();
        let kept = model.triangles.iter().zip(&model.material_ids).enumerate().filter(is_kept);
        let (triangles, material_ids) = kept.map(|(_, (&corners, &id))| (corners, id)).unzip();
        let materials = model.materials.clone();
        let shading = without(shading, &flat);
        Addition { positions, triangles, material_ids, materials, shading }
    }

    fn of_light(&self, light: &PunctualLight) -> PunctualLight {
        let radius = light.radius * self.scale as f32;
        let most = PunctualLight::greatest_intensity(radius);
        let beam = match light.beam {
            PunctualBeam::Everywhere => PunctualBeam::Everywhere,
            PunctualBeam::Cone { axis, inner, outer } => {
                let axis = self.direction(axis.into()).to_array();
                PunctualBeam::Cone { axis, inner, outer }
            }
        };
        let factor = (self.scale * self.scale) as f32;
        PunctualLight {
            position: self.placement.point(light.position).to_array(),
            intensity: light.intensity.map(|channel| (channel * factor).min(most)),
            radius,
            beam,
            ..light.clone()
        }
    }
}

/// Returns the prefix of the names of an object's materials and lamps. It is the object's name and
/// a slash, with a number if the scene has such names.
fn prefix(scene: &Scene, object: &str) -> String {
    let object = shortened(object, MAX_NAME_BYTES / 2);
    let materials = scene.materials.iter().map(|material| &material.name);
    let points = scene.punctual_lights.iter().flat_map(|light| [&light.name, &light.group]);
    let hung = scene.luminaires().iter().flat_map(|lamp| [&lamp.name, &lamp.group]);
    let taken: Vec<&String> = materials.chain(points).chain(hung).collect();
    let is_free = |prefix: &String| !taken.iter().any(|name| name.starts_with(prefix));
    let mut numbered = (2..).map(|number: u32| format!("{object} {number}/"));
    let plain = format!("{object}/");
    if is_free(&plain) { plain } else { numbered.find(is_free).unwrap_or(plain) }
}

/// Returns the first bytes of a text, in whole letters.
fn shortened(text: &str, bytes: usize) -> String {
    let end = (0..=bytes.min(text.len())).rev().find(|&end| text.is_char_boundary(end));
    text[..end.unwrap_or(0)].to_owned()
}
