//! Textures in MTL files: `map_Kd` (colour), `map_Ke` (emission), `map_d` (opacity), `map_Pr`
//! (roughness), `map_Pm` (metalness), `norm` and `map_Bump` (normals).
//!
//! These options before a file's name have an effect: `-s` and `-o` (placement of the texture),
//! `-clamp`, `-bm` (strength of normals) and `-imfchan` (the channel of a number). Others are
//! skipped. The file is searched for in the same way as any other file that a model names.
//!
//! Exporters use `map_Bump` for pictures of normals and of heights alike. A picture counts as
//! normals only if its mean is a unit vector that points off the surface. Heights have no stated
//! unit, and are left out with a warning.

use std::path::Path;

use glam::Vec3;

use crate::shading::{CUT_OUT, Channel, CutOut, FinishMap, NormalMap};
use crate::text::{excerpt, number};
use crate::texture::{Texture, Wrap};
use crate::texture_files::TextureFiles;
use crate::texture_use::TextureUse;
use crate::warnings::Warnings;
use crate::{Maps, exporter::DEFAULT_ROUGHNESS};

/// The property that a texture changes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MapSlot {
    Base,
    Emission,
    Opacity,
    Normal,
    Roughness,
    Metalness,
}

impl MapSlot {
    /// Returns the slot of a keyword in lower case.
    pub(crate) fn of(keyword: &str) -> Option<MapSlot> {
        match keyword {
            "map_kd" => Some(MapSlot::Base),
            "map_ke" => Some(MapSlot::Emission),
            "map_d" | "map_opacity" => Some(MapSlot::Opacity),
            "norm" | "map_bump" | "bump" | "map_kn" => Some(MapSlot::Normal),
            "map_pr" => Some(MapSlot::Roughness),
            "map_pm" => Some(MapSlot::Metalness),
            _ => None,
        }
    }
}

/// The placement of a texture on a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MapOptions {
    scale: [f32; 2],
    offset: [f32; 2],
}

impl Default for MapOptions {
    fn default() -> MapOptions {
        MapOptions { scale: [1.0; 2], offset: [0.0; 2] }
    }
}

impl MapOptions {
    /// Returns the texture's coordinates, down from its top, at `vt`, which counts from its bottom.
    pub(crate) fn of(&self, [u, v]: [f32; 2]) -> [f32; 2] {
        let [x, y] = [u * self.scale[0] + self.offset[0], v * self.scale[1] + self.offset[1]];
        let [x, y] = [x, 1.0 - y];
        [x, y].map(|c| if c.is_finite() { c } else { 0.0 })
    }
}

/// A statement about a texture.
#[derive(Clone, Debug)]
pub(crate) struct MapStatement {
    pub slot: MapSlot,
    pub line: usize,
    file: String,
    placement: MapOptions,
    wrap: Wrap,
    strength: f32,
    channel: u8,
}

impl MapStatement {
    /// Reads what follows the keyword; `None` if it names no file.
    pub(crate) fn read(slot: MapSlot, line: usize, text: &str) -> Option<MapStatement> {
        let (mut placement, mut wrap, mut rest) =
            (MapOptions::default(), Wrap::Repeat, text.trim());
        let (mut strength, mut channel) = (1.0, 0);
        while let Some((option, after)) =
            rest.split_once(char::is_whitespace).filter(|(option, _)| option.starts_with('-'))
        {
            rest = after.trim_start();
            match option {
                "-s" => numbers(&mut rest, &mut placement.scale),
                "-o" => numbers(&mut rest, &mut placement.offset),
                "-t" => numbers(&mut rest, &mut []),
                "-mm" => {
                    word(&mut rest);
                    word(&mut rest);
                }
                "-bm" => {
                    strength = number(word(&mut rest)).map_or(1.0, |n| n as f32);
                }
                "-imfchan" => {
                    channel = match word(&mut rest) {
                        "g" => 1,
                        "b" => 2,
                        _ => 0,
                    }
                }
                "-clamp" if word(&mut rest) == "on" => wrap = Wrap::Clamp,
                "-clamp" => {}
                _ => {
                    word(&mut rest);
                }
            }
        }
        let file = rest.trim_matches('"').to_owned();
        (!file.is_empty()).then_some(MapStatement {
            slot,
            line,
            file,
            placement,
            wrap,
            strength,
            channel,
        })
    }
}

impl MapStatement {
    /// Returns the file's name, as it is written.
    pub(crate) fn file(&self) -> &str {
        &self.file
    }

    /// Returns how its picture is used.
    pub(crate) fn how(&self) -> TextureUse {
        let is_colour = matches!(self.slot, MapSlot::Base | MapSlot::Emission);
        let is_mask = self.slot == MapSlot::Opacity;
        TextureUse { wrap: [self.wrap; 2], is_linear: !is_colour, is_mask }
    }
}

/// Takes the next word off a text.
fn word<'a>(text: &mut &'a str) -> &'a str {
    let (word, rest) = text.split_once(char::is_whitespace).unwrap_or((text, ""));
    *text = rest.trim_start();
    word
}

/// Takes up to three numbers off a text, and keeps the first ones.
fn numbers(text: &mut &str, kept: &mut [f32]) {
    for k in 0..3 {
        let next = text.split_whitespace().next().and_then(number);
        // The last word is the file's name, even if it is a number.
        let Some(next) = next.filter(|_| text.contains(char::is_whitespace)) else { return };
        word(text);
        if let Some(place) = kept.get_mut(k) {
            *place = next as f32;
        }
    }
}

/// The textures of a material, and their placement.
#[derive(Clone, Copy, Default)]
pub(crate) struct MtlTextures {
    pub maps: Maps,
    pub placement: MapOptions,
    /// True if the texture of its colour, or of its emission, cannot be read.
    pub lacks_colour: bool,
    pub lacks_emission: bool,
}

/// Returns the textures of a material of the MTL file `path`. One that cannot be read is a warning.
/// `finish` are its roughness and metalness, factors to their textures.
pub(crate) fn textures(
    path: &Path,
    statements: &[MapStatement],
    finish: [Option<f32>; 2],
    files: &mut TextureFiles,
    warnings: &mut Warnings,
) -> MtlTextures {
    let mut maps = Maps::default();
    let (mut lacks_colour, mut lacks_emission) = (false, false);
    // Exporters write a roughness of zero beside its texture, and mean the texture.
    let [roughness, metalness] = finish.map(|factor| factor.filter(|&factor| factor > 0.0));
    let mut numbers = [None; 2];
    for statement in statements {
        let how = statement.how();
        let mut warn = |problem: String| {
            let instead = match statement.slot {
                MapSlot::Base => "grey 0.5 is taken",
                _ => "it is left out",
            };
            let text = format!("`{}`: {problem}; {instead}", excerpt(&statement.file));
            warnings.push(path, Some(statement.line), text);
        };
        let found = files.file(path, &statement.file, how).unwrap_or_else(|problem| {
            warn(problem);
            None
        });
        let number = |factor: Option<f32>| {
            let (channel, factor) = (statement.channel, factor.unwrap_or(1.0));
            found.map(|texture| Channel { texture: Some(texture), channel, factor })
        };
        match statement.slot {
            MapSlot::Base => (maps.base, lacks_colour) = (found, found.is_none()),
            MapSlot::Emission => (maps.emission, lacks_emission) = (found, found.is_none()),
            MapSlot::Opacity => {
                maps.cut_out = found.map(|texture| CutOut { texture, least: CUT_OUT });
            }
            MapSlot::Roughness => numbers[0] = number(roughness),
            MapSlot::Metalness => numbers[1] = number(metalness),
            MapSlot::Normal => {
                let has_normals = |&texture: &u32| is_of_normals(&files.textures[texture as usize]);
                if found.is_some_and(|texture| !has_normals(&texture)) {
                    warn("it has heights, not normals".to_owned());
                }
                let strength = statement.strength;
                let normals = found.filter(has_normals);
                maps.normal = normals.map(|texture| NormalMap { texture, strength });
            }
        }
    }
    if numbers.iter().any(Option::is_some) {
        let constant = |factor| Channel { texture: None, channel: 0, factor };
        let [rough, metal] = numbers;
        maps.finish = Some(FinishMap {
            roughness: rough.unwrap_or(constant(finish[0].unwrap_or(DEFAULT_ROUGHNESS))),
            metalness: metal.unwrap_or(constant(finish[1].unwrap_or(0.0))),
        });
    }
    // One placement for all: a triangle has one set of coordinates.
    let first = statements.iter().min_by_key(|statement| statement.slot as u8);
    let placement = first.map_or(MapOptions::default(), |statement| statement.placement);
    MtlTextures { maps, placement, lacks_colour, lacks_emission }
}

/// Returns whether a picture has normals: on average they are nearly of unit length, point off the
/// surface, and are not grey.
fn is_of_normals(picture: &Texture) -> bool {
    let [x, y, z, _] = picture.at([0.5; 2], f32::MAX).map(|c| 2.0 * c - 1.0);
    let length = Vec3::new(x, y, z).length();
    let colour = (x - z).abs().max((y - z).abs());
    z > 0.5 && (0.6..1.15).contains(&length) && colour > 0.3
}

/// Returns the mean roughness and metalness of a finish.
pub(crate) fn mean_finish(finish: &FinishMap, files: &TextureFiles) -> [f32; 2] {
    [finish.roughness, finish.metalness].map(|Channel { texture, channel, factor }| {
        let mean = texture.map_or(1.0, |texture| {
            files.textures[texture as usize].at([0.5; 2], f32::MAX)[usize::from(channel)]
        });
        factor * mean
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn options_and_names_are_told_apart() {
        let read = |text: &str| MapStatement::read(MapSlot::Base, 1, text).unwrap();
        let plain = MapOptions::default();
        for (text, file, placement, wrap) in [
            ("wood.png", "wood.png", plain, Wrap::Repeat),
            ("my wood.png", "my wood.png", plain, Wrap::Repeat),
            ("-clamp on \"my wood.png\"", "my wood.png", plain, Wrap::Clamp),
            (
                "-s 2 3 1 -o 0.5 0 0 7",
                "7",
                MapOptions { scale: [2.0, 3.0], offset: [0.5, 0.0] },
                Wrap::Repeat,
            ),
            (
                "-bm 0.3 -mm 0 1 -s 4 -imfchan l a.jpg",
                "a.jpg",
                MapOptions { scale: [4.0, 1.0], ..plain },
                Wrap::Repeat,
            ),
        ] {
            let found = read(text);
            assert_eq!(
                (found.file.as_str(), found.placement, found.wrap),
                (file, placement, wrap),
                "{text}"
            );
        }
        assert!(
            MapStatement::read(MapSlot::Base, 1, "-s 1 1 1 ").is_none_or(|found| found.file == "1")
        );
        assert!(MapStatement::read(MapSlot::Base, 1, "").is_none());
        for (word, channel) in [("r", 0), ("g", 1), ("b", 2), ("l", 0)] {
            assert_eq!(read(&format!("-clamp off -imfchan {word} a.png")).channel, channel);
        }
    }

    #[test]
    fn textures_count_from_the_top() {
        let placement = MapOptions { scale: [2.0, 3.0], offset: [0.5, 0.25] };
        assert_eq!(placement.of([1.0, 0.0]), [2.5, 0.75]);
        assert_eq!(placement.of([f32::MAX, f32::MIN]), [0.0, 0.0]);
    }
}
