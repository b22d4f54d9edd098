//! Habits of programs that write MTL files: they mean other things by some statements than the
//! format says.

use crate::exporter::Exporter;
use crate::mtl::MtlMaterial;

/// Words in a file's first comments by which a program is recognised.
const COMMENTS: [(&str, Exporter); 2] =
    [("blender", Exporter::Blender), ("cinema 4d", Exporter::Cinema4d)];

/// Number of lines that are searched for comments.
const COMMENT_LINES: usize = 4;

/// Returns the program that wrote an MTL file.
pub(crate) fn program(text: &str, materials: &[MtlMaterial]) -> Exporter {
    let comments = text.trim_start_matches('\u{feff}').lines().take(COMMENT_LINES);
    let comments: Vec<String> =
        comments.take_while(|line| line.starts_with('#')).map(|line| line.to_lowercase()).collect();
    let names = |words: &str| comments.iter().any(|comment| comment.contains(words));
    let by_comment = COMMENTS.iter().find(|(words, _)| names(words));
    match by_comment {
        Some(&(_, program)) => program,
        None if is_of_maya(materials) => Exporter::Maya,
        None => Exporter::Other,
    }
}

/// Returns whether Maya wrote the materials, which says so nowhere. All of them begin with `illum
/// 4`, then come `Kd`, `Tf` and `Ni`, and at least one is opaque paint: `Tf` and `Ni` are 1.
fn is_of_maya(materials: &[MtlMaterial]) -> bool {
    let has_its_order = |material: &MtlMaterial| {
        let illum = material.illum.filter(|illum| illum.value == 4).map(|illum| illum.line);
        let (Some(illum), Some(kd), Some(tf), Some(ni)) =
            (illum, material.kd, material.tf, material.ni)
        else {
            return false;
        };
        material.line < illum && illum < kd.line && kd.line < tf.line && tf.line < ni.line
    };
    let is_paint = |material: &MtlMaterial| {
        let is_opaque = material.tf.is_some_and(|tf| tf.value == [1.0; 3]);
        is_opaque && material.ni.is_some_and(|ni| ni.value == 1.0)
    };
    materials.iter().all(has_its_order) && materials.iter().any(is_paint)
}
