//! Reading glTF 2.0: `.gltf` and `.glb`, with buffers inside or beside them.
//!
//! The module `mend` reduces the JSON to what a picture needs, and the crate `gltf` validates that.
//! Buffers are read here, because every offset and length in a file is a claim that must be
//! checked.
//!
//! Invariants:
//! - Nodes are visited to a bounded depth, and a bounded number of times. A node within itself is
//!   left out. A node with several parents is there several times.
//! - Everything that the scene cannot represent is counted, and reported once for each kind.

mod accessor;
mod buffers;
mod container;
mod form;
mod instancing;
mod lights;
mod look;
mod materials;
mod mend;
mod mesh_copies;
mod needed;
mod photometry;
mod reading;
mod schema;
mod sharing;
mod textures;

use std::collections::BTreeMap;
use std::path::Path;

use glam::{DMat4, DVec3, Vec3};
use gltf::mesh::Mode;

use crate::header::{ModelCamera, StatedValue};
use crate::limits::{MAX_COORDINATE, MAX_OBJ_BYTES, MAX_POSITIONS, MAX_REPEATED, MAX_TRIANGLES};
use crate::model::{FormatReader, LoadProgress, Model, ModelFile};
use crate::named_file::read_file;
use crate::text::excerpt;
use crate::texture_files::{TURNED, TextureFiles, greyed};
use crate::{Bsdf, Cover, ModelFacts, SceneError, Shading, WHITE, smooth};
use buffers::Buffers;
use form::Form;
use reading::GltfReading;

pub(crate) const READER: FormatReader = FormatReader { recognises, read };

/// Extensions that are read, beside those of materials and lights.
const READ_EXTENSIONS: [&str; 3] =
    ["EXT_mesh_gpu_instancing", "EXT_texture_webp", "KHR_node_visibility"];

/// Deepest hierarchy of nodes. Exporters have a few dozen.
const MAX_DEPTH: usize = 512;

/// Most visits of nodes beyond the first ones. A node may have several parents, and each of these
/// may, too.
const MAX_REVISITED: usize = 1 << 16;

fn recognises(first: &[u8], path: &Path) -> bool {
    let text = first.strip_prefix(b"\xef\xbb\xbf").unwrap_or(first);
    let named = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("gltf"));
    first.starts_with(b"glTF") || text.trim_ascii_start().starts_with(b"{") || named
}

fn read(source: ModelFile) -> Result<Model, SceneError> {
    read_bounded(source, MAX_REPEATED)
}

/// Reads a file that may repeat so many elements: see [`MAX_REPEATED`].
fn read_bounded(source: ModelFile, repeated: u64) -> Result<Model, SceneError> {
    let ModelFile { path, options, watch, warnings } = source;
    let bytes = read_file(path, MAX_OBJ_BYTES)?;
    let GltfParts { document, blob, counts, photometry } = parse(path, &bytes)?;
    let bytes = bytes.len() as u64;
    let buffers = Buffers::load(path, &document, blob, bytes, repeated);
    let mut reading = GltfReading {
        path,
        options,
        document: &document,
        worlds: form::worlds(&document),
        buffers,
        model: Model { about: about(), ..Model::default() },
        materials: BTreeMap::new(),
        looks: Vec::new(),
        files: TextureFiles::default(),
        is_above: vec![false; document.nodes().len()],
        visits: 0,
        sharing: sharing::plan(&document),
        placed: 0,
        counts,
        photometry,
        bytes,
        watch,
    };
    reading.note_extensions(&document);
    reading.decode_textures();
    for node in sharing::roots(&document) {
        reading.node(&node, DMat4::IDENTITY, 0)?;
    }
    if reading.files.turned > 0 {
        reading.counts.insert(TURNED.to_owned(), reading.files.turned);
    }
    for (what, count) in &reading.counts {
        warnings.push(path, None, format!("{what} ({count})"));
    }
    reading.finish_shading();
    let mut model = reading.model;
    if model.triangles.is_empty() && model.placements.is_empty() {
        let meshes = document.meshes().len();
        let mut instead = format!("it is glTF whose meshes ({meshes}) have no triangle in view");
        for (what, count) in &reading.counts {
            instead += &format!("; {what} ({count})");
        }
        model.instead = Some(instead);
    }
    Ok(model)
}

/// A file that was parsed.
struct GltfParts {
    document: gltf::Document,
    /// The binary chunk of a `.glb`.
    blob: Option<Vec<u8>>,
    /// Counts of what was dropped or replaced.
    counts: BTreeMap<String, usize>,
    /// Photometric files, by the index of the node that names them.
    photometry: BTreeMap<usize, String>,
}

/// Parses and validates the JSON.
fn parse(path: &Path, bytes: &[u8]) -> Result<GltfParts, SceneError> {
    let problem = |problem: String| SceneError::Gltf { path: path.to_owned(), problem };
    let (json, blob) = container::open(bytes).map_err(problem)?;
    let mended = mend::mend(json, blob.is_some()).map_err(problem)?;
    let document = gltf::Document::from_json_without_validation(mended.json);
    Ok(GltfParts { document, blob, counts: mended.counts, photometry: mended.photometry })
}

/// Facts that the format fixes for all its files.
fn about() -> ModelFacts {
    let said = "glTF 2.0".to_owned();
    ModelFacts {
        up: Some(StatedValue { value: [0.0, 1.0, 0.0], words: said.clone() }),
        unit: Some(StatedValue { value: 1.0, words: said }),
        ..ModelFacts::default()
    }
}

impl GltfReading<'_> {
    fn note_extensions(&mut self, document: &gltf::Document) {
        for name in document.extensions_used() {
            if !materials::READ_EXTENSIONS.contains(&name) && !READ_EXTENSIONS.contains(&name) {
                self.count(format!("the extension `{}` is ignored", excerpt(name)));
            }
        }
    }

    fn node(&mut self, node: &gltf::Node, parent: DMat4, depth: usize) -> Result<(), SceneError> {
        let name = node.name().map_or_else(|| node.index().to_string(), excerpt);
        if depth > MAX_DEPTH {
            return Err(self.problem(format!("node {name} lies more than {MAX_DEPTH} nodes deep")));
        }
        if std::mem::replace(&mut self.is_above[node.index()], true) {
            self.count("nodes that are their own descendants are left out there");
            return Ok(());
        }
        self.visits += 1;
        if self.visits > self.document.nodes().len() + MAX_REVISITED {
            let text = "so many nodes have several parents that copies of them have no end";
            return Err(self.problem(text.to_owned()));
        }
        let own = DMat4::from_cols_array_2d(&node.transform().matrix().map(|c| c.map(f64::from)));
        let matrix = parent * own;
        if !matrix.is_finite() {
            return Err(self.problem(format!("the transform of node {name} is not finite")));
        }
        if let Some(mesh) = node.mesh() {
            let mesh_name = mesh.name().map_or_else(|| mesh.index().to_string(), excerpt);
            self.mesh(node, &mesh, matrix).map_err(|error| match error {
                SceneError::Gltf { path, problem } => {
                    let problem = format!("node {name}, mesh {mesh_name}: {problem}");
                    SceneError::Gltf { path, problem }
                }
                other => other,
            })?;
        }
        if let Some(camera) = node.camera() {
            self.camera(&camera, &name, matrix);
        }
        let has_luminaire = photometry::add(self, node, &name, matrix);
        if let Some(light) = node.light().filter(|_| !has_luminaire) {
            lights::add(self, &light, &name, matrix);
        }
        let triangles = (self.model.triangles.len() + self.placed) as u64;
        (self.watch)(LoadProgress { bytes: self.bytes, total_bytes: self.bytes, triangles });
        node.children().try_for_each(|child| self.node(&child, matrix, depth + 1))?;
        self.is_above[node.index()] = false;
        Ok(())
    }

    /// Adds the mesh of a node, once for each instance that the node states.
    fn mesh(
        &mut self,
        node: &gltf::Node,
        mesh: &gltf::Mesh,
        matrix: DMat4,
    ) -> Result<(), SceneError> {
        let form = Form::of(self, node, mesh, matrix).map_err(|problem| self.problem(problem))?;
        let instances = instancing::places(node, self.document, &self.buffers)
            .map_err(|problem| self.problem(problem))?;
        let Some(instances) = instances.filter(|_| form.is_rigid()) else {
            return self.mesh_at(mesh, &form);
        };
        instances.into_iter().try_for_each(|place| {
            let matrix = matrix * place;
            if matrix.is_finite() {
                return self.mesh_at(mesh, &Form::rigid(matrix));
            }
            self.count("instances whose place is not finite are left out");
            Ok(())
        })
    }

    fn mesh_at(&mut self, mesh: &gltf::Mesh, form: &Form) -> Result<(), SceneError> {
        if form.is_rigid() && self.share(mesh, form.matrix)? {
            return Ok(());
        }
        mesh.primitives().try_for_each(|primitive| self.primitive(&primitive, form))
    }

    fn primitive(&mut self, primitive: &gltf::Primitive, form: &Form) -> Result<(), SceneError> {
        let mode = primitive.mode();
        if matches!(mode, Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip) {
            self.count("points and lines are ignored");
            return Ok(());
        }
        let Some(positions) = primitive.get(&gltf::Semantic::Positions) else {
            self.count("primitives without positions are ignored");
            return Ok(());
        };
        let mut positions = accessor::floats::<3>(&positions, &self.buffers)
            .map_err(|problem| self.problem(problem))?;
        form.morph(primitive, gltf::Semantic::Positions, &mut positions, &self.buffers)
            .map_err(|problem| self.problem(problem))?;
        let places = form.places(primitive, self).map_err(|problem| self.problem(problem))?;
        let indices = match primitive.indices() {
            Some(accessor) => accessor::indices(&accessor, &self.buffers)
                .map_err(|problem| self.problem(problem))?,
            None => (0..positions.len() as u32).collect(),
        };
        // The corners of its triangles.
        let corners_of = corners(mode, &indices).size_hint().0 * 3;
        self.buffers.count(corners_of).map_err(|problem| self.problem(problem))?;
        let first = self.model.positions.len();
        if first + positions.len() > MAX_POSITIONS
            || self.model.triangles.len() + self.placed + indices.len() > MAX_TRIANGLES
        {
            let limit = MAX_TRIANGLES as u64;
            let count = (self.model.triangles.len() + self.placed + indices.len()) as u64;
            return Err(SceneError::Limit { what: "triangles", count, limit });
        }
        let material = self.material(&primitive.material())?;
        let count = positions.len() as u32;
        let place = |(vertex, p): (usize, &[f32; 3])| {
            places.matrix(vertex).transform_point3(Vec3::from(*p).as_dvec3())
        };
        let placed: Vec<DVec3> = positions.iter().enumerate().map(place).collect();
        let problem = |problem: String| SceneError::Gltf { path: self.path.to_owned(), problem };
        let normals = self.normals(primitive, form, &places).map_err(problem)?;
        let uvs = self.coordinates(primitive, material).map_err(|text| self.problem(text))?;
        let colours = self.colours(primitive).map_err(|text| self.problem(text))?;
        if colours.is_some() {
            self.model.shading.colours.to_mut().resize(self.model.triangles.len(), [WHITE; 3]);
        }
        let opacities = self.opacities(primitive, material).map_err(|text| self.problem(text))?;
        if opacities.is_some() {
            self.model.shading.opacities.to_mut().resize(self.model.triangles.len(), [u8::MAX; 3]);
        }
        if uvs.is_some() {
            self.model.shading.uvs.to_mut().resize(self.model.triangles.len(), [[0.0; 2]; 3]);
        }
        if normals.is_some() {
            self.fill_normals();
        }
        // All positions first, because facets are made of them. Unusable ones are in no triangle.
        let finite = |p: &DVec3| if p.is_finite() { *p } else { DVec3::ZERO };
        self.model.positions.extend(placed.iter().map(finite));
        let is_usable = |corner: u32| {
            placed.get(corner as usize).is_some_and(|p| p.abs().max_element() <= MAX_COORDINATE)
        };
        let is_turned = form.matrix.determinant() < 0.0;
        let mut bad = 0;
        for [a, b, c] in corners(mode, &indices) {
            if ![a, b, c].into_iter().all(|corner| corner < count && is_usable(corner)) {
                bad += 1;
                continue;
            }
            let is_turned = match form.is_posed() {
                true => places.matrix(a as usize).determinant() < 0.0,
                false => is_turned,
            };
            let corners = if is_turned { [a, c, b] } else { [a, b, c] };
            let triangle = corners.map(|corner| first as u32 + corner);
            self.model.triangles.push(triangle);
            self.model.material_ids.push(material);
            let shading = &mut self.model.shading;
            if let Some(uvs) = &uvs {
                let of = |corner: u32| uvs.get(corner as usize).copied().unwrap_or([0.0; 2]);
                shading.uvs.to_mut().push(corners.map(of));
            }
            if let Some(colours) = &colours {
                let of = |corner: u32| colours.get(corner as usize).copied().unwrap_or(WHITE);
                shading.colours.to_mut().push(corners.map(of));
            }
            if let Some(opacities) = &opacities {
                let of = |corner: u32| opacities.get(corner as usize).copied().unwrap_or(u8::MAX);
                shading.opacities.to_mut().push(corners.map(of));
            }
            if let Some(normals) = &normals {
                let of = |corner: u32| normals.get(corner as usize).copied().unwrap_or(Vec3::ZERO);
                let facet = smooth::facet(&self.model.positions, triangle);
                shading.normals.to_mut().push(smooth::packed(facet, corners.map(of)));
            }
        }
        if bad > 0 {
            let what = "triangles that name no vertex, or one beyond 1e12, are left out";
            *self.counts.entry(what.to_owned()).or_default() += bad;
        }
        Ok(())
    }

    /// Returns the index of a material, which is made once.
    fn material(&mut self, material: &gltf::Material) -> Result<u32, SceneError> {
        if let Some(&index) = self.materials.get(&material.index()) {
            return Ok(index);
        }
        let finish = self.mean_finish(material);
        let (mut made, base) = materials::make(material, finish, self.options, &mut self.counts);
        let is_finished = materials::has_finish(material, &made);
        let mut look = self.look(material, is_finished);
        if look.lacks_colour {
            made.bsdf = greyed(made.bsdf);
        }
        if look.lacks_emission {
            made.emission = [0.0; 3];
        }
        if let Some(bsdf) = base {
            look.cover.base = Some(self.base(material, bsdf));
            if finish.is_some() {
                self.count("materials that are glass in part have their mean roughness");
            }
        }
        if matches!(made.bsdf, Bsdf::Dielectric { .. }) && look.cover.is_partial() {
            self.count("materials of solid glass with an alpha are whole");
            look.cover = Cover { base: look.cover.base, ..Cover::default() };
        }
        let id = self.add_material(material.index(), made)?;
        self.looks[id as usize] = look;
        Ok(id)
    }

    /// Completes the attributes of triangles that have none. An attribute that only some triangles
    /// have becomes one of all, those of shared meshes included.
    fn finish_shading(&mut self) {
        let Model { shading: own, meshes, .. } = &self.model;
        let shadings = || meshes.iter().map(|mesh| &mesh.shading).chain([own]);
        let is_curved = shadings().any(|shading| shading.normals.iter().any(smooth::is_curved));
        let is_coloured = shadings().any(|shading| !shading.colours.is_empty());
        let has_opacities = shadings().any(|shading| !shading.opacities.is_empty());
        if is_curved {
            self.fill_normals();
            self.model.meshes.iter_mut().for_each(Self::fill_normals_of);
        }
        let textures = std::mem::take(&mut self.files.textures);
        let finish = |shading: &mut Shading, triangles: usize| {
            if is_coloured {
                shading.colours.to_mut().resize(triangles, [WHITE; 3]);
            }
            if has_opacities {
                shading.opacities.to_mut().resize(triangles, [u8::MAX; 3]);
            }
            if !is_curved {
                shading.normals.to_mut().clear();
            }
            if !textures.is_empty() {
                shading.uvs.to_mut().resize(triangles, [[0.0; 2]; 3]);
            }
        };
        finish(&mut self.model.shading, self.model.triangles.len());
        self.model
            .meshes
            .iter_mut()
            .for_each(|mesh| finish(&mut mesh.shading, mesh.triangles.len()));
        if !textures.is_empty() {
            self.model.shading.maps = self.looks.iter().map(|look| look.maps).collect();
        }
        self.model.shading.textures = textures;
        let covers = self.looks.iter().map(|look| match look.cover {
            // Without opacities of corners, all of the surface is on one side of the cutoff.
            Cover { opacity, least, .. } if least > 0.0 && opacity >= least && !has_opacities => {
                Cover { base: look.cover.base, ..Cover::default() }
            }
            cover => cover,
        });
        self.model.shading.covers = covers.collect();
    }

    fn camera(&mut self, camera: &gltf::Camera, node: &str, matrix: DMat4) {
        let vector = |v: DVec3| matrix.transform_vector3(v).normalize_or_zero().to_array();
        let (height, is_parallel) = match camera.projection() {
            gltf::camera::Projection::Perspective(p) => (f64::from(p.yfov()).to_degrees(), false),
            gltf::camera::Projection::Orthographic(o) => (2.0 * f64::from(o.ymag()), true),
        };
        let (direction, up) = (vector(DVec3::NEG_Z), vector(DVec3::Y));
        let plausible = if is_parallel { height > 0.0 } else { (0.1..170.0).contains(&height) };
        if direction == [0.0; 3] || up == [0.0; 3] || !plausible || !height.is_finite() {
            self.count("cameras without a plausible view are ignored");
            return;
        }
        let name = camera.name().map_or_else(|| node.to_owned(), excerpt);
        let eye = matrix.transform_point3(DVec3::ZERO).to_array();
        self.model.about.cameras.push(ModelCamera {
            name,
            eye,
            direction,
            up,
            height,
            is_parallel,
        });
    }
}

/// Returns the corners of each triangle of a primitive.
fn corners(mode: Mode, indices: &[u32]) -> Box<dyn Iterator<Item = [u32; 3]> + '_> {
    match mode {
        Mode::TriangleStrip => Box::new(indices.windows(3).enumerate().map(|(k, w)| {
            // Every other triangle of a strip is turned.
            if k % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] }
        })),
        Mode::TriangleFan => {
            let first = indices.first().copied().unwrap_or(0);
            Box::new(indices.get(1..).unwrap_or(&[]).windows(2).map(move |w| [first, w[0], w[1]]))
        }
        _ => Box::new(indices.as_chunks::<3>().0.iter().copied()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LoadOptions;
    use crate::warnings::Warnings;

    /// Reads nodes that have this primitive. Accessors 0 and 1 are a triangle, and accessor 2 has
    /// hardly any bytes.
    fn read_nodes(nodes: usize, primitive: &str, repeated: u64) -> Result<Model, SceneError> {
        let data = "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAEC";
        let json = format!(
            r#"{{"asset":{{"version":"2.0"}},"nodes":[{}],"meshes":[{{"primitives":[{primitive}]}}],
            "buffers":[{{"byteLength":39,"uri":"data:application/octet-stream;base64,{data}"}}],
            "bufferViews":[{{"buffer":0,"byteLength":36}},
                {{"buffer":0,"byteOffset":36,"byteLength":3}}],
            "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}},
                {{"bufferView":1,"componentType":5121,"count":3,"type":"SCALAR"}},
                {{"componentType":5126,"count":9000,"type":"VEC3","sparse":{{"count":1,
                "indices":{{"bufferView":1,"componentType":5121}},
                "values":{{"bufferView":0}}}}}}]}}"#,
            vec![r#"{"mesh":0}"#; nodes].join(",")
        );
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("s.gltf");
        std::fs::write(&path, json).unwrap();
        let (options, mut warnings) = (LoadOptions::default(), Warnings::default());
        let (options, warnings) = (&options, &mut warnings);
        read_bounded(ModelFile { path: &path, options, watch: &mut |_| {}, warnings }, repeated)
    }

    #[test]
    fn a_small_file_cannot_name_the_same_arrays_without_end() {
        let triangle = r#"{"attributes":{"POSITION":0},"indices":1}"#;
        assert_eq!(read_nodes(1000, triangle, 0).unwrap().triangles.len(), 1000);
        let of_zeros = [r#""POSITION":2"#, r#""POSITION":0,"NORMAL":2"#];
        for attributes in of_zeros {
            let primitive = format!(r#"{{"attributes":{{{attributes}}}}}"#);
            assert!(read_nodes(10, &primitive, 200_000).is_ok());
            let error = read_nodes(10, &primitive, 50_000).err().unwrap().to_string();
            assert!(error.contains("mesh 0: the nodes up to here need more than "), "{error}");
        }
    }
}
