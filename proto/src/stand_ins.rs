//! Stand-ins for the scene, by section: the blob of a holodeck that holds them, and how it travels to displays.
//!
//! Invariant: nothing is taken from bytes that end early, go on, or name something else; what a packed scene says is for whoever unpacks
//! it.

use crate::{ProtoError, control::MAX_SECTIONS};

/// Version of the blob.
const VERSION: u32 = 1;

/// Bytes before the parts, and before the scene in each.
const HEAD: usize = 4;
const PART_HEAD: usize = 12;

/// What a scene stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StandInKind {
    /// Surfaces that displays take instead of the scene's for views of the section.
    Geometry,
    /// Invisible surfaces beyond which the geometry tells nothing.
    Portals,
}

/// One stand-in.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StandIn {
    /// The section whose views it is for.
    pub section: u16,
    /// What it is.
    pub kind: StandInKind,
    /// The packed scene.
    pub packed: Vec<u8>,
}

/// The blob of these stand-ins.
pub fn encode(parts: &[StandIn]) -> Vec<u8> {
    let mut bytes = VERSION.to_le_bytes().to_vec();
    for StandIn { section, kind, packed } in parts {
        bytes.extend(section.to_le_bytes());
        bytes.extend([u8::from(*kind == StandInKind::Portals), 0]);
        bytes.extend((packed.len() as u64).to_le_bytes());
        bytes.extend(packed);
    }
    bytes
}

/// The stand-ins of a blob.
///
/// # Errors
/// [`ProtoError::Truncated`], [`ProtoError::Number`] for another version or something unknown, or [`ProtoError::TooMany`].
pub fn decode(bytes: &[u8]) -> Result<Vec<StandIn>, ProtoError> {
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
    let mut parts = Vec::new();
    while !rest.is_empty() {
        if parts.len() >= 2 * MAX_SECTIONS {
            let (found, limit) = (parts.len() as u64 + 1, 2 * MAX_SECTIONS as u64);
            return Err(ProtoError::TooMany { what: "stand-ins", found, limit });
        }
        let (head, scene) =
            rest.split_first_chunk::<PART_HEAD>().ok_or(truncated(PART_HEAD as u64, rest.len()))?;
        let [s0, s1, kind, zero, length @ ..] = *head;
        let kind = match (kind, zero) {
            (0, 0) => StandInKind::Geometry,
            (1, 0) => StandInKind::Portals,
            _ => return Err(ProtoError::Number("the kind of a stand-in")),
        };
        let length = u64::from_le_bytes(length);
        let split = usize::try_from(length).ok().and_then(|length| scene.split_at_checked(length));
        let (packed, after) = split.ok_or(truncated(length, scene.len()))?;
        parts.push(StandIn {
            section: u16::from_le_bytes([s0, s1]),
            kind,
            packed: packed.to_vec(),
        });
        rest = after;
    }
    Ok(parts)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parts() -> Vec<StandIn> {
        let part =
            |section, kind, packed: &[u8]| StandIn { section, kind, packed: packed.to_vec() };
        vec![part(0, StandInKind::Geometry, b"scene"), part(0x0102, StandInKind::Portals, b"")]
    }

    #[test]
    fn the_blob_is_as_written_down() {
        let expected = b"\x01\0\0\0\0\0\0\0\x05\0\0\0\0\0\0\0scene\x02\x01\x01\0\0\0\0\0\0\0\0\0";
        assert_eq!(encode(&parts()), expected);
        assert_eq!(decode(expected), Ok(parts()));
        assert_eq!(decode(&encode(&[])), Ok(vec![]));
    }

    #[test]
    fn what_is_cut_or_unknown_is_refused() {
        let whole = encode(&parts());
        for length in (0..whole.len()).filter(|length| ![4, 21].contains(length)) {
            assert!(decode(&whole[..length]).is_err(), "{length}");
        }
        for (at, value) in [(0, 2), (6, 2), (7, 1), (8, 200), (15, 255)] {
            let mut other = whole.clone();
            other[at] = value;
            assert!(decode(&other).is_err(), "{at}");
        }
        let many = vec![
            StandIn { section: 0, kind: StandInKind::Portals, packed: vec![] };
            2 * MAX_SECTIONS + 1
        ];
        assert!(matches!(decode(&encode(&many)), Err(ProtoError::TooMany { .. })));
    }
}
