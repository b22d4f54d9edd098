//! The placement of textures on the surfaces of a glTF material.

use glam::{Mat2, Vec2};
use gltf::texture::TextureTransform;

use crate::{Cover, Maps};

/// The textures of a material, and where their coordinates come from.
#[derive(Clone, Copy, Default)]
pub(super) struct MaterialTextures {
    pub maps: Maps,
    pub cover: Cover,
    /// Number of the set of texture coordinates.
    pub set: u32,
    pub placement: MapTransform,
    /// True if the texture of its colour, or of its emission, cannot be read.
    pub lacks_colour: bool,
    pub lacks_emission: bool,
}

/// The placement of a texture on a surface (`KHR_texture_transform`).
#[derive(Clone, Copy, PartialEq)]
pub(super) struct MapTransform {
    turn: Mat2,
    offset: Vec2,
}

impl Default for MapTransform {
    fn default() -> MapTransform {
        MapTransform { turn: Mat2::IDENTITY, offset: Vec2::ZERO }
    }
}

impl MapTransform {
    pub(super) fn new(transform: Option<TextureTransform>) -> MapTransform {
        let Some(transform) = transform else { return MapTransform::default() };
        // Counter-clockwise in the file's coordinates, whose v runs down.
        let turn = Mat2::from_angle(-transform.rotation());
        let turn = turn * Mat2::from_diagonal(transform.scale().into());
        let placement = MapTransform { turn, offset: transform.offset().into() };
        let is_finite = placement.turn.is_finite() && placement.offset.is_finite();
        if is_finite { placement } else { MapTransform::default() }
    }

    pub(super) fn of(&self, uv: [f32; 2]) -> [f32; 2] {
        let placed = self.turn * Vec2::from(uv) + self.offset;
        if placed.is_finite() { placed.to_array() } else { [0.0; 2] }
    }
}
