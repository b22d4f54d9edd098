//! The MTL files of an OBJ file, and the materials that its faces use.

use crate::foreign;
use crate::limits::{MAX_MATERIALS, MAX_MTL_BYTES};
use crate::mtl::{MtlMaterial, Stated};
use crate::mtl_maps::{MapOptions, mean_finish, textures};
use crate::mtl_text::parse_mtl;
use crate::named_file::beside;
use crate::obj::ObjFile;
use crate::text::{excerpt, name_without_comment, read_text};
use crate::texture_files::{TURNED, TextureFiles, greyed};
use crate::warnings::Warnings;
use crate::{
    Bsdf, Cover, LoadOptions, LuminousPart, Maps, Material, NamedPhotometry, SceneError, Texture,
};
use std::borrow::Cow;
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use unicode_normalization::{IsNormalized, UnicodeNormalization as _, is_nfc_quick};

/// The textures of an OBJ file's materials.
#[derive(Default)]
pub(crate) struct Looks {
    pub textures: Vec<Texture>,
    /// For each material. Empty if none has a texture.
    pub maps: Vec<Maps>,
    /// For each material.
    pub covers: Vec<Cover>,
    /// The placement of textures on the surfaces of each material.
    pub placements: Vec<MapOptions>,
    /// Photometric files of materials.
    pub photometry: Vec<NamedPhotometry>,
}

/// Returns the materials of `obj.uses`, in that order, and their textures.
pub(crate) fn materials(
    path: &Path,
    obj: &ObjFile,
    options: &LoadOptions,
    warnings: &mut Warnings,
) -> Result<(Vec<Material>, Looks), SceneError> {
    let (library, any_file) = read_libraries(path, obj, warnings)?;
    let by_name = index(&library, warnings);
    let (mut undefined, mut has_colours) = (Vec::new(), false);
    let (mut files, mut looks) = (TextureFiles::default(), Looks::default());
    let mut materials = Vec::with_capacity(obj.uses.len());
    let find = |name: &str| {
        let name = normal(name);
        by_name.get(&name).or_else(|| by_name.get(name_without_comment(&name))).copied()
    };
    let found = obj.uses.iter().filter_map(|wanted| Some(&library[find(wanted.name.as_deref()?)?]));
    files.decode_files(found.flat_map(|material| {
        material.maps.iter().map(|map| (material.path.as_path(), map.file(), map.how()))
    }));
    for wanted in &obj.uses {
        let name = wanted.name.as_deref();
        let found = name.and_then(find);
        let (mut maps, mut placement) = (Maps::default(), MapOptions::default());
        let mut cover = Cover::default();
        materials.push(match (found, name) {
            (Some(id), _) => {
                let material = &library[id];
                let MtlMaterial { path, maps: statements, .. } = material;
                let finish = material.finish();
                let found = textures(path, statements, finish, &mut files, warnings);
                (maps, placement) = (found.maps, found.placement);
                let mean = maps.finish.map(|finish| mean_finish(&finish, &files));
                let mut made;
                (made, cover) = material.resolve(mean, options.two_sided_lights, warnings);
                if let Some(Stated { value: (file, turn), line }) = &material.ies {
                    let folder = path.parent().unwrap_or(Path::new(""));
                    let (file, turn) = (beside(folder, file, "ies"), *turn);
                    if file.is_file() {
                        let part = LuminousPart::Material { id: materials.len() as u32, turn };
                        looks.photometry.push(NamedPhotometry { path: file, part });
                    } else {
                        let text = format!(
                            "there is no photometric file {}, so `{}` has no light",
                            file.display(),
                            excerpt(&material.name)
                        );
                        warnings.push(path, Some(*line), text);
                    }
                }
                if found.lacks_colour {
                    made.bsdf = greyed(made.bsdf);
                }
                if found.lacks_emission && !material.states_emission() {
                    made.emission = [0.0; 3];
                }
                if matches!(made.bsdf, Bsdf::ThinGlass { .. } | Bsdf::Dielectric { .. }) {
                    maps.finish = None;
                    // The colour of glass is `Tf`.
                    maps.base = maps.base.filter(|_| cover.base.is_some());
                } else {
                    cover.take_mask(&mut maps, &files.textures);
                }
                made
            }
            (None, _) if !obj.colours.is_empty() => {
                has_colours = true;
                let bsdf = Bsdf::Diffuse { kd: [1.0; 3] };
                Material { bsdf, ..Material::grey(name.unwrap_or("vertex colours")) }
            }
            (None, Some(name)) => {
                undefined.push(wanted);
                Material::grey(name)
            }
            (None, None) => {
                let text = "faces before any `usemtl`; grey diffuse 0.5 is taken".to_owned();
                warnings.push(path, Some(wanted.line), text);
                Material::grey("default")
            }
        });
        looks.maps.push(maps);
        looks.covers.push(cover);
        looks.placements.push(placement);
    }
    if has_colours {
        let text = "the colours of vertices are taken for materials that are not defined";
        warnings.push(path, None, text.to_owned());
    }
    if any_file {
        for wanted in undefined {
            let name = excerpt(wanted.name.as_deref().unwrap_or_default());
            let text = format!("no MTL file has a material `{name}`; grey diffuse 0.5 is taken");
            warnings.push(path, Some(wanted.line), text);
        }
    } else if let Some(first) = undefined.first() {
        // One message for all materials, because the reason is the same.
        let text = format!(
            "no MTL file was read; grey diffuse 0.5 is taken for all materials ({})",
            undefined.len()
        );
        warnings.push(path, Some(first.line), text);
    }
    if files.turned > 0 {
        warnings.push(path, None, format!("{TURNED} ({})", files.turned));
    }
    looks.textures = files.textures;
    if looks.textures.is_empty() {
        looks.maps.clear();
    }
    Ok((materials, looks))
}

/// Returns an index of the materials by name, with and without what looks like a comment. If
/// several materials have one name, the last counts.
fn index<'a>(library: &'a [MtlMaterial], warnings: &mut Warnings) -> HashMap<Cow<'a, str>, usize> {
    let mut by_name = HashMap::new();
    for (id, material) in library.iter().enumerate() {
        if let Some(earlier) = by_name.insert(normal(&material.name), id) {
            let earlier: &MtlMaterial = &library[earlier];
            let (name, line) = (excerpt(&material.name), earlier.line);
            let text = format!(
                "material `{name}` again; this one counts, not {}:{line}",
                earlier.path.display()
            );
            warnings.push(&material.path, Some(material.line), text);
        }
    }
    for (id, material) in library.iter().enumerate() {
        by_name.entry(normal(name_without_comment(&material.name))).or_insert(id);
    }
    by_name
}

/// Returns a name in one normal form of Unicode, in which a letter with an accent is one code.
fn normal(name: &str) -> Cow<'_, str> {
    match is_nfc_quick(name.chars()) {
        IsNormalized::Yes => Cow::Borrowed(name),
        _ => Cow::Owned(name.nfc().collect()),
    }
}

/// Returns all materials of all MTL files, and whether any file was read.
fn read_libraries(
    obj_path: &Path,
    obj: &ObjFile,
    warnings: &mut Warnings,
) -> Result<(Vec<MtlMaterial>, bool), SceneError> {
    let folder = obj_path.parent().unwrap_or(Path::new(""));
    let mut library = Vec::new();
    let mut seen = HashSet::new();
    let mut any_file = false;
    for (line, names) in &obj.libraries {
        for path in library_paths(folder, names) {
            if !seen.insert(path.clone()) {
                continue;
            }
            match read_library(&path) {
                Ok(text) => {
                    any_file = true;
                    library.extend(parse_mtl(&path, &text, warnings)?);
                    if library.len() > MAX_MATERIALS {
                        let (path, line) = (obj_path.to_owned(), *line);
                        let (what, limit) = ("materials in MTL files", MAX_MATERIALS);
                        return Err(SceneError::FileLimit { path, line, what, limit });
                    }
                }
                Err(error @ SceneError::FileTooLarge { .. }) => return Err(error),
                Err(error) => warnings.push(
                    obj_path,
                    Some(*line),
                    format!("`mtllib` cannot be read: {error}"),
                ),
            }
        }
    }
    let own = obj_path.with_extension("mtl");
    if !any_file && own.is_file() && !seen.contains(&own) {
        let text = format!("materials are taken from {}, which lies beside it", own.display());
        warnings.push(obj_path, None, text);
        library = parse_mtl(&own, &read_library(&own)?, warnings)?;
        any_file = true;
    }
    Ok((library, any_file))
}

/// Reads the text of an MTL file. Only regular files are read: a pipe or device might never end.
fn read_library(path: &Path) -> Result<String, SceneError> {
    if path.exists() && !path.is_file() {
        let source = std::io::Error::new(std::io::ErrorKind::InvalidInput, "not a file");
        return Err(SceneError::Io { path: path.to_owned(), source });
    }
    let text = read_text(path, MAX_MTL_BYTES)?;
    match foreign::pointer(text.as_bytes()) {
        Some(what) => {
            let source = std::io::Error::new(std::io::ErrorKind::InvalidData, what);
            Err(SceneError::Io { path: path.to_owned(), source })
        }
        None => Ok(text),
    }
}

/// Most words in the name of one file of several on a line.
const MOST_WORDS: usize = 16;

/// Returns the files that a `mtllib` line names. Spaces separate names in the format, but are
/// common within names. So the whole is one name if that file exists, or if no part of it is a
/// file. Otherwise each name has as many words as a file has, and what is between is missing.
fn library_paths(folder: &Path, names: &str) -> Vec<PathBuf> {
    let names = name_without_comment(names);
    let path = |name: &str| beside(folder, name.trim_matches('"'), "mtl");
    let whole = path(names);
    if whole.is_file() {
        return vec![whole];
    }
    let words: Vec<&str> = names.split_ascii_whitespace().collect();
    let (mut paths, mut missing, mut at) = (Vec::new(), Vec::new(), 0);
    let mut is_found = false;
    while at < words.len() {
        let ends = (at + 1..=words.len().min(at + MOST_WORDS)).rev();
        let found = ends
            .map(|end| (end, words[at..end].join(" ")))
            .map(|(end, name)| (end, path(&name), name))
            // A file of another name may stand for one word, but not for several.
            .find(|(end, file, name)| file.is_file() && (*end == at + 1 || is_named(file, name)))
            .map(|(end, file, _)| (end, file));
        if found.is_none() {
            missing.push(words[at]);
            at += 1;
        }
        if !missing.is_empty() && (found.is_some() || at == words.len()) {
            paths.push(path(&missing.join(" ")));
            missing.clear();
        }
        if let Some((end, file)) = found {
            (is_found, at) = (true, end);
            paths.push(file);
        }
    }
    if is_found { paths } else { vec![whole] }
}

/// Returns whether a file has the name that a text ends with, in any letter case.
fn is_named(file: &Path, text: &str) -> bool {
    let own = text.rsplit(['/', '\\']).next().unwrap_or(text).trim_matches('"');
    file.file_name().is_some_and(|name| name.eq_ignore_ascii_case(own))
}
