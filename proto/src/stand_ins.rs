//! The blob of stand-ins, in the file and on the wire. Stand-ins are simpler scenes that displays
//! use in place of the scene, for the views of a section.
//!
//! Invariant: a blob that ends early, is too long, or has an unknown version or kind is refused.
//! The packed scenes themselves are not checked here.

use crate::{ProtoError, control::MAX_SECTIONS};

/// Version of the blob.
const VERSION: u32 = 1;

/// Bytes before the first stand-in, and before the scene in each.
const HEAD: usize = 4;
const STAND_IN_HEAD: usize = 12;

/// The use of a stand-in in displays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StandInKind {
    /// Surfaces that replace the scene's.
    Geometry,
    /// Invisible surfaces beyond which the geometry is incomplete.
    Portals,
}

/// One stand-in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StandInRecord {
    /// The section whose views use the stand-in.
    pub section: u16,
    /// The use of the stand-in.
    pub kind: StandInKind,
    /// The packed scene.
    pub packed: Vec<u8>,
}

/// Returns the blob of these stand-ins.
pub fn encode(stand_ins: &[StandInRecord]) -> Vec<u8> {
    let mut bytes = VERSION.to_le_bytes().to_vec();
    for StandInRecord { section, kind, packed } in stand_ins {
        bytes.extend(section.to_le_bytes());
        bytes.extend([u8::from(*kind == StandInKind::Portals), 0]);
        bytes.extend((packed.len() as u64).to_le_bytes());
        bytes.extend(packed);
    }
    bytes
}

/// Returns the stand-ins in a blob.
///
/// # Errors
/// [`ProtoError::Truncated`], [`ProtoError::TooMany`], or [`ProtoError::Number`] for an unknown
/// version or kind.
pub fn decode(bytes: &[u8]) -> Result<Vec<StandInRecord>, ProtoError> {
    let truncated = |needed: u64, found: usize| ProtoError::Truncated {
        what: "stand-in",
        needed,
        found: found as u64,
    };
    let (version, mut rest) =
        bytes.split_first_chunk::<HEAD>().ok_or(truncated(HEAD as u64, bytes.len()))?;
    if u32::from_le_bytes(*version) != VERSION {
        return Err(ProtoError::Number("the version of the stand-ins"));
    }
    let mut stand_ins = Vec::new();
    while !rest.is_empty() {
        if stand_ins.len() >= 2 * MAX_SECTIONS {
            let (found, limit) = (stand_ins.len() as u64 + 1, 2 * MAX_SECTIONS as u64);
            return Err(ProtoError::TooMany { what: "stand-ins", found, limit });
        }
        let (head, scene) = rest
            .split_first_chunk::<STAND_IN_HEAD>()
            .ok_or(truncated(STAND_IN_HEAD as u64, rest.len()))?;
        let [s0, s1, kind, zero, length @ ..] = *head;
        let kind = match (kind, zero) {
            (0, 0) => StandInKind::Geometry,
            (1, 0) => StandInKind::Portals,
            _ => return Err(ProtoError::Number("the kind of a stand-in")),
        };
        let length = u64::from_le_bytes(length);
        let split = usize::try_from(length).ok().and_then(|length| scene.split_at_checked(length));
        let (packed, after) = split.ok_or(truncated(length, scene.len()))?;
        stand_ins.push(StandInRecord {
            section: u16::from_le_bytes([s0, s1]),
            kind,
            packed: packed.to_vec(),
        });
        rest = after;
    }
    Ok(stand_ins)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn examples() -> Vec<StandInRecord> {
        let stand_in =
            |section, kind, packed: &[u8]| StandInRecord { section, kind, packed: packed.to_vec() };
        vec![
            stand_in(0, StandInKind::Geometry, b"scene"),
            stand_in(0x0102, StandInKind::Portals, b""),
        ]
    }

    #[test]
    fn the_blob_has_the_bytes_of_the_specification() {
        let expected = b"\x01\0\0\0\0\0\0\0\x05\0\0\0\0\0\0\0scene\x02\x01\x01\0\0\0\0\0\0\0\0\0";
        assert_eq!(encode(&examples()), expected);
        assert_eq!(decode(expected), Ok(examples()));
        assert_eq!(decode(&encode(&[])), Ok(vec![]));
    }

    #[test]
    fn bytes_that_are_cut_off_or_unknown_are_refused() {
        let whole = encode(&examples());
        for length in (0..whole.len()).filter(|length| ![4, 21].contains(length)) {
            assert!(decode(&whole[..length]).is_err(), "{length}");
        }
        for (at, value) in [(0, 2), (6, 2), (7, 1), (8, 200), (15, 255)] {
            let mut other = whole.clone();
            other[at] = value;
            assert!(decode(&other).is_err(), "{at}");
        }
        let many = vec![
            StandInRecord { section: 0, kind: StandInKind::Portals, packed: vec![] };
            2 * MAX_SECTIONS + 1
        ];
        assert!(matches!(decode(&encode(&many)), Err(ProtoError::TooMany { .. })));
    }
}
