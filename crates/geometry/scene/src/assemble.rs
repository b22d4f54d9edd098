//! Makes a scene of what a reader found in a file.

use glam::{DMat4, DVec3, Vec3};

use crate::geometry::{Geometry, doubled_area_normal, world_bounds};
use crate::limits::{MAX_REPEATED, MAX_THIN_TRIANGLES};
use crate::model::{Model, SharedMesh};
use crate::placement::Placement;
use crate::thin::Shapes;
use crate::{PunctualLight, Rgb, Scene, SceneError, Shading};

/// A scene, and the triangles of the model that were left out because they have no area.
pub(crate) struct Assembled {
    pub scene: Scene,
    /// Triangles of [`Model::triangles`], in order.
    pub left_out: Vec<usize>,
    /// Number of triangles of shared meshes that were left out, each once.
    pub left_out_of_meshes: usize,
}

/// Makes a scene of a model.
pub(crate) fn assemble(mut model: Model, sky: Rgb) -> Result<Assembled, SceneError> {
    let left_out_of_meshes = model.meshes.iter_mut().map(without_flat_triangles).sum();
    let (mut low, mut high) = world_bounds(&model.positions, &model.triangles)?;
    for (mesh, matrix) in &model.placements {
        for &position in &model.meshes[*mesh as usize].positions {
            let place = matrix.transform_point3(Vec3::from(position).as_dvec3());
            (low, high) = (low.min(place), high.max(place));
        }
    }
    let origin = if low.x > high.x { DVec3::ZERO } else { low + (high - low) * 0.5 };
    let punctual_lights = placed_lights(&mut model, origin, (high - low).length());
    let instances = instances(&mut model, origin)?;
    let Model { positions, triangles, material_ids, materials, shading, meshes, .. } = model;
    let (scene, left_out) =
        Scene::around(origin, &positions, &triangles, &material_ids, materials, sky)?;
    drop((positions, triangles, material_ids));
    let geometry: Vec<Geometry> = meshes.iter().map(SharedMesh::geometry).collect();
    let scene = scene.with_instances(&geometry, &instances)?;
    let mut shading = without(shading, &left_out);
    for mesh in meshes {
        shading.uvs.extend(mesh.shading.uvs.iter().copied());
        shading.normals.extend(mesh.shading.normals.iter().copied());
        shading.colours.extend(mesh.shading.colours.iter().copied());
        shading.opacities.extend(mesh.shading.opacities.iter().copied());
    }
    let scene = scene.with_shading(shading)?.with_suns(model.suns)?;
    let scene = scene.with_punctual_lights(punctual_lights)?;
    Ok(Assembled { scene, left_out, left_out_of_meshes })
}

/// Greatest radius of a punctual light's sphere, in scene units, and over the scene's diagonal.
const GREATEST_RADIUS: f64 = 0.01;
const GREATEST_SHARE: f64 = 1e-3;

/// Returns the punctual lights, with places relative to an origin and with their radius.
fn placed_lights(model: &mut Model, origin: DVec3, diagonal: f64) -> Vec<PunctualLight> {
    let radius = if diagonal > 0.0 { GREATEST_SHARE * diagonal } else { GREATEST_RADIUS };
    let radius = radius.min(GREATEST_RADIUS) as f32;
    let most = PunctualLight::greatest_intensity(radius);
    let lights = std::mem::take(&mut model.punctual_lights).into_iter();
    let placed = lights.map(|(place, light)| PunctualLight {
        position: (place - origin).as_vec3().to_array(),
        intensity: light.intensity.map(|c| c.min(most)),
        radius,
        ..light
    });
    placed.collect()
}

/// Leaves out a mesh's triangles without area and the positions that it does not use. Returns the
/// number of triangles that were left out.
fn without_flat_triangles(mesh: &mut SharedMesh) -> usize {
    let corners =
        |triangle: [u32; 3]| triangle.map(|corner| Vec3::from(mesh.positions[corner as usize]));
    let is_flat =
        |&triangle: &usize| doubled_area_normal(corners(mesh.triangles[triangle])).is_none();
    let flat: Vec<usize> = (0..mesh.triangles.len()).filter(is_flat).collect();
    keep(&mut mesh.triangles, &flat);
    keep(&mut mesh.material_ids, &flat);
    mesh.shading = without(std::mem::take(&mut mesh.shading), &flat);
    let mut number = vec![u32::MAX; mesh.positions.len()];
    let mut used = Vec::with_capacity(mesh.positions.len());
    for corner in mesh.triangles.as_flattened_mut() {
        let number = &mut number[*corner as usize];
        if *number == u32::MAX {
            *number = used.len() as u32;
            used.push(mesh.positions[*corner as usize]);
        }
        *corner = *number;
    }
    mesh.positions = used;
    flat.len()
}

/// Returns the instances, with places relative to an origin. Placements with a triangle that
/// rounding leaves without area are copied to the model's own triangles. Removes meshes without an
/// instance.
fn instances(model: &mut Model, origin: DVec3) -> Result<Vec<(u32, Placement)>, SceneError> {
    let placements = std::mem::take(&mut model.placements);
    let possible: Vec<Option<Placement>> =
        placements.iter().map(|&(_, matrix)| placement(matrix, origin)).collect();
    let geometry: Vec<Geometry> = model.meshes.iter().map(SharedMesh::geometry).collect();
    let both = || placements.iter().zip(&possible);
    let shapes =
        Shapes::new(&geometry, both().filter_map(|(&(mesh, _), p)| Some((mesh, p.as_ref()?))));
    let (mut instances, mut copies) = (Vec::with_capacity(placements.len()), Vec::new());
    let (mut copied, mut tested) = (0, 0);
    for (&(mesh, matrix), &placement) in both() {
        let source = &geometry[mesh as usize];
        let fits = |placement: &Placement| {
            tested += shapes.tests(mesh, placement);
            tested <= MAX_THIN_TRIANGLES && shapes.fault(mesh, placement).is_none()
        };
        match placement.filter(fits) {
            Some(_) if source.triangles.is_empty() => {}
            Some(placement) => instances.push((mesh, placement)),
            None => {
                copied += source.positions.len() as u64 + 3 * source.triangles.len() as u64;
                copies.push((mesh, matrix));
            }
        }
    }
    if copied > MAX_REPEATED {
        let what = "positions and corners of meshes that must be copied";
        return Err(SceneError::Limit { what, count: copied, limit: MAX_REPEATED });
    }
    copies.into_iter().for_each(|(mesh, matrix)| copy(model, mesh as usize, matrix));
    let mut number = vec![None; model.meshes.len()];
    let mut used = Vec::new();
    for (mesh, _) in &mut instances {
        let old = std::mem::replace(mesh, 0) as usize;
        *mesh = *number[old].get_or_insert_with(|| {
            used.push(std::mem::take(&mut model.meshes[old]));
            used.len() as u32 - 1
        });
    }
    model.meshes = used;
    Ok(instances)
}

/// Returns the placement of a matrix to world coordinates. `None` if it is not possible.
pub(crate) fn placement(matrix: DMat4, origin: DVec3) -> Option<Placement> {
    let sum = matrix.w_axis.truncate() - origin;
    Placement::new(
        [0, 1, 2]
            .map(|axis| [matrix.x_axis[axis], matrix.y_axis[axis], matrix.z_axis[axis], sum[axis]]),
    )
}

/// Adds a copy of a mesh to the model's own triangles.
fn copy(model: &mut Model, mesh: usize, matrix: DMat4) {
    let Some(placement) = placement(matrix, DVec3::ZERO) else { return };
    let mesh = &model.meshes[mesh];
    let first = model.positions.len() as u32;
    let place = |&p: &[f32; 3]| matrix.transform_point3(Vec3::from(p).as_dvec3());
    model.positions.extend(mesh.positions.iter().map(place));
    let moved = |t: &[u32; 3]| placement.ordered(t.map(|corner| first + corner));
    model.triangles.extend(mesh.triangles.iter().map(moved));
    model.material_ids.extend(&mesh.material_ids);
    let (to, from) = (&mut model.shading, &mesh.shading);
    to.uvs.extend(from.uvs.iter().map(|&uvs| placement.ordered(uvs)));
    to.colours.extend(from.colours.iter().map(|&colours| placement.ordered(colours)));
    to.opacities.extend(from.opacities.iter().map(|&corners| placement.ordered(corners)));
    let normals = mesh.triangles.iter().zip(&from.normals);
    to.normals.extend(normals.map(|(corners, &normals)| {
        let corners = corners.map(|corner| mesh.positions[corner as usize]);
        placement.normals(corners, normals)
    }));
}

/// Removes triangles from a shading.
pub(crate) fn without(mut shading: Shading, left_out: &[usize]) -> Shading {
    keep(shading.uvs.to_mut(), left_out);
    keep(shading.normals.to_mut(), left_out);
    keep(shading.colours.to_mut(), left_out);
    keep(shading.opacities.to_mut(), left_out);
    shading
}

/// Removes the values of triangles that are left out.
fn keep<T>(all: &mut Vec<T>, left_out: &[usize]) {
    let (mut triangle, mut left_out) = (0, left_out.iter().peekable());
    all.retain(|_| {
        triangle += 1;
        left_out.next_if(|&&out| out == triangle - 1).is_none()
    });
}
