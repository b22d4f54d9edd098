//! Makes panes of solid glass that is better described as a pane: sheets that enclose nothing, and
//! thin slabs.

use std::collections::HashMap;

use glam::{DMat4, DVec3, Vec3};

use crate::model::{Model, SharedMesh};
use crate::shading::Maps;
use crate::sheets::{SheetTree, is_sheet};
use crate::slabs::{GlassBox, Slab};
use crate::{Bsdf, Rgb};

/// An edge between two places, the same in both directions.
type Edge = [[u64; 3]; 2];

/// What has become panes.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct MadePanes {
    /// Number of sheets.
    pub sheets: usize,
    /// Number of slabs.
    pub slabs: usize,
    /// Triangles of [`Model::triangles`] that are no longer needed, in order. They have no area.
    pub left_out: Vec<usize>,
    /// Number of such triangles of shared meshes.
    pub left_out_of_meshes: usize,
}

/// The solid glass of one list of triangles.
#[derive(Default)]
struct SolidGlass {
    sheets: Vec<Vec<usize>>,
    slabs: Vec<Slab>,
    /// What remains.
    others: Vec<GlassBox>,
}

/// Most comparisons of slabs with other glass. Files with more keep their slabs.
const MOST_COMPARED: usize = 1 << 26;

/// Makes panes of sheets and slabs of solid glass of a model.
pub(crate) fn to_panes(model: &mut Model) -> MadePanes {
    let kinds = |id: usize| GlassKind::of(model, id);
    let kinds: Vec<Option<GlassKind>> = (0..model.materials.len()).map(kinds).collect();
    if kinds.iter().all(Option::is_none) {
        return MadePanes::default();
    }
    let at = |corner: u32| model.positions[corner as usize];
    let mut own = SolidGlass::find(&kinds, at, &model.triangles, &model.material_ids);
    let of_mesh = |mesh: &SharedMesh| {
        let at = |corner: u32| Vec3::from(mesh.positions[corner as usize]).as_dvec3();
        SolidGlass::find(&kinds, at, &mesh.triangles, &mesh.material_ids)
    };
    let mut of_meshes: Vec<SolidGlass> = model.meshes.iter().map(of_mesh).collect();
    keep_touching(&mut own, &mut of_meshes, &model.placements);
    let all = || of_meshes.iter().chain([&own]);
    let sheets = all().map(|glass| glass.sheets.len()).sum();
    let slabs = all().map(|glass| glass.slabs.len()).sum();
    let mut made = MadePanes { sheets, slabs, ..MadePanes::default() };
    if sheets + slabs > 0 {
        recolour(model, &own, &of_meshes);
        let Model { positions, triangles, meshes, .. } = model;
        made.left_out = flatten(&own.slabs, triangles, positions, |p| *p, |p| p);
        for (mesh, glass) in meshes.iter_mut().zip(&of_meshes) {
            let SharedMesh { positions, triangles, .. } = mesh;
            let (to, from) =
                (|p: &[f32; 3]| Vec3::from(*p).as_dvec3(), |p: DVec3| p.as_vec3().into());
            made.left_out_of_meshes += flatten(&glass.slabs, triangles, positions, to, from).len();
        }
    }
    made
}

/// What solid glass may become.
#[derive(Clone, Copy, Debug, PartialEq)]
enum GlassKind {
    /// Sheets of it become panes.
    Solid,
    /// Slabs of it, too: it is smooth and even.
    Even,
}

impl GlassKind {
    fn of(model: &Model, id: usize) -> Option<GlassKind> {
        let material = &model.materials[id];
        let Bsdf::Dielectric { ior, alpha, .. } = material.bsdf else { return None };
        let is_plain = model.shading.maps.get(id).is_none_or(|maps| *maps == Maps::default());
        let is_whole = model.shading.covers.get(id).is_none_or(|cover| cover.base.is_none());
        let is_even = ior > 1.0 && alpha == 0.0 && !material.emits() && is_plain && is_whole;
        Some(if is_even { GlassKind::Even } else { GlassKind::Solid })
    }
}

impl SolidGlass {
    fn find(
        kinds: &[Option<GlassKind>],
        at: impl Fn(u32) -> DVec3,
        triangles: &[[u32; 3]],
        material_ids: &[u32],
    ) -> SolidGlass {
        let kind = |k: usize| kinds.get(material_ids[k] as usize).copied().flatten();
        let glass: Vec<usize> = (0..triangles.len()).filter(|&k| kind(k).is_some()).collect();
        let corners = |k: usize| triangles[k].map(&at);
        let mut found = SolidGlass::default();
        let mut tree = None;
        for GlassPart { triangles: part, is_open } in parts(&glass, triangles.len(), &corners) {
            let id = |k: &usize| material_ids[*k];
            let is_even = kind(part[0]) == Some(GlassKind::Even)
                && part.iter().all(|k| id(k) == id(&part[0]));
            if let Some(slab) = is_even.then(|| Slab::of(&part, &corners)).flatten() {
                found.slabs.push(slab);
                continue;
            }
            let new = || SheetTree::new(glass.iter().map(|&k| corners(k)).collect());
            if is_open && is_sheet(&part, &corners, tree.get_or_insert_with(new)) {
                found.sheets.push(part);
            } else {
                found.others.push(GlassBox::around(part.iter().flat_map(|&k| corners(k))));
            }
        }
        // Glass without air between refracts as one.
        let slabs = std::mem::take(&mut found.slabs);
        if slabs.len() * slabs.len() > MOST_COMPARED {
            found.others.extend(slabs.iter().map(|slab| slab.bounds));
            return found;
        }
        let touches = |(n, slab): (usize, &Slab)| {
            let mut others = slabs.iter().enumerate().filter(|(other, _)| *other != n);
            others.any(|(_, other)| slab.touches(other, &corners) || other.touches(slab, &corners))
        };
        let is_touched: Vec<bool> = slabs.iter().enumerate().map(touches).collect();
        for (slab, is_touched) in slabs.into_iter().zip(is_touched) {
            match is_touched {
                true => found.others.push(slab.bounds),
                false => found.slabs.push(slab),
            }
        }
        found
    }
}

/// Leaves slabs solid that may touch other solid glass, such as the walls of an aquarium.
fn keep_touching(own: &mut SolidGlass, of_meshes: &mut [SolidGlass], placements: &[(u32, DMat4)]) {
    let mut others = own.others.clone();
    let mut compared = own.slabs.len();
    for (mesh, matrix) in placements {
        let glass = &of_meshes[*mesh as usize];
        others.extend(glass.others.iter().map(|other| other.placed(*matrix)));
        compared += glass.slabs.len();
        if others.len() > MOST_COMPARED {
            break;
        }
    }
    let is_feasible = others.len().saturating_mul(compared) <= MOST_COMPARED;
    let is_apart =
        |bounds: &GlassBox| is_feasible && !others.iter().any(|other| other.meets(bounds));
    own.slabs.retain(|slab| is_apart(&slab.bounds));
    for (number, glass) in of_meshes.iter_mut().enumerate() {
        let places = || placements.iter().filter(|(mesh, _)| *mesh as usize == number);
        glass
            .slabs
            .retain(|slab| places().all(|(_, matrix)| is_apart(&slab.bounds.placed(*matrix))));
    }
}

/// Gives sheets and slabs the material of a pane.
fn recolour(model: &mut Model, own: &SolidGlass, of_meshes: &[SolidGlass]) {
    let Model { materials, shading, meshes, material_ids, .. } = model;
    let originals: Vec<Bsdf> = materials.iter().map(|material| material.bsdf).collect();
    let triangles = |glass: &SolidGlass| -> Vec<(usize, bool)> {
        let sheets = glass.sheets.iter().flatten().map(|&k| (k, false));
        let slabs = glass.slabs.iter().flat_map(|slab| &slab.triangles).map(|&k| (k, true));
        sheets.chain(slabs).collect()
    };
    let mut lists = vec![(material_ids, triangles(own))];
    let of_meshes = of_meshes.iter().map(triangles);
    lists.extend(meshes.iter_mut().map(|mesh| &mut mesh.material_ids).zip(of_meshes));
    // The triangles of each material that remain solid.
    let mut solid = vec![0_usize; originals.len()];
    for (ids, panes) in &lists {
        ids.iter().for_each(|&id| solid[id as usize] += 1);
        panes.iter().for_each(|&(k, _)| solid[ids[k] as usize] -= 1);
    }
    let mut panes = HashMap::new();
    let mut pane_of = |id: u32, is_slab: bool| {
        *panes.entry((id, is_slab)).or_insert_with(|| {
            let mut pane = materials[id as usize].clone();
            if let Bsdf::Dielectric { ior, transmittance, .. } = originals[id as usize] {
                // Light crosses both boundaries of a slab.
                let transmittance: Rgb =
                    transmittance.map(|share| if is_slab { share * share } else { share });
                pane.bsdf = Bsdf::ThinGlass { ior, transmittance };
            }
            if std::mem::replace(&mut solid[id as usize], 1) == 0 {
                materials[id as usize] = pane;
                return id;
            }
            materials.push(pane);
            if let Some(&maps) = shading.maps.get(id as usize) {
                shading.maps.push(maps);
            }
            if let Some(&cover) = shading.covers.get(id as usize) {
                shading.covers.push(cover);
            }
            materials.len() as u32 - 1
        })
    };
    for (ids, panes) in lists {
        for (k, is_slab) in panes {
            ids[k] = pane_of(ids[k], is_slab);
        }
    }
}

/// Moves one face of each slab to its middle, and takes the area of all other triangles. Returns
/// these, in order.
fn flatten<P>(
    slabs: &[Slab],
    triangles: &mut [[u32; 3]],
    positions: &mut Vec<P>,
    to: impl Fn(&P) -> DVec3,
    from: impl Fn(DVec3) -> P,
) -> Vec<usize> {
    let mut left_out = Vec::new();
    for slab in slabs {
        let mut moved = HashMap::new();
        for &k in &slab.triangles {
            let corners = triangles[k];
            if !slab.is_upper(corners.map(|corner| to(&positions[corner as usize]))) {
                triangles[k] = [corners[0]; 3];
                left_out.push(k);
                continue;
            }
            triangles[k] = corners.map(|corner| {
                *moved.entry(corner).or_insert_with(|| {
                    positions.push(from(slab.in_middle(to(&positions[corner as usize]))));
                    positions.len() as u32 - 1
                })
            });
        }
    }
    left_out.sort_unstable();
    left_out
}

/// A part of the glass, connected at edges.
struct GlassPart {
    triangles: Vec<usize>,
    /// True if it has an edge where nothing else ends.
    is_open: bool,
}

/// Returns the parts of the glass.
fn parts(
    glass: &[usize],
    triangles: usize,
    corners: &impl Fn(usize) -> [DVec3; 3],
) -> Vec<GlassPart> {
    // The first triangle of glass at an edge, and the number of all triangles there.
    let mut at_edge: HashMap<Edge, (usize, usize)> = HashMap::new();
    let mut parent: Vec<usize> = (0..glass.len()).collect();
    for (own, &k) in glass.iter().enumerate() {
        for edge in edges_of(corners(k)) {
            let entry = at_edge.entry(edge).or_insert((own, 0));
            entry.1 += 1;
            let (a, b) = (root(&mut parent, entry.0), root(&mut parent, own));
            parent[a.max(b)] = a.min(b);
        }
    }
    if at_edge.values().any(|entry| entry.1 == 1) {
        close(&mut at_edge, glass, triangles, corners);
    }
    let mut is_open = vec![false; glass.len()];
    for &(own, count) in at_edge.values() {
        if count == 1 {
            is_open[root(&mut parent, own)] = true;
        }
    }
    let mut parts: HashMap<usize, GlassPart> = HashMap::new();
    for (own, &k) in glass.iter().enumerate() {
        let root = root(&mut parent, own);
        let part = || GlassPart { triangles: Vec::new(), is_open: is_open[root] };
        parts.entry(root).or_insert_with(part).triangles.push(k);
    }
    let mut parts: Vec<(usize, GlassPart)> = parts.into_iter().collect();
    parts.sort_unstable_by_key(|part| part.0);
    parts.into_iter().map(|part| part.1).collect()
}

/// Returns the edges of a triangle. Adding 0 makes -0 and 0 the same place.
fn edges_of(corners: [DVec3; 3]) -> [Edge; 3] {
    let [a, b, c] = corners.map(|p| (p + DVec3::ZERO).to_array().map(f64::to_bits));
    [[a, b], [b, c], [c, a]].map(|[from, to]| [from.min(to), from.max(to)])
}

/// Counts the edges of other surfaces, which may close the glass.
fn close(
    at_edge: &mut HashMap<Edge, (usize, usize)>,
    glass: &[usize],
    triangles: usize,
    corners: &impl Fn(usize) -> [DVec3; 3],
) {
    let all = glass.iter().flat_map(|&k| corners(k));
    let (low, high) = all
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)));
    let is_near = |k: usize| corners(k).iter().any(|p| p.cmpge(low).all() && p.cmple(high).all());
    let mut is_glass = glass.iter().copied().peekable();
    for k in 0..triangles {
        if is_glass.next_if_eq(&k).is_none() && is_near(k) {
            for edge in edges_of(corners(k)) {
                if let Some(entry) = at_edge.get_mut(&edge) {
                    entry.1 += 1;
                }
            }
        }
    }
}

fn root(parent: &mut [usize], mut at: usize) -> usize {
    while parent[at] != at {
        parent[at] = parent[parent[at]];
        at = parent[at];
    }
    at
}
