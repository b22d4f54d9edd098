//! A model from an OBJ file and its MTL files.

use glam::Vec3;
use holo_mapped::Array;

use crate::libraries::{self, Looks};
use crate::limits::MAX_OBJ_BYTES;
use crate::model::{FormatReader, Model, ModelFile};
use crate::obj::{ObjFile, parse_obj};
use crate::obj_checked::NONE;
use crate::text::read_text;
use crate::{Octahedral, SceneError, Shading, WHITE, smooth};

pub(crate) const READER: FormatReader = FormatReader { recognises: |_, _| true, read };

fn read(source: ModelFile) -> Result<Model, SceneError> {
    let ModelFile { path, options, watch, warnings } = source;
    let text = read_text(path, MAX_OBJ_BYTES)?;
    let about = crate::header::read(&text);
    let obj = parse_obj(path, &text, watch, warnings)?;
    drop(text);
    let (materials, looks) = match obj.instead {
        None => libraries::materials(path, &obj, options, warnings)?,
        Some(_) => (Vec::new(), Looks::default()),
    };
    let material_ids = obj.faces.material_ids();
    let shading = Shading {
        uvs: texture_coordinates(&obj, &looks, &material_ids).into(),
        normals: normals(&obj).into(),
        textures: looks.textures,
        maps: looks.maps,
        colours: colours(&obj).into(),
        covers: looks.covers,
        opacities: Array::default(),
    };
    Ok(Model {
        shading,
        positions: obj.positions,
        triangles: obj.triangles,
        material_ids,
        materials,
        about,
        photometry: looks.photometry,
        lines: obj.faces,
        instead: obj.instead,
        ..Model::default()
    })
}

/// Returns the texture coordinates of each triangle's corners, down from the top of textures. Empty
/// if no material has a texture.
fn texture_coordinates(obj: &ObjFile, looks: &Looks, material_ids: &[u32]) -> Vec<[[f32; 2]; 3]> {
    if looks.maps.is_empty() {
        return Vec::new();
    }
    let of = |corner: u32| {
        let [texture, _] = obj.attributes.get(corner as usize)?;
        obj.texcoords.get(*texture as usize).copied()
    };
    let place = |(triangle, material): (usize, &u32)| {
        let placement = looks.placements[*material as usize];
        let corners = obj.corners.get(triangle).copied().unwrap_or([NONE; 3]);
        corners.map(|corner| placement.of(of(corner).unwrap_or([0.0; 2])))
    };
    material_ids.iter().enumerate().map(place).collect()
}

/// Returns the colours of each triangle's corners. Programs write them as sRGB, from 0 to 1 or to
/// 255. Empty if the file has none.
fn colours(obj: &ObjFile) -> Vec<[[u8; 3]; 3]> {
    if obj.colours.is_empty() {
        return Vec::new();
    }
    let greatest = obj.colours.as_flattened().iter().copied().fold(0.0, f32::max);
    let scale = if greatest > 1.0 { 1.0 } else { 255.0 };
    let byte = |share: f32| (share * scale + 0.5).clamp(0.0, 255.0) as u8;
    let of = |corner: u32| {
        let vertex = obj.coloured.get(corner as usize).copied().unwrap_or(u32::MAX);
        let colour = obj.colours.get(vertex as usize).filter(|colour| !colour[0].is_nan());
        colour.map_or(WHITE, |colour| colour.map(byte))
    };
    obj.corners.iter().map(|corners| corners.map(of)).collect()
}

/// Returns the normals of each triangle's corners: those of the file, or else those of its
/// smoothing groups. Empty if all are faceted.
fn normals(obj: &ObjFile) -> Vec<[Octahedral; 3]> {
    let normals = if !obj.normals.is_empty() && !obj.corners.is_empty() {
        let of = |corner: u32| {
            let normal = obj.attributes.get(corner as usize).map_or(NONE, |[_, normal]| *normal);
            obj.normals.get(normal as usize).copied().unwrap_or(Vec3::ZERO)
        };
        let packed = |(triangle, corners): (&[u32; 3], &[u32; 3])| {
            smooth::packed(smooth::facet(&obj.positions, *triangle), corners.map(of))
        };
        obj.triangles.iter().zip(&obj.corners).map(packed).collect()
    } else if !obj.groups.is_empty() {
        smooth::from_groups(&obj.positions, &obj.triangles, &obj.groups)
    } else {
        Vec::new()
    };
    if normals.iter().any(smooth::is_curved) { normals } else { Vec::new() }
}
