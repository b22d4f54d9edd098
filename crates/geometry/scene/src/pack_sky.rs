//! The sky of a packed scene, if it is not the same in every direction.
//!
//! The format is in [`crate::pack`].

use bytemuck::{Pod, Zeroable};
use glam::DVec3;
use holo_daylight::{SkyFormula, SkyShape};

use crate::limits::MAX_SKY_BYTES;
use crate::pack_values::split;
use crate::sky::{FormulaSky, PictureSky, Sky, SkyAxes, SkyLight};
use crate::sky_picture::{MAX_SKY_SIDE, SkyPicture};
use crate::{PackedError, Sun};

/// What every sky begins with.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct SkyHeader {
    kind: [u8; 4],
    has_sun: [u8; 4],
    sun: [[[u8; 4]; 3]; 2],
    axes: [[[u8; 8]; 3]; 3],
}
const _: () = assert!(size_of::<SkyHeader>() == 104);

/// A sky by a formula.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct FormulaBytes {
    ground: [[u8; 4]; 3],
    colour: [[u8; 4]; 3],
    scale: [u8; 8],
    sun: [[u8; 8]; 3],
    factors: [[u8; 8]; 6],
}
const _: () = assert!(size_of::<FormulaBytes>() == 104);

/// A sky that is a picture, before its pixels.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct PictureBytes {
    width: [u8; 4],
    scale: [u8; 4],
}
const _: () = assert!(size_of::<PictureBytes>() == 8);

const EVEN: u32 = 0;
const SHAPES: u32 = 1;
const PICTURE: u32 = 16;

/// Returns the bytes of a sky; none if it is plain.
pub(crate) fn pack_sky(sky: &Sky) -> Vec<u8> {
    let mut out = Vec::new();
    if sky.is_plain() {
        return out;
    }
    let kind = match &sky.light {
        SkyLight::Even(_) => EVEN,
        SkyLight::Formula(formula) => SHAPES + code(&formula.formula.shape),
        SkyLight::Picture(_) => PICTURE,
    };
    let axes = match &sky.light {
        SkyLight::Even(_) => None,
        SkyLight::Formula(formula) => Some(formula.axes),
        SkyLight::Picture(picture) => Some(picture.axes),
    };
    let axes = axes.map_or([DVec3::ZERO; 3], |axes| [axes.east, axes.north, axes.up]);
    let sun = sky.sun.map_or([[0.0; 3]; 2], |sun| [sun.towards, sun.irradiance]);
    let header = SkyHeader {
        kind: kind.to_le_bytes(),
        has_sun: u32::from(sky.sun.is_some()).to_le_bytes(),
        sun: sun.map(|vector| vector.map(f32::to_le_bytes)),
        axes: axes.map(|axis| axis.to_array().map(f64::to_le_bytes)),
    };
    out.extend_from_slice(bytemuck::bytes_of(&header));
    match &sky.light {
        SkyLight::Even(_) => {}
        SkyLight::Formula(sky) => out.extend_from_slice(bytemuck::bytes_of(&FormulaBytes {
            ground: sky.ground.map(f32::to_le_bytes),
            colour: sky.colour.map(f32::to_le_bytes),
            scale: sky.formula.scale.to_le_bytes(),
            sun: sky.formula.sun.to_array().map(f64::to_le_bytes),
            factors: factors(&sky.formula.shape).map(f64::to_le_bytes),
        })),
        SkyLight::Picture(sky) => {
            out.extend_from_slice(bytemuck::bytes_of(&PictureBytes {
                width: (sky.picture.width as u32).to_le_bytes(),
                scale: sky.scale.to_le_bytes(),
            }));
            let numbers = sky.picture.pixels.as_flattened();
            numbers.iter().for_each(|number| out.extend(number.to_le_bytes()));
        }
    }
    out
}

fn code(shape: &SkyShape) -> u32 {
    match shape {
        SkyShape::Even => 0,
        SkyShape::Overcast => 1,
        SkyShape::Gradation { .. } => 2,
        SkyShape::Intermediate => 3,
    }
}

fn factors(shape: &SkyShape) -> [f64; 6] {
    match *shape {
        SkyShape::Gradation { factors } => factors,
        _ => [0.0; 6],
    }
}

/// Reads a sky. `even` is that of the scene's header. Bytes that a sky has not are refused.
pub(crate) fn unpack_sky(bytes: &[u8], even: Sky) -> Result<Sky, PackedError> {
    if bytes.is_empty() {
        return Ok(even);
    }
    let sky = read(bytes, &even).ok_or(PackedError::Sky)?;
    // A sky has one packing.
    if pack_sky(&sky) == bytes { Ok(sky) } else { Err(PackedError::Sky) }
}

fn read(bytes: &[u8], even: &Sky) -> Option<Sky> {
    if bytes.len() > MAX_SKY_BYTES {
        return None;
    }
    let (header, rest) = split::<SkyHeader>(bytes)?;
    let vectors = header.sun.map(|vector| vector.map(f32::from_le_bytes));
    let [towards, irradiance] = vectors;
    let sun = match u32::from_le_bytes(header.has_sun) {
        0 => None,
        1 => Some(Sun { towards, irradiance }),
        _ => return None,
    };
    let [east, north, up] = header.axes.map(|axis| DVec3::from_array(axis.map(f64::from_le_bytes)));
    let axes = SkyAxes { east, north, up };
    let light = match u32::from_le_bytes(header.kind) {
        EVEN => even.light.clone(),
        PICTURE => {
            let (picture, numbers) = split::<PictureBytes>(rest)?;
            let width = u32::from_le_bytes(picture.width) as usize;
            let (numbers, []) = numbers.as_chunks::<12>() else { return None };
            if width > MAX_SKY_SIDE || numbers.len() != width * width / 2 {
                return None;
            }
            let colour = |bytes: &[u8; 12]| {
                let words = bytes.as_chunks::<4>().0;
                std::array::from_fn(|k| words.get(k).map_or(0.0, |word| f32::from_le_bytes(*word)))
            };
            let pixels = numbers.iter().map(colour).collect();
            let pictured = SkyPicture::new(width, width / 2, pixels).ok()?;
            let scale = f32::from_le_bytes(picture.scale);
            SkyLight::Picture(Box::new(PictureSky { picture: pictured.into(), scale, axes }))
        }
        kind => {
            let (formula, []) = split::<FormulaBytes>(rest)? else { return None };
            let factors = formula.factors.map(f64::from_le_bytes);
            let shape = match kind - SHAPES {
                0 => SkyShape::Even,
                1 => SkyShape::Overcast,
                2 => SkyShape::Gradation { factors },
                3 => SkyShape::Intermediate,
                _ => return None,
            };
            let sun = DVec3::from_array(formula.sun.map(f64::from_le_bytes));
            let scale = f64::from_le_bytes(formula.scale);
            SkyLight::Formula(Box::new(FormulaSky {
                formula: SkyFormula { shape, scale, sun },
                ground: formula.ground.map(f32::from_le_bytes),
                colour: formula.colour.map(f32::from_le_bytes),
                axes,
            }))
        }
    };
    Some(Sky { light, sun })
}
