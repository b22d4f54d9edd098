//! The members of a glTF file's JSON that are read, with the kinds of their values.
//!
//! Everything else in the JSON is dropped before the crate `gltf` validates it. So a fault in a
//! part that no picture needs cannot end a file.

use ValueKind::{
    AnyNumbers, Attributes, Code, Extensions, Flag, Index, Indices, Number, Numbers, Object,
    Objects, Size, Text, Whole, Word,
};

/// A list of the file's root object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum List {
    Scenes,
    Nodes,
    Meshes,
    Skins,
    Cameras,
    /// The list of `KHR_lights_punctual`.
    Lights,
    Materials,
    Textures,
    Samplers,
    Images,
    Accessors,
    BufferViews,
    Buffers,
}

/// The kind of a member's value.
#[derive(Clone, Copy, Debug)]
pub(super) enum ValueKind {
    Number,
    /// So many numbers; more are cut off.
    Numbers(usize),
    /// Any number of numbers.
    AnyNumbers,
    /// A whole number below 2³².
    Whole,
    /// A whole number below 2⁶⁴.
    Size,
    Flag,
    Text,
    /// One of these words.
    Word(&'static [&'static str]),
    /// One of these numbers.
    Code(&'static [u64]),
    /// An element of a list.
    Index(List),
    /// Elements of a list.
    Indices(List),
    /// Elements of the list of accessors, by name.
    Attributes,
    Object(Members),
    Objects(Members),
    /// An object whose other members stay as they are.
    Extensions(Members),
}

/// A member of an object.
#[derive(Clone, Copy, Debug)]
pub(super) struct Member {
    pub name: &'static str,
    pub kind: ValueKind,
    pub need: Requirement,
}

/// Whether an object can be used without a member.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Requirement {
    /// A false value is dropped.
    Optional,
    /// The member may be absent, but a false value makes the object useless.
    Sound,
    /// An object without it is useless.
    Required,
}

pub(super) type Members = &'static [Member];

const fn may(name: &'static str, kind: ValueKind) -> Member {
    Member { name, kind, need: Requirement::Optional }
}

const fn sound(name: &'static str, kind: ValueKind) -> Member {
    Member { name, kind, need: Requirement::Sound }
}

const fn must(name: &'static str, kind: ValueKind) -> Member {
    Member { name, kind, need: Requirement::Required }
}

impl List {
    /// All lists. Each one comes after those whose elements name its elements.
    pub(super) const ALL: [List; 13] = [
        List::Scenes,
        List::Nodes,
        List::Meshes,
        List::Skins,
        List::Cameras,
        List::Lights,
        List::Materials,
        List::Textures,
        List::Samplers,
        List::Images,
        List::Accessors,
        List::BufferViews,
        List::Buffers,
    ];

    /// Returns its name in the file, which is also the word for people.
    pub(super) fn name(self) -> &'static str {
        match self {
            List::Scenes => "scenes",
            List::Nodes => "nodes",
            List::Meshes => "meshes",
            List::Skins => "skins",
            List::Cameras => "cameras",
            List::Lights => "lights",
            List::Materials => "materials",
            List::Textures => "textures",
            List::Samplers => "samplers",
            List::Images => "images",
            List::Accessors => "accessors",
            List::BufferViews => "bufferViews",
            List::Buffers => "buffers",
        }
    }

    /// Returns the members of its elements.
    pub(super) fn members(self) -> Members {
        match self {
            List::Scenes => SCENE,
            List::Nodes => NODE,
            List::Meshes => MESH,
            List::Skins => SKIN,
            List::Cameras => CAMERA,
            List::Lights => LIGHT,
            List::Materials => MATERIAL,
            List::Textures => TEXTURE,
            List::Samplers => SAMPLER,
            List::Images => IMAGE,
            List::Accessors => ACCESSOR,
            List::BufferViews => BUFFER_VIEW,
            List::Buffers => BUFFER,
        }
    }

    /// Returns an element that the crate accepts, in place of those that are not used.
    pub(super) fn placeholder(self) -> &'static str {
        match self {
            List::Scenes => r#"{"nodes":[]}"#,
            List::Nodes | List::Materials | List::Textures | List::Samplers => "{}",
            List::Meshes => r#"{"primitives":[]}"#,
            List::Skins => r#"{"joints":[]}"#,
            List::Cameras => r#"{"type":"perspective","perspective":{"yfov":1,"znear":1}}"#,
            List::Lights => r#"{"type":"point"}"#,
            List::Images => r#"{"uri":""}"#,
            List::Accessors => r#"{"componentType":5126,"count":0,"type":"VEC3"}"#,
            List::BufferViews => r#"{"buffer":0,"byteLength":0}"#,
            List::Buffers => r#"{"byteLength":0,"uri":"data:;base64,"}"#,
        }
    }
}

const SCENE: Members = &[may("nodes", Indices(List::Nodes))];

const NODE: Members = &[
    may("name", Text),
    may("children", Indices(List::Nodes)),
    may("matrix", Numbers(16)),
    may("translation", Numbers(3)),
    may("rotation", Numbers(4)),
    may("scale", Numbers(3)),
    may("mesh", Index(List::Meshes)),
    may("skin", Index(List::Skins)),
    may("weights", AnyNumbers),
    may("camera", Index(List::Cameras)),
    may(
        "extensions",
        Object(&[
            may("KHR_lights_punctual", Object(&[must("light", Index(List::Lights))])),
            may("EXT_mesh_gpu_instancing", Object(&[must("attributes", Object(INSTANCES))])),
        ]),
    ),
];

const INSTANCES: Members = &[
    may("TRANSLATION", Index(List::Accessors)),
    may("ROTATION", Index(List::Accessors)),
    may("SCALE", Index(List::Accessors)),
];

const MESH: Members =
    &[may("name", Text), may("weights", AnyNumbers), must("primitives", Objects(PRIMITIVE))];

const PRIMITIVE: Members = &[
    must("attributes", Attributes),
    may("indices", Index(List::Accessors)),
    may("material", Index(List::Materials)),
    may("mode", Code(&[0, 1, 2, 3, 4, 5, 6])),
    may(
        "targets",
        Objects(&[may("POSITION", Index(List::Accessors)), may("NORMAL", Index(List::Accessors))]),
    ),
];

const SKIN: Members =
    &[must("joints", Indices(List::Nodes)), may("inverseBindMatrices", Index(List::Accessors))];

const CAMERA: Members = &[
    may("name", Text),
    must("type", Word(&["perspective", "orthographic"])),
    may("perspective", Object(&[must("yfov", Number)])),
    may("orthographic", Object(&[must("ymag", Number)])),
];

const LIGHT: Members = &[
    may("name", Text),
    must("type", Word(&["directional", "point", "spot"])),
    may("color", Numbers(3)),
    may("intensity", Number),
    may("range", Number),
    may("spot", Object(&[may("innerConeAngle", Number), may("outerConeAngle", Number)])),
];

const MATERIAL: Members = &[
    may("name", Text),
    may("pbrMetallicRoughness", Object(METALLIC_ROUGHNESS)),
    may("normalTexture", Object(TEXTURE_INFO)),
    may("occlusionTexture", Object(TEXTURE_INFO)),
    may("emissiveTexture", Object(TEXTURE_INFO)),
    may("emissiveFactor", Numbers(3)),
    may("alphaMode", Word(&["OPAQUE", "MASK", "BLEND"])),
    may("alphaCutoff", Number),
    may("doubleSided", Flag),
    may("extensions", Extensions(MATERIAL_EXTENSIONS)),
];

pub(super) const METALLIC_ROUGHNESS: Members = &[
    may("baseColorFactor", Numbers(4)),
    may("baseColorTexture", Object(TEXTURE_INFO)),
    may("metallicFactor", Number),
    may("roughnessFactor", Number),
    may("metallicRoughnessTexture", Object(TEXTURE_INFO)),
];

/// The extensions whose members the crate `gltf` reads. Others are looked up where they are used.
const MATERIAL_EXTENSIONS: Members = &[
    may("KHR_materials_emissive_strength", Object(&[may("emissiveStrength", Number)])),
    may("KHR_materials_ior", Object(&[may("ior", Number)])),
    may(
        "KHR_materials_pbrSpecularGlossiness",
        Object(&[
            may("diffuseFactor", Numbers(4)),
            may("diffuseTexture", Object(TEXTURE_INFO)),
            may("specularFactor", Numbers(3)),
            may("glossinessFactor", Number),
            may("specularGlossinessTexture", Object(TEXTURE_INFO)),
        ]),
    ),
    may(
        "KHR_materials_specular",
        Object(&[
            may("specularFactor", Number),
            may("specularTexture", Object(TEXTURE_INFO)),
            may("specularColorFactor", Numbers(3)),
            may("specularColorTexture", Object(TEXTURE_INFO)),
        ]),
    ),
    may(
        "KHR_materials_transmission",
        Object(&[
            may("transmissionFactor", Number),
            may("transmissionTexture", Object(TEXTURE_INFO)),
        ]),
    ),
    may("KHR_materials_unlit", Object(&[])),
    may(
        "KHR_materials_volume",
        Object(&[
            may("thicknessFactor", Number),
            may("thicknessTexture", Object(TEXTURE_INFO)),
            may("attenuationDistance", Number),
            may("attenuationColor", Numbers(3)),
        ]),
    ),
];

/// A texture that does not exist becomes one without a picture, so that it is known to be missing.
const TEXTURE_INFO: Members = &[
    must("index", Index(List::Textures)),
    may("texCoord", Whole),
    may("scale", Number),
    may("strength", Number),
    may(
        "extensions",
        Object(&[may(
            "KHR_texture_transform",
            Object(&[
                may("offset", Numbers(2)),
                may("rotation", Number),
                may("scale", Numbers(2)),
                may("texCoord", Whole),
            ]),
        )]),
    ),
];

const TEXTURE: Members =
    &[may("sampler", Index(List::Samplers)), may("source", Index(List::Images))];

const SAMPLER: Members =
    &[may("wrapS", Code(&[33071, 33648, 10497])), may("wrapT", Code(&[33071, 33648, 10497]))];

const IMAGE: Members =
    &[may("name", Text), may("uri", Text), may("bufferView", Index(List::BufferViews))];

const COMPONENTS: &[u64] = &[5120, 5121, 5122, 5123, 5125, 5126];

const ACCESSOR: Members = &[
    sound("bufferView", Index(List::BufferViews)),
    sound("byteOffset", Size),
    must("componentType", Code(COMPONENTS)),
    must("count", Size),
    must("type", Word(&["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"])),
    sound("normalized", Flag),
    sound(
        "sparse",
        Object(&[
            must("count", Size),
            must(
                "indices",
                Object(&[
                    must("bufferView", Index(List::BufferViews)),
                    sound("byteOffset", Size),
                    must("componentType", Code(&[5121, 5123, 5125])),
                ]),
            ),
            must(
                "values",
                Object(&[must("bufferView", Index(List::BufferViews)), sound("byteOffset", Size)]),
            ),
        ]),
    ),
];

const BUFFER_VIEW: Members = &[
    must("buffer", Index(List::Buffers)),
    sound("byteOffset", Size),
    must("byteLength", Size),
    sound("byteStride", Size),
];

const BUFFER: Members = &[may("uri", Text)];
