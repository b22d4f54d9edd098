//! Repairs JSON whose harmless faults make the crate `gltf` refuse a file or panic.

use gltf::Semantic;
use gltf::json::Root;
use gltf::json::image::MimeType;
use gltf::json::validation::Checked;

/// Repairs a file's JSON. The crate then neither refuses it nor panics because of harmless faults.
///
/// # Errors
/// Faults that cannot be repaired, in words for people.
pub(super) fn mend(json: &mut Root) -> Result<(), String> {
    mend_images(json);
    mend_positions(json).map_err(|problem| format!("it is not valid glTF: {problem}"))
}

/// Gives images without a file a name that no file has. Images in buffers without a type get the
/// empty type, because types are determined from the bytes.
fn mend_images(json: &mut Root) {
    for image in &mut json.images {
        if image.buffer_view.is_none() {
            image.uri.get_or_insert_default();
        } else {
            image.mime_type.get_or_insert_with(|| MimeType(String::new()));
        }
    }
}

/// Checks that meshes name existing accessors. Gives positions the bounds that the crate requires;
/// some exporters omit them, and nothing here uses them.
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
