//! Instances that one node states (`EXT_mesh_gpu_instancing`).

use glam::{DMat4, DQuat, DVec3};

use super::accessor;
use super::buffers::Buffers;

const EXTENSION: &str = "EXT_mesh_gpu_instancing";

/// Returns an array of a node's instances.
fn array<'a>(
    node: &gltf::Node,
    document: &'a gltf::Document,
    name: &str,
) -> Option<gltf::Accessor<'a>> {
    let index = node.extension_value(EXTENSION)?.get("attributes")?.get(name)?.as_u64()?;
    document.accessors().nth(usize::try_from(index).ok()?)
}

fn arrays<'a>(
    node: &gltf::Node,
    document: &'a gltf::Document,
) -> Option<[Option<gltf::Accessor<'a>>; 3]> {
    node.extension_value(EXTENSION)?;
    let arrays = ["TRANSLATION", "ROTATION", "SCALE"].map(|name| array(node, document, name));
    // Without any array, it is a plain node.
    arrays.iter().any(Option::is_some).then_some(arrays)
}

fn least(arrays: &[Option<gltf::Accessor>; 3]) -> usize {
    arrays.iter().flatten().map(gltf::Accessor::count).min().unwrap_or(1)
}

/// Returns the number of a node's instances; 1 for a plain node.
pub(super) fn count(node: &gltf::Node, document: &gltf::Document) -> usize {
    arrays(node, document).map_or(1, |arrays| least(&arrays))
}

/// Returns the places of a node's instances, relative to the node; `None` for a plain node. If its
/// arrays differ in length, the shortest one counts.
pub(super) fn places(
    node: &gltf::Node,
    document: &gltf::Document,
    buffers: &Buffers,
) -> Result<Option<Vec<DMat4>>, String> {
    let Some(arrays) = arrays(node, document) else { return Ok(None) };
    let count = least(&arrays);
    let [translations, rotations, scales] = &arrays;
    // Each array is as long as its bytes, or bounded.
    let threes = |array: &Option<gltf::Accessor>| {
        array.as_ref().map(|array| accessor::floats::<3>(array, buffers)).transpose()
    };
    let (translations, scales) = (threes(translations)?, threes(scales)?);
    let rotations =
        rotations.as_ref().map(|array| accessor::floats::<4>(array, buffers)).transpose()?;
    let vector = |array: &Option<Vec<[f32; 3]>>, k: usize, otherwise: DVec3| {
        let found = array.as_ref().and_then(|array| array.get(k));
        found.map_or(otherwise, |found| DVec3::from(found.map(f64::from)))
    };
    let place = |k: usize| {
        let turn = rotations.as_ref().and_then(|array| array.get(k)).map(|q| q.map(f64::from));
        let turn = turn.map_or(DQuat::IDENTITY, |turn| {
            let turn = DQuat::from_array(turn);
            if turn.length_squared() > 0.0 { turn.normalize() } else { DQuat::IDENTITY }
        });
        DMat4::from_scale_rotation_translation(
            vector(&scales, k, DVec3::ONE),
            turn,
            vector(&translations, k, DVec3::ZERO),
        )
    };
    Ok(Some((0..count).map(place).collect()))
}
