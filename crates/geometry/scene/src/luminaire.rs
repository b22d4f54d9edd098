//! Luminaires: lamps whose light differs by direction as a photometric file says.
//!
//! The faces of a luminaire have a material of their own. Its emission is that of an even lamp of
//! the same flux, and [`Luminaire::share`] says how the radiance in a direction differs from it.
//!
//! Invariants:
//! - Far away, a luminaire's faces together have the intensity of its web in every direction from
//!   which they are seen. The radiance of all of them is the intensity over the area that is seen.
//! - A material belongs to one luminaire at most.

use std::collections::HashMap;
use std::sync::Arc;

use glam::Vec3;
use holo_photometry::PhotometricWeb;

use crate::limits::{MAX_MATERIALS, MAX_NAME_BYTES};

/// Most luminaires of a scene. Each has a material.
pub const MAX_LUMINAIRES: usize = MAX_MATERIALS;

/// Least area that is seen of a luminaire, over its whole area: at grazing angles a flat one would
/// be infinitely bright.
const LEAST_SEEN: f32 = 5e-4;

/// Most normals that faces of a luminaire are sorted by. A round one has twelve.
const MAX_NORMALS: usize = 128;

/// Directions in which the greatest radiance of a scene's luminaires is looked for: 0.3 s of work.
const LOOKS_OF_ALL: usize = 1 << 22;

/// A lamp whose light differs by direction.
#[derive(Clone, Debug)]
pub struct Luminaire {
    /// Its own name.
    pub name: String,
    /// The name of the luminaires that belong together, such as all of one type.
    pub group: String,
    /// The material of its faces.
    pub material: u32,
    /// The directions of its frame in the scene: x (C0), y (C90), and -nadir.
    pub axes: [[f32; 3]; 3],
    /// Its luminous intensity in that frame.
    pub web: Arc<PhotometricWeb>,
    /// Sums of its faces' normals times their areas.
    faces: Vec<Vec3>,
    /// Area of all sides that shine.
    area: f32,
    /// π over the web's flux.
    per_flux: f32,
}

impl PartialEq for Luminaire {
    /// Compares what is stated. The faces follow from the scene.
    fn eq(&self, other: &Luminaire) -> bool {
        let facts = |l: &Luminaire| (l.name.clone(), l.group.clone(), l.material, l.axes);
        facts(self) == facts(other) && self.web == other.web
    }
}

/// All luminaires of a scene.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LuminaireTable {
    pub all: Vec<Luminaire>,
    /// Place in `all` of each material's luminaire, plus one; 0 for other materials.
    of_material: Vec<u32>,
}

impl Luminaire {
    fn is_valid(&self) -> bool {
        let [x, y, z] = self.axes.map(Vec3::from);
        self.name.len().max(self.group.len()) <= MAX_NAME_BYTES
            && [x, y, z].iter().all(|axis| (axis.length() - 1.0).abs() < 1e-3)
            && x.cross(y).distance(z) < 1e-3
    }

    /// Gives it the normals of its faces times their areas.
    pub(crate) fn set_faces(&mut self, areas: Vec<Vec3>) {
        self.area = areas.iter().map(|area| area.length()).sum();
        self.faces = sorted_by_normal(areas);
    }

    /// Makes a luminaire whose faces have a material.
    pub fn new(
        [name, group]: [String; 2],
        material: u32,
        axes: [Vec3; 3],
        web: Arc<PhotometricWeb>,
    ) -> Luminaire {
        let axes = axes.map(|axis| axis.to_array());
        let per_flux = (std::f64::consts::PI / web.flux()) as f32;
        Luminaire { name, group, material, axes, web, faces: Vec::new(), area: 0.0, per_flux }
    }

    /// Returns the radiance in a unit direction away from the luminaire, over its material's
    /// emission.
    #[must_use]
    pub fn share(&self, away: Vec3) -> f32 {
        let local = self.axes.map(|axis| Vec3::from(axis).dot(away));
        let intensity = self.web.intensity(local.into());
        if intensity <= 0.0 {
            return 0.0;
        }
        let seen: f32 = self.faces.iter().map(|face| face.dot(away).max(0.0)).sum();
        let share = intensity * self.per_flux * self.area / seen.max(LEAST_SEEN * self.area);
        if share.is_finite() { share } else { 0.0 }
    }

    /// Returns a share that its light does not exceed by far. It is looked for in the web's
    /// brightest direction and in a share of the directions that are looked at for `count`
    /// luminaires.
    #[must_use]
    pub fn greatest_share(&self, count: usize) -> f32 {
        let looks = (LOOKS_OF_ALL / count.max(1)).clamp(1 << 10, 1 << 16);
        // A spiral, and rings just below and above the horizon of the frame, where flat lamps are
        // brightest.
        let golden = std::f32::consts::PI * (3.0 - 5_f32.sqrt());
        let spiral = (0..looks / 2).map(|at| {
            let z = 1.0 - (2.0 * at as f32 + 1.0) / (looks / 2) as f32;
            (z, golden * at as f32)
        });
        let rings = (0..looks / 4).flat_map(|at| {
            let turn = std::f32::consts::TAU * at as f32 / (looks / 4) as f32;
            [(-LEAST_SEEN, turn), (LEAST_SEEN, turn)]
        });
        let [x, y, z] = self.axes.map(Vec3::from);
        let share = |(height, turn): (f32, f32)| {
            let (sin, cos) = turn.sin_cos();
            let level = (1.0 - height * height).max(0.0).sqrt();
            self.share(x * (level * cos) + y * (level * sin) + z * height)
        };
        let [along, across, behind] = self.web.brightest().to_array();
        let brightest = self.share(x * along + y * across + z * behind);
        spiral.chain(rings).chain([(-1.0, 0.0), (1.0, 0.0)]).map(share).fold(brightest, f32::max)
    }
}

impl LuminaireTable {
    /// Makes the table of a scene with so many materials. The error is the place of a luminaire
    /// whose material does not exist or has two.
    pub(crate) fn new(all: Vec<Luminaire>, materials: usize) -> Result<LuminaireTable, usize> {
        let mut of_material = vec![0; materials];
        for (at, luminaire) in all.iter().enumerate() {
            match of_material.get_mut(luminaire.material as usize).filter(|place| **place == 0) {
                Some(place) if luminaire.is_valid() => *place = at as u32 + 1,
                _ => return Err(at),
            }
        }
        Ok(LuminaireTable { all, of_material })
    }

    /// Returns the place in `all` of a material's luminaire.
    #[inline]
    pub(crate) fn place(&self, material: u32) -> Option<usize> {
        (*self.of_material.get(material as usize)? as usize).checked_sub(1)
    }
}

/// Adds up the areas of faces with nearly the same normal.
fn sorted_by_normal(areas: Vec<Vec3>) -> Vec<Vec3> {
    let mut sorted = Vec::new();
    for steps in [512.0, 8.0_f32] {
        let mut places = HashMap::new();
        sorted.clear();
        for &area in &areas {
            let normal = area.normalize_or_zero() * steps;
            let key = normal.round().as_ivec3();
            let place = *places.entry(key).or_insert(sorted.len());
            if place == sorted.len() {
                sorted.push(Vec3::ZERO);
            }
            sorted[place] += area;
        }
        if sorted.len() <= MAX_NORMALS {
            break;
        }
    }
    sorted
}
