//! The luminaires of a packed scene.
//!
//! The format is in [`crate::pack`].

use std::collections::HashSet;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use holo_photometry::{MAX_ANGLES, MAX_WEB_VALUES, PhotometricWeb, WebPole};

use crate::PackedError;
use crate::limits::MAX_NAME_BYTES;
use crate::luminaire::{Luminaire, MAX_LUMINAIRES};
use crate::pack_values::split;

type Word = [u8; 4];

/// A luminaire's bytes before its names.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct LuminaireHeader {
    web: Word,
    material: Word,
    axes: [[Word; 3]; 3],
    name_bytes: [Word; 2],
}
const _: () = assert!(size_of::<LuminaireHeader>() == 52);

pub(crate) fn pack_luminaires(luminaires: &[Luminaire], out: &mut Vec<u8>) {
    let mut webs: Vec<Vec<u8>> = Vec::new();
    let mut numbers = std::collections::HashMap::new();
    let mut number_of = Vec::with_capacity(luminaires.len());
    for luminaire in luminaires {
        let packed = pack_web(&luminaire.web);
        let number = *numbers.entry(packed).or_insert_with_key(|packed| {
            webs.push(packed.clone());
            webs.len() as u32 - 1
        });
        number_of.push(number);
    }
    out.extend((webs.len() as u32).to_le_bytes());
    webs.iter().for_each(|web| out.extend(web));
    out.extend((luminaires.len() as u32).to_le_bytes());
    for (luminaire, web) in luminaires.iter().zip(number_of) {
        let header = LuminaireHeader {
            web: web.to_le_bytes(),
            material: luminaire.material.to_le_bytes(),
            axes: luminaire.axes.map(|axis| axis.map(f32::to_le_bytes)),
            name_bytes: [&luminaire.name, &luminaire.group]
                .map(|name| (name.len() as u32).to_le_bytes()),
        };
        out.extend_from_slice(bytemuck::bytes_of(&header));
        out.extend_from_slice(luminaire.name.as_bytes());
        out.extend_from_slice(luminaire.group.as_bytes());
    }
}

fn pack_web(web: &PhotometricWeb) -> Vec<u8> {
    let (pole, polar, turns, candela) = web.parts();
    let pole = match pole {
        WebPole::Nadir => 0_u32,
        WebPole::Length => 1,
        WebPole::Width => 2,
    };
    let head = [pole, polar.len() as u32, turns.len() as u32];
    let mut packed: Vec<u8> = head.iter().flat_map(|word| word.to_le_bytes()).collect();
    let numbers = polar.iter().chain(turns).chain(candela);
    numbers.for_each(|number| packed.extend(number.to_le_bytes()));
    packed
}

/// Takes the luminaires off the front of `bytes`. Values that have another packing are refused.
pub(crate) fn unpack_luminaires(bytes: &mut &[u8]) -> Result<Vec<Luminaire>, PackedError> {
    unpack(bytes).ok_or(PackedError::Luminaires)
}

fn unpack(bytes: &mut &[u8]) -> Option<Vec<Luminaire>> {
    let mut webs = Vec::new();
    let mut known = HashSet::new();
    for _ in 0..count(bytes)? {
        let before = *bytes;
        webs.push(Arc::new(unpack_web(bytes)?));
        // Equal webs are stored once.
        if !known.insert(&before[..before.len() - bytes.len()]) {
            return None;
        }
    }
    let (mut luminaires, mut used) = (Vec::new(), 0);
    for _ in 0..count(bytes)? {
        let (header, rest) = split::<LuminaireHeader>(bytes)?;
        *bytes = rest;
        let web = u32::from_le_bytes(header.web) as usize;
        // They are stored in the order of their first use.
        if web > used {
            return None;
        }
        used += usize::from(web == used);
        let [name, group] = header.name_bytes.map(|n| take_name(bytes, u32::from_le_bytes(n)));
        let axes = header.axes.map(|axis| Vec3::from(axis.map(f32::from_le_bytes)));
        let material = u32::from_le_bytes(header.material);
        luminaires.push(Luminaire::new([name?, group?], material, axes, webs.get(web)?.clone()));
    }
    (used == webs.len()).then_some(luminaires)
}

/// Takes the number of webs or luminaires.
fn count(bytes: &mut &[u8]) -> Option<u32> {
    let (count, rest) = split::<Word>(bytes)?;
    *bytes = rest;
    Some(u32::from_le_bytes(count)).filter(|count| (1..=MAX_LUMINAIRES as u32).contains(count))
}

fn unpack_web(bytes: &mut &[u8]) -> Option<PhotometricWeb> {
    let (head, rest) = split::<[Word; 3]>(bytes)?;
    *bytes = rest;
    let [pole, rows, columns] = head.map(u32::from_le_bytes);
    let pole = match pole {
        0 => WebPole::Nadir,
        1 => WebPole::Length,
        2 => WebPole::Width,
        _ => return None,
    };
    let (rows, columns) = (rows as usize, columns as usize);
    if rows.max(columns) > MAX_ANGLES || rows * columns > MAX_WEB_VALUES {
        return None;
    }
    let mut numbers = |count: usize| -> Option<Vec<f32>> {
        let (head, rest) = bytes.split_at_checked(4 * count)?;
        *bytes = rest;
        let words = bytemuck::try_cast_slice::<u8, Word>(head).ok()?;
        Some(words.iter().map(|word| f32::from_le_bytes(*word)).collect())
    };
    let (polar, turns) = (numbers(rows)?, numbers(columns)?);
    PhotometricWeb::new(pole, polar, turns, numbers(rows * columns)?)
}

fn take_name(bytes: &mut &[u8], length: u32) -> Option<String> {
    let length = Some(length as usize).filter(|&length| length <= MAX_NAME_BYTES)?;
    let (name, rest) = bytes.split_at_checked(length)?;
    *bytes = rest;
    Some(str::from_utf8(name).ok()?.to_owned())
}
