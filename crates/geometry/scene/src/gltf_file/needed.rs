//! The elements of a glTF file that its scene reaches, and replacements for what they lack.

use serde_json::{Map, Value};

use super::mend::{Mending, constant, whole};
use super::schema::{List, METALLIC_ROUGHNESS};

/// A surface of which nothing is stated: plaster of reflectance 0.5. The format's default is a
/// metal that reflects everything, and nobody means that by silence.
const PLASTER: &str = r#"{"baseColorFactor":[0.5,0.5,0.5,1],"metallicFactor":0}"#;

/// The same if vertices state the reflectance.
const WHITE_PLASTER: &str = r#"{"baseColorFactor":[1,1,1,1],"metallicFactor":0}"#;

/// Extensions that state how much light a material reflects or transmits.
const STATE_COLOUR: [&str; 4] = [
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_transmission",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_volume",
];

/// Extensions for pictures, each with a picture of its own, and the most widely read first.
const PICTURES: [&str; 4] =
    ["EXT_texture_webp", "KHR_texture_basisu", "MSFT_texture_dds", "EXT_texture_avif"];

/// Extensions that compress geometry: the part that they are at, and the word for people.
const DRACO: &str = "KHR_draco_mesh_compression";
const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

impl Mending {
    /// Marks the scene that is shown, and returns its index.
    pub(super) fn scenes(&mut self, named: Option<&Value>) -> Option<usize> {
        let scenes = List::Scenes as usize;
        let named = named.and_then(|index| {
            let found = self.element(List::Scenes, index);
            if found.is_err() && !index.is_null() {
                self.count("the scene to show does not exist: the first one is shown");
            }
            found.ok()
        });
        let shown = named.or((!self.lists[scenes].is_empty()).then_some(0))?;
        self.used[scenes][shown] = true;
        Some(shown)
    }

    /// Marks the nodes. Those that the scene does not reach or show keep only their place, which
    /// joints of skins need.
    ///
    /// # Errors
    /// A node that is shown names a mesh that does not exist, or is not complete.
    pub(super) fn nodes(&mut self) -> Result<(), String> {
        let nodes = List::Nodes as usize;
        let shown = self.used[List::Scenes as usize].iter().position(|&used| used);
        let count = self.lists[nodes].len();
        let mut is_shown = vec![shown.is_none(); count];
        let named = |of: &Value, member: &str| -> Vec<usize> {
            let indices = of.get(member).and_then(Value::as_array).into_iter().flatten();
            indices.filter_map(|index| self.element(List::Nodes, index).ok()).collect()
        };
        let mut pending = match shown {
            Some(shown) => named(&self.lists[List::Scenes as usize][shown], "nodes"),
            None => Vec::new(),
        };
        while let Some(node) = pending.pop() {
            if !std::mem::replace(&mut is_shown[node], true) {
                pending.extend(named(&self.lists[nodes][node], "children"));
            }
        }
        let is_hidden = |node: &Value| {
            let visible = node.pointer("/extensions/KHR_node_visibility/visible");
            visible == Some(&Value::Bool(false))
        };
        let mut hidden: Vec<usize> =
            (0..count).filter(|&k| is_shown[k] && is_hidden(&self.lists[nodes][k])).collect();
        let mut pending = hidden.clone();
        while let Some(node) = pending.pop() {
            if std::mem::replace(&mut is_shown[node], false) {
                pending.extend(named(&self.lists[nodes][node], "children"));
            }
        }
        hidden.dedup();
        if !hidden.is_empty() {
            let what = "nodes are left out, because the file says that they are not visible";
            self.counts.insert(what.to_owned(), hidden.len());
        }
        for (node, is_shown) in self.lists[nodes].iter_mut().zip(is_shown) {
            let Some(node) = node.as_object_mut() else { continue };
            let names: &[&str] = match is_shown {
                true => &[],
                false => &["mesh", "skin", "weights", "camera", "extensions", "extras", "name"],
            };
            names.iter().for_each(|name| drop(node.remove(*name)));
            if node.get("weights").is_some_and(|weights| !is_moved(weights)) {
                node.remove("weights");
            }
        }
        self.used[nodes].fill(true);
        for (number, node) in self.lists[nodes].iter().enumerate() {
            if let Some(mesh) = node.get("mesh").filter(|mesh| !mesh.is_null()) {
                self.element(List::Meshes, mesh)
                    .map_err(|fault| format!("`mesh` of node {number} {fault}"))?;
            }
        }
        Ok(())
    }

    /// Checks the meshes that are shown, and gives each of their parts a material.
    ///
    /// # Errors
    /// A mesh without its positions or indices.
    pub(super) fn meshes(&mut self) -> Result<(), String> {
        let meshes = List::Meshes as usize;
        let mut is_morphed = vec![false; self.lists[meshes].len()];
        for node in self.lists[List::Nodes as usize].iter().filter(|n| n.get("weights").is_some()) {
            if let Some(Ok(mesh)) = node.get("mesh").map(|mesh| self.element(List::Meshes, mesh)) {
                is_morphed[mesh] = true;
            }
        }
        let mut elements = std::mem::take(&mut self.lists[meshes]);
        for (number, mesh) in elements.iter_mut().enumerate() {
            if !self.used[meshes][number] {
                continue;
            }
            let Some(mesh) = mesh.as_object_mut() else { continue };
            let weights = mesh.get("weights");
            let is_morphed = is_morphed[number] || weights.is_some_and(is_moved);
            let Some(parts) = mesh.get_mut("primitives").and_then(Value::as_array_mut) else {
                continue;
            };
            for part in parts.iter_mut().filter_map(Value::as_object_mut) {
                self.part(number, part, is_morphed)?;
            }
        }
        self.lists[meshes] = elements;
        Ok(())
    }

    fn part(
        &mut self,
        mesh: usize,
        part: &mut Map<String, Value>,
        is_morphed: bool,
    ) -> Result<(), String> {
        if !is_morphed {
            part.remove("targets");
        }
        let attributes = part.get("attributes");
        let has_colours = attributes.is_some_and(|names| names.get("COLOR_0").is_some());
        let positions = attributes.and_then(|names| names.get("POSITION")).cloned();
        let arrays = positions.iter().chain(part.get("indices")).filter(|index| !index.is_null());
        for index in arrays {
            let accessors = &self.lists[List::Accessors as usize];
            let at = self.element(List::Accessors, index).map_err(|fault| match whole(index) {
                Some(index) if index as usize >= accessors.len() => {
                    format!("a mesh names accessor {index} of {}", accessors.len())
                }
                _ => format!("mesh {mesh} {fault}"),
            })?;
            let is_packed = part.get("extensions").is_some_and(|names| names.get(DRACO).is_some());
            if is_packed && accessors[at].get("bufferView").is_none_or(Value::is_null) {
                return Err(format!(
                    "mesh {mesh} is compressed by Draco, which is not read: export it without \
                     compression"
                ));
            }
        }
        let material = part.get("material").filter(|material| !material.is_null()).cloned();
        let found = material.as_ref().map(|index| self.element(List::Materials, index));
        if let Some(Err(fault)) = &found {
            self.count(format!("`material` of meshes {fault}: plaster is taken"));
        }
        match found {
            Some(Ok(material)) => self.coloured[material] |= has_colours,
            _ if has_colours => {
                self.count("the colours of vertices are taken for meshes without a material");
                part.insert("material".to_owned(), self.plaster(WHITE_PLASTER).into());
            }
            missing => {
                if missing.is_none() {
                    self.count("meshes without a material are taken as plaster of reflectance 0.5");
                }
                part.insert("material".to_owned(), self.plaster(PLASTER).into());
            }
        }
        Ok(())
    }

    /// Returns the index of a material of plaster.
    fn plaster(&mut self, pbr: &str) -> usize {
        let name = match pbr {
            PLASTER => "default",
            _ => "vertex colours",
        };
        let mut material = Map::new();
        material.insert("name".to_owned(), name.into());
        material.insert("pbrMetallicRoughness".to_owned(), constant(pbr));
        let material = Value::Object(material);
        let made = &self.lists[List::Materials as usize][self.coloured.len()..];
        match made.iter().position(|known| *known == material) {
            Some(known) => self.coloured.len() + known,
            None => self.add(List::Materials, material),
        }
    }

    /// Gives materials that state nothing about their colour that of plaster.
    pub(super) fn materials(&mut self) {
        let mut replaced = 0;
        let materials = &mut self.lists[List::Materials as usize];
        let used = &self.used[List::Materials as usize];
        for ((material, &is_coloured), used) in materials.iter_mut().zip(&self.coloured).zip(used) {
            let Some(object) = material.as_object_mut().filter(|_| *used) else { continue };
            let pbr = object.get("pbrMetallicRoughness").and_then(Value::as_object);
            let is_known = |name: &str| METALLIC_ROUGHNESS.iter().any(|known| known.name == name);
            let states = |(name, value): (&String, &Value)| !value.is_null() && is_known(name);
            let extensions = object.get("extensions");
            let has_other = STATE_COLOUR
                .iter()
                .any(|name| extensions.is_some_and(|names| names.get(*name).is_some()));
            if has_other || pbr.is_some_and(|pbr| pbr.iter().any(states)) {
                continue;
            }
            let plaster = if is_coloured { WHITE_PLASTER } else { PLASTER };
            object.insert("pbrMetallicRoughness".to_owned(), constant(plaster));
            replaced += 1;
        }
        if replaced > 0 {
            let what = "materials that state no colour are taken as plaster of reflectance 0.5";
            self.counts.insert(what.to_owned(), replaced);
        }
    }

    /// Gives textures the pictures that their extensions name.
    pub(super) fn textures(&mut self) {
        for number in 0..self.lists[List::Textures as usize].len() {
            let texture = &self.lists[List::Textures as usize][number];
            let of = |name: &&str| texture.get("extensions")?.get(*name)?.get("source");
            let own = texture.get("source");
            // What the format itself knows comes before what is not read.
            let sources = [of(&PICTURES[0]), own].into_iter();
            let sources = sources.chain(PICTURES[1..].iter().map(of)).flatten();
            let exists = |source: &&Value| self.element(List::Images, source).is_ok();
            let source = sources.filter(|source| !source.is_null()).find(exists).cloned();
            if let (Some(texture), Some(source)) =
                (self.lists[List::Textures as usize][number].as_object_mut(), source)
            {
                texture.insert("source".to_owned(), source);
            }
        }
    }

    /// Checks that views have bytes that are not compressed, and drops strides of zero.
    ///
    /// # Errors
    /// A view that is used has only compressed bytes.
    pub(super) fn buffer_views(&mut self) -> Result<(), String> {
        let views = List::BufferViews as usize;
        for number in 0..self.lists[views].len() {
            if !self.used[views][number] {
                continue;
            }
            let view = &self.lists[views][number];
            let extensions = view.get("extensions");
            let is_packed = MESHOPT
                .iter()
                .any(|name| extensions.is_some_and(|names| names.get(*name).is_some()));
            let buffer = view.get("buffer").map(|buffer| self.element(List::Buffers, buffer));
            if let (true, Some(Ok(buffer))) = (is_packed, buffer) {
                let has_name = self.lists[List::Buffers as usize][buffer].get("uri").is_some();
                if !(has_name || self.has_chunk && buffer == 0) {
                    return Err(
                        "it is compressed by meshopt (gltfpack), which is not read: export it \
                         without compression"
                            .to_owned(),
                    );
                }
            }
            let view = &mut self.lists[views][number];
            if view.get("byteStride").and_then(whole) == Some(0) {
                view.as_object_mut().map(|view| view.remove("byteStride"));
                self.count("strides of zero bytes are taken as those of packed arrays");
            }
        }
        Ok(())
    }
}

/// Returns whether weights of morph targets move anything.
fn is_moved(weights: &Value) -> bool {
    let mut weights = weights.as_array().into_iter().flatten();
    weights.any(|weight| weight.as_f64().is_some_and(|weight| weight != 0.0))
}
