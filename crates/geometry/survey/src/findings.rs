//! Peculiarities of a scene: their number, their place, and their effect on pictures.

use std::collections::HashMap;

use glam::Vec3;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};

/// A peculiarity of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Its kind, such as `open edges`.
    pub kind: &'static str,
    /// The number of cases.
    pub count: usize,
    /// World coordinates of the first case.
    pub at: Option<[f64; 3]>,
    /// The material of the first case, if the finding is about materials.
    pub material: Option<String>,
    /// Its effect on pictures.
    pub means: &'static str,
}

/// Shares of the scene's size below which triangles and parts are very small.
const TINY: f32 = 1e-6;
const SMALL_PART: f64 = 1e-4;

/// Share of the scene's size from which a triangle is very large, if all others are within a tenth.
const LONG: f64 = 0.5;

/// Albedo from which a closed room stays noisy for a long time.
const WHITE: f32 = 0.95;

/// An edge between two places, the same in both directions.
type Edge = [[u32; 3]; 2];

/// Returns the peculiarities of a scene, in a fixed order.
#[must_use]
pub fn findings(raycaster: &Raycaster) -> Vec<Finding> {
    let scene: &Scene = raycaster.scene();
    let mut found = Vec::new();
    coincident(raycaster, &mut found);
    edges(scene, &mut found);
    sizes(scene, &mut found);
    materials(scene, &mut found);
    found
}

/// Returns the memory of a scene in bytes, including textures.
#[must_use]
pub fn memory(scene: &Scene) -> usize {
    let shading = scene.shading.as_ref().map_or(0, |shading| {
        let textures: usize = shading.textures.iter().map(holo_scene::Texture::bytes).sum();
        let corners =
            [24 * shading.uvs.len(), 12 * shading.normals.len(), 9 * shading.colours.len()];
        corners.iter().sum::<usize>() + textures
    });
    scene.geometry_bytes() + shading
}

fn bits(p: Vec3) -> [u32; 3] {
    // Adding 0 makes -0 and 0 the same place.
    (p + Vec3::ZERO).to_array().map(f32::to_bits)
}

fn place(scene: &Scene, triangle: u32) -> Option<[f64; 3]> {
    let middle = scene.corners(triangle).iter().sum::<Vec3>() / 3.0;
    Some((scene.origin + middle.as_dvec3()).to_array())
}

fn all(scene: &Scene) -> std::ops::Range<u32> {
    scene.triangles()
}

/// Finds faces at one place: those with the same corners, and those that are cut differently.
fn coincident(raycaster: &Raycaster, found: &mut Vec<Finding>) {
    let scene: &Scene = raycaster.scene();
    let key = |triangle: u32| {
        let mut corners = scene.corners(triangle).map(bits);
        corners.sort_unstable();
        corners
    };
    let mut known: HashMap<[[u32; 3]; 3], u32> = HashMap::new();
    let mut first = None;
    let mut count = 0;
    for triangle in all(scene) {
        let times = known.entry(key(triangle)).or_default();
        *times += 1;
        if *times > 1 {
            count += 1;
            first.get_or_insert(triangle);
        }
    }
    let means = "of two faces at one place, rays meet the one that faces them, then the lamp, then \
                 the first in the file: the other's colour and light do not show there";
    push(found, "duplicate faces", count, first.and_then(|t| place(scene, t)), None, means);
    let mut others = raycaster.coincident();
    others.retain(|&triangle| known.get(&key(triangle)) == Some(&1));
    let first = others.first().and_then(|&t| place(scene, t));
    push(found, "overlapping faces in one plane", others.len(), first, None, means);
}

/// The directions in which faces traverse an edge.
#[derive(Default)]
struct Walked {
    forwards: u32,
    backwards: u32,
    triangle: u32,
}

fn edges(scene: &Scene, found: &mut Vec<Finding>) {
    let mut walked: HashMap<Edge, Walked> = HashMap::new();
    for triangle in all(scene) {
        let corners = scene.corners(triangle).map(bits);
        for k in 0..3 {
            let (from, to) = (corners[k], corners[(k + 1) % 3]);
            let edge = walked.entry([from.min(to), from.max(to)]).or_default();
            edge.triangle = edge.triangle.max(triangle);
            if from < to { edge.forwards += 1 } else { edge.backwards += 1 }
        }
    }
    // The first is chosen by its triangle, because a hash map has no order.
    let sum = |is_odd: fn(&Walked) -> bool| {
        let odd = walked.values().filter(|edge| is_odd(edge));
        let first = odd.clone().map(|edge| edge.triangle).min();
        (odd.count(), first.and_then(|triangle| place(scene, triangle)))
    };
    let (count, at) = sum(|edge| edge.forwards + edge.backwards == 1);
    let means =
        "surfaces end there: light passes beside them, and glass with open edges is no solid";
    push(found, "open edges", count, at, None, means);
    let (count, at) = sum(|edge| edge.forwards + edge.backwards == 2 && edge.forwards != 1);
    let means = "neighbours face opposite ways: lamps shine from one side only (--two-sided-lights), \
                 and solid glass needs its fronts outside";
    push(found, "edges whose faces are turned round", count, at, None, means);
}

fn sizes(scene: &Scene, found: &mut Vec<Finding>) {
    let (low, high) = scene.bounds();
    let size = (high - low).max_element();
    let extent = |triangle: u32| {
        let (low, high) = extent_of(scene.corners(triangle).into_iter());
        (high - low).max_element()
    };
    let tiny = |&triangle: &u32| extent(triangle) < TINY * size as f32;
    let first = all(scene).find(tiny).and_then(|triangle| place(scene, triangle));
    let means = "they cost memory and time, and no pixel shows them";
    push(found, "very small triangles", all(scene).filter(tiny).count(), first, None, means);
    very_large(scene, size, found);
    let mut small_parts: Vec<(usize, u32)> = Vec::new();
    for part in parts(scene) {
        let extent = extent_of(part.iter().flat_map(|&t| scene.corners(t)));
        if f64::from((extent.1 - extent.0).max_element()) < SMALL_PART * size {
            small_parts.push((part.len(), part[0]));
        }
    }
    let first = small_parts.iter().map(|part| part.1).min().and_then(|t| place(scene, t));
    let means = "parts far smaller than the scene: screws and the like, which no view of it needs";
    push(found, "very small parts", small_parts.len(), first, None, means);
}

/// Finds a few faces that are much larger than everything else, such as a ground plane.
fn very_large(scene: &Scene, size: f64, found: &mut Vec<Finding>) {
    const MOST: usize = 16;
    let is_long = |&t: &u32| {
        let corners = scene.corners(t);
        let (low, high) = extent_of(corners.into_iter());
        f64::from((high - low).max_element()) > LONG * size
    };
    let long: Vec<u32> = all(scene).filter(is_long).take(MOST + 1).collect();
    if long.is_empty() || long.len() > MOST || long.len() == scene.triangles().len() {
        return;
    }
    let others = all(scene).filter(|t| !is_long(t)).flat_map(|t| scene.corners(t));
    let (low, high) = extent_of(others);
    if f64::from((high - low).max_element()) < 0.1 * size {
        let means =
            "all else is within a tenth of them: sections and views are chosen for the rest";
        push(found, "very large faces", long.len(), place(scene, long[0]), None, means);
    }
}

/// Returns the least and greatest coordinates of points.
fn extent_of(points: impl Iterator<Item = Vec3>) -> (Vec3, Vec3) {
    points.fold((Vec3::INFINITY, Vec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
}

/// Returns the parts of a scene whose triangles share corners. The triangles of each part are in
/// order.
fn parts(scene: &Scene) -> Vec<Vec<u32>> {
    let mut number: HashMap<[u32; 3], u32> = HashMap::new();
    let mut parent: Vec<u32> = Vec::new();
    fn root(parent: &mut [u32], mut at: u32) -> u32 {
        while parent[at as usize] != at {
            parent[at as usize] = parent[parent[at as usize] as usize];
            at = parent[at as usize];
        }
        at
    }
    let mut of_triangle = Vec::with_capacity(scene.triangles().len());
    for triangle in all(scene) {
        let corners = scene.corners(triangle).map(|corner| {
            let next = parent.len() as u32;
            let id = *number.entry(bits(corner)).or_insert(next);
            if id == next {
                parent.push(next);
            }
            id
        });
        let [a, b, c] = corners.map(|corner| root(&mut parent, corner));
        let least = a.min(b).min(c);
        [a, b, c].iter().for_each(|&corner| parent[corner as usize] = least);
        of_triangle.push(least);
    }
    let mut parts: HashMap<u32, Vec<u32>> = HashMap::new();
    for (triangle, corner) in (0..).zip(of_triangle) {
        parts.entry(root(&mut parent, corner)).or_default().push(triangle);
    }
    let mut parts: Vec<_> = parts.into_values().collect();
    parts.sort_by_key(|part| part[0]);
    parts
}

/// Returns the names and albedos of materials that are used and absorb hardly any light. Their
/// albedo, with texture, coat and colours of corners, is at least 0.95, which no paint reaches.
#[must_use]
pub fn white_materials(scene: &Scene) -> Vec<(&str, f32)> {
    let factors = colour_factors(scene);
    let albedo = |material: &Material, factor: [f32; 3]| {
        let times =
            |colour: [f32; 3]| -> [f32; 3] { std::array::from_fn(|k| colour[k] * factor[k]) };
        match material.bsdf {
            Bsdf::Diffuse { kd } => times(kd).into_iter().fold(0.0, f32::max),
            Bsdf::Coated { kd, ks, ior, .. } => {
                // Mean Fresnel reflectance of diffuse light (d'Eon 2022, a fit).
                let mean = ((ior - 1.0) / (4.085_67 + 1.000_71 * ior)).max(0.0);
                let coat = ks.map(|ks| ks * mean);
                let base = times(kd);
                (0..3).map(|k| coat[k] + (1.0 - coat[k]) * base[k]).fold(0.0, f32::max)
            }
            // Gold reflects all red light, and no white metal does.
            Bsdf::Mirror { ks } | Bsdf::Conductor { ks, .. } => times(ks).iter().sum::<f32>() / 3.0,
            Bsdf::ThinGlass { .. } | Bsdf::Dielectric { .. } => 0.0,
        }
    };
    let materials = scene.materials.iter().zip(factors);
    let albedos =
        materials.filter_map(|(material, factor)| Some((material, albedo(material, factor?))));
    albedos
        .filter(|(_, albedo)| *albedo >= WHITE)
        .map(|(material, albedo)| (material.name.as_str(), albedo))
        .collect()
}

/// Returns the mean factor to each material's colour by its texture and the colours of corners;
/// `None` if no triangle has the material.
fn colour_factors(scene: &Scene) -> Vec<Option<[f32; 3]>> {
    /// Wider than any texture, so that a look-up gives its mean.
    const WIDE: f32 = 1e30;
    let mut sums = vec![([0.0_f64; 3], 0_u32); scene.materials.len()];
    for triangle in all(scene) {
        let (sum, count) = &mut sums[scene.material_id(triangle) as usize];
        let factor = scene.base_texture(triangle, 1.0 / 3.0, 1.0 / 3.0, WIDE);
        let factor = factor.unwrap_or([1.0; 3]);
        (0..3).for_each(|k| sum[k] += f64::from(factor[k]));
        *count += 1;
    }
    let mean = |(sum, count): ([f64; 3], u32)| {
        (count > 0).then(|| sum.map(|sum| (sum / f64::from(count)) as f32))
    };
    sums.into_iter().map(mean).collect()
}

fn materials(scene: &Scene, found: &mut Vec<Finding>) {
    let mut used = vec![false; scene.materials.len()];
    scene.material_ids().for_each(|id| used[id as usize] = true);
    let count = |is_odd: &dyn Fn(usize) -> bool| {
        let odd: Vec<usize> = (0..scene.materials.len()).filter(|&id| is_odd(id)).collect();
        (odd.len(), odd.first().map(|&id| scene.materials[id].name.clone()))
    };
    let white = white_materials(scene);
    let first = white.first().map(|(name, _)| (*name).to_owned());
    let means = "they reflect 95 % or more, which no paint does: rooms closed by them stay noisy";
    push(found, "materials that absorb hardly any light", white.len(), None, first, means);
    let (number, first) = count(&|id| !used[id]);
    push(found, "unused materials", number, None, first, "they do no harm");
    let shading = scene.shading.as_ref();
    let large = shading.map_or(0, |shading| {
        shading
            .textures
            .iter()
            .filter(|t| t.size().contains(&(holo_scene::MAX_SIDE as usize)))
            .count()
    });
    let means =
        "they are halved to 4096 texels a side, or have that already: memory, not sharpness";
    push(found, "huge textures", large, None, None, means);
}

fn push(
    found: &mut Vec<Finding>,
    kind: &'static str,
    count: usize,
    at: Option<[f64; 3]>,
    material: Option<String>,
    means: &'static str,
) {
    if count > 0 {
        found.push(Finding { kind, count, at, material, means });
    }
}
