//! What the crate `gltf` takes for granted without checking it.

use gltf::Semantic;
use gltf::json::Root;
use gltf::json::image::MimeType;
use gltf::json::validation::Checked;

/// Makes a file's JSON such that the crate neither refuses nor panics over what does no harm.
///
/// # Errors
/// In words for people, for what cannot be mended.
pub(super) fn mend(json: &mut Root) -> Result<(), String> {
    mend_images(json);
    mend_positions(json).map_err(|problem| format!("it is not valid glTF: {problem}"))
}

/// Gives images without a file a name that no file has, and those in buffers without a type the
/// empty one: types are found from the bytes.
fn mend_images(json: &mut Root) {
    for image in &mut json.images {
        if image.buffer_view.is_none() {
            image.uri.get_or_insert_default();
        } else {
            image.mime_type.get_or_insert_with(|| MimeType(String::new()));
        }
    }
}

/// Checks that meshes name accessors that exist, and gives positions the bounds that the crate
/// requires: some exporters leave them out, and nothing here uses them.
fn mend_positions(json: &mut Root) -> Result<(), String> {
    let wanted = Checked::Valid(Semantic::Positions);
    let primitives = json.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let named: Vec<usize> =
        primitives.filter_map(|p| Some(p.attributes.get(&wanted)?.value())).collect();
    let count = json.accessors.len();
    for index in named {
        let accessor = json.accessors.get_mut(index);
        let accessor =
            accessor.ok_or_else(|| format!("a mesh names accessor {index} of {count}"))?;
        for bound in [&mut accessor.min, &mut accessor.max] {
            *bound = Some(gltf::json::Value::from(vec![0.0; 3]));
        }
    }
    Ok(())
}
