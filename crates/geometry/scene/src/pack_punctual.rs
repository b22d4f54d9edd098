//! The punctual lights of a packed scene.
//!
//! The format is in [`crate::pack`].

use bytemuck::{Pod, Zeroable};

use crate::limits::MAX_NAME_BYTES;
use crate::pack_values::split;
use crate::punctual::MAX_PUNCTUAL_LIGHTS;
use crate::{PackedError, PunctualBeam, PunctualLight};

/// A light's bytes before its names.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct LightHeader {
    position: [[u8; 4]; 3],
    intensity: [[u8; 4]; 3],
    radius: [u8; 4],
    has_cone: [u8; 4],
    axis: [[u8; 4]; 3],
    angles: [[u8; 4]; 2],
    name_bytes: [[u8; 4]; 2],
}
const _: () = assert!(size_of::<LightHeader>() == 60);

pub(crate) fn pack_punctual_lights(lights: &[PunctualLight], out: &mut Vec<u8>) {
    out.extend((lights.len() as u32).to_le_bytes());
    for light in lights {
        let (has_cone, axis, angles) = match light.beam {
            PunctualBeam::Everywhere => (0_u32, [0.0; 3], [0.0; 2]),
            PunctualBeam::Cone { axis, inner, outer } => (1, axis, [inner, outer]),
        };
        let header = LightHeader {
            position: light.position.map(f32::to_le_bytes),
            intensity: light.intensity.map(f32::to_le_bytes),
            radius: light.radius.to_le_bytes(),
            has_cone: has_cone.to_le_bytes(),
            axis: axis.map(f32::to_le_bytes),
            angles: angles.map(f32::to_le_bytes),
            name_bytes: [&light.name, &light.group].map(|name| (name.len() as u32).to_le_bytes()),
        };
        out.extend_from_slice(bytemuck::bytes_of(&header));
        out.extend_from_slice(light.name.as_bytes());
        out.extend_from_slice(light.group.as_bytes());
    }
}

/// Takes the lights off the front of `bytes`. Values that have another packing are refused.
pub(crate) fn unpack_punctual_lights(bytes: &mut &[u8]) -> Result<Vec<PunctualLight>, PackedError> {
    let (count, rest) = split::<[u8; 4]>(bytes).ok_or(PackedError::Shading)?;
    *bytes = rest;
    let count = u32::from_le_bytes(count) as usize;
    if !(1..=MAX_PUNCTUAL_LIGHTS).contains(&count) {
        return Err(PackedError::Shading);
    }
    (0..count).map(|_| unpack_light(bytes).ok_or(PackedError::Shading)).collect()
}

fn unpack_light(bytes: &mut &[u8]) -> Option<PunctualLight> {
    let (header, rest) = split::<LightHeader>(bytes)?;
    *bytes = rest;
    let [name, group] = header.name_bytes.map(|n| take_name(bytes, u32::from_le_bytes(n)));
    let beam = match u32::from_le_bytes(header.has_cone) {
        0 if header.axis == [[0; 4]; 3] && header.angles == [[0; 4]; 2] => PunctualBeam::Everywhere,
        1 => {
            let [inner, outer] = header.angles.map(f32::from_le_bytes);
            PunctualBeam::Cone { axis: header.axis.map(f32::from_le_bytes), inner, outer }
        }
        _ => return None,
    };
    Some(PunctualLight {
        name: name?,
        group: group?,
        position: header.position.map(f32::from_le_bytes),
        intensity: header.intensity.map(f32::from_le_bytes),
        radius: f32::from_le_bytes(header.radius),
        beam,
    })
}

fn take_name(bytes: &mut &[u8], length: u32) -> Option<String> {
    let length = Some(length as usize).filter(|&length| length <= MAX_NAME_BYTES)?;
    let (name, rest) = bytes.split_at_checked(length)?;
    *bytes = rest;
    Some(str::from_utf8(name).ok()?.to_owned())
}
