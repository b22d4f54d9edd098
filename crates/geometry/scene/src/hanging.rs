//! Luminaires in a scene: those that its faces are, and those that are hung in it.

use std::sync::Arc;

use glam::{DVec3, Vec3};
use holo_photometry::{OpeningMesh, PhotometricWeb};

use crate::additions::NewPart;
use crate::geometry::doubled_area_normal;
use crate::limits::MAX_RADIANCE;
use crate::luminaire::{Luminaire, LuminaireTable, MAX_LUMINAIRES};
use crate::units::EFFICACY;
use crate::{Bsdf, Material, Rgb, Scene, SceneError};

/// A luminaire that is to be hung in a scene.
#[derive(Clone, Debug)]
pub struct HungLuminaire {
    /// Its own name.
    pub name: String,
    /// The name of the luminaires that belong together.
    pub group: String,
    /// World coordinates of its zero.
    pub place: DVec3,
    /// The directions of its frame in the scene.
    pub axes: [DVec3; 3],
    /// Its luminous intensity in that frame.
    pub web: Arc<PhotometricWeb>,
    /// What of it shines, metres.
    pub mesh: Arc<OpeningMesh>,
    /// The colour of its light, whose luminance is 1.
    pub colour: Rgb,
}

impl Scene {
    /// Returns its luminaires.
    #[must_use]
    pub fn luminaires(&self) -> &[Luminaire] {
        self.luminaires.as_ref().map_or(&[], |table| &table.all)
    }

    /// Returns the luminaire whose faces have a material.
    #[must_use]
    #[inline]
    pub fn luminaire_of(&self, material: u32) -> Option<&Luminaire> {
        let table = self.luminaires.as_ref()?;
        table.all.get(table.place(material)?)
    }

    /// Returns the greatest radiance of each material in each channel, W·sr⁻¹·m⁻².
    pub fn brightest_emissions(&self) -> impl Iterator<Item = Rgb> {
        let count = self.luminaires().len();
        (0..).zip(&self.materials).map(move |(id, material)| {
            let share = self.luminaire_of(id).map_or(1.0, |lamp| lamp.greatest_share(count));
            material.emission.map(|channel| channel * share)
        })
    }

    /// Gives the scene these luminaires instead of its own. Their faces exist.
    ///
    /// # Errors
    /// [`SceneError::Luminaire`] if a material does not exist or has two luminaires, or axes are
    /// not orthonormal. [`SceneError::Limit`] if there are more than [`MAX_LUMINAIRES`].
    pub fn with_luminaires(mut self, all: Vec<Luminaire>) -> Result<Scene, SceneError> {
        self.luminaires = None;
        if all.is_empty() {
            return Ok(self);
        }
        if all.len() > MAX_LUMINAIRES {
            let (count, limit) = (all.len() as u64, MAX_LUMINAIRES as u64);
            return Err(SceneError::Limit { what: "luminaires", count, limit });
        }
        let mut table =
            LuminaireTable::new(all, self.materials.len()).map_err(SceneError::Luminaire)?;
        let mut areas = vec![Vec::new(); table.all.len()];
        for triangle in self.emitters() {
            let material = self.material_id(triangle);
            if let Some(at) = table.place(material) {
                let area = doubled_area_normal(self.corners(triangle)).unwrap_or_default() * 0.5;
                areas[at].push(area.as_vec3());
                if self.materials[material as usize].two_sided_emission {
                    areas[at].push(-area.as_vec3());
                }
            }
        }
        table.all.iter_mut().zip(areas).for_each(|(luminaire, areas)| luminaire.set_faces(areas));
        self.luminaires = Some(Box::new(table));
        Ok(self)
    }

    /// Hangs luminaires in the scene, whose unit has this length in metres.
    ///
    /// # Errors
    /// As [`with_luminaires`](Self::with_luminaires). [`SceneError::Luminaire`] also if one is so
    /// far away that its faces vanish in rounding.
    pub fn with_luminaires_hung(
        self,
        hung: &[HungLuminaire],
        unit: f64,
    ) -> Result<Scene, SceneError> {
        let first = self.materials.len();
        let (mut parts, mut all) = (Vec::with_capacity(hung.len()), self.luminaires().to_vec());
        for (at, luminaire) in hung.iter().enumerate() {
            let part = luminaire.part(self.origin, unit);
            parts.push(part.ok_or(SceneError::Luminaire(at))?);
            let material = (first + at) as u32;
            let names = [luminaire.name.clone(), luminaire.group.clone()];
            let axes = luminaire.axes.map(|axis| axis.as_vec3());
            all.push(Luminaire::new(names, material, axes, luminaire.web.clone()));
        }
        self.with_parts(parts)?.with_luminaires(all)
    }
}

/// Returns the emission of an even lamp, from its flux in lumens, its area in square metres and its
/// colour.
pub(crate) fn even_emission(flux: f64, area: f64, colour: Rgb) -> Rgb {
    let radiance = flux / (std::f64::consts::PI * area * EFFICACY);
    colour.map(|channel| (radiance * f64::from(channel)).min(f64::from(MAX_RADIANCE)) as f32)
}

impl HungLuminaire {
    /// Returns its faces, around an origin. `None` if they vanish.
    fn part(&self, origin: DVec3, unit: f64) -> Option<NewPart> {
        let [x, y, z] = self.axes;
        let place = |corner: &DVec3| {
            let corner = *corner / unit;
            let offset = x * corner.x + y * corner.y + z * corner.z;
            (self.place - origin + offset).as_vec3()
        };
        let corners: Vec<Vec3> = self.mesh.corners.iter().map(place).collect();
        let area = |triangle: &[u32; 3]| {
            doubled_area_normal(triangle.map(|corner| corners[corner as usize]))
        };
        let sides = if self.mesh.is_two_sided { 2.0 } else { 1.0 };
        let whole: f64 =
            self.mesh.triangles.iter().filter_map(area).map(|n| 0.5 * n.length()).sum();
        let triangles: Vec<[u32; 3]> =
            self.mesh.triangles.iter().copied().filter(|t| area(t).is_some()).collect();
        let emission = even_emission(self.web.flux(), sides * whole * unit * unit, self.colour);
        let material = Material {
            name: self.name.clone(),
            bsdf: Bsdf::Diffuse { kd: [0.0; 3] },
            emission,
            two_sided_emission: self.mesh.is_two_sided,
        };
        let corners = corners.into_iter().map(|corner| corner.to_array()).collect();
        (whole > 0.0).then_some(NewPart { corners, triangles, material })
    }
}
