//! Stored hierarchies: reading returns what was written, and refuses everything else.

use super::*;
use crate::build;
use crate::facet::facets;
use glam::DVec3;
use holo_scene::{Material, Scene};
use proptest::prelude::*;

/// Returns a scene of triangles along a spiral.
pub(crate) fn scene(triangles: usize) -> Scene {
    let corner = |i: usize| {
        let (sin, cos) = (i as f64 * 0.37).sin_cos();
        DVec3::new(cos * (1.0 + 0.01 * i as f64), sin, 0.02 * i as f64)
    };
    let corners: Vec<DVec3> = (0..triangles + 2).map(corner).collect();
    let indices: Vec<[u32; 3]> = (0..triangles as u32).map(|i| [i, i + 1, i + 2]).collect();
    let materials = vec![Material::grey("a")];
    let ids = vec![0; triangles];
    Scene::from_world(&corners, &indices, &ids, materials, [1.0; 3]).unwrap().0
}

const GEOMETRY: [u8; 32] = [3; 32];

fn built(triangles: usize) -> (Vec<Facet>, Hierarchy, Vec<u8>) {
    let scene = scene(triangles);
    let facets = facets(&scene.own()).unwrap();
    let hierarchy = build::hierarchy(&facets, 50.0);
    let mut bytes = Vec::new();
    write(&hierarchy, triangles, GEOMETRY, &mut bytes).unwrap();
    (facets, hierarchy, bytes)
}

fn read_all(bytes: &[u8], facets: &[Facet]) -> Result<Hierarchy, StoredError> {
    read(&mut &bytes[..], bytes.len() as u64, facets.len(), GEOMETRY)?.over(facets)
}

/// Sets the hash of the content, as a forger would.
fn sealed(mut bytes: Vec<u8>) -> Vec<u8> {
    let content = hash(&bytes[size_of::<HierarchyHeader>()..], &[]);
    bytes[56..88].copy_from_slice(&content);
    bytes
}

#[test]
fn what_is_written_is_read() {
    for triangles in [65, 1000, 20_000] {
        let (facets, hierarchy, bytes) = built(triangles);
        let read = read_all(&bytes, &facets).unwrap();
        assert!(read.stack_need >= hierarchy.stack_need);
        let nodes = |h: &Hierarchy| bytemuck::cast_slice::<_, u8>(&h.nodes).to_vec();
        assert!(nodes(&read) == nodes(&hierarchy));
        let bits = |h: &Hierarchy| {
            let lanes = h.blocks.iter().flat_map(|b| b.vertices.as_flattened().as_flattened());
            lanes.map(|c| c.to_bits()).collect::<Vec<_>>()
        };
        assert!(bits(&read) == bits(&hierarchy));
    }
}

#[test]
fn other_versions_other_scenes_and_cut_files_are_named() {
    let (facets, _, bytes) = built(1000);
    let refused = |bytes: &[u8]| read_all(bytes, &facets).map(|_| ()).unwrap_err();
    let with = |at: usize, to: u8| {
        let mut bytes = bytes.clone();
        bytes[at] = to;
        bytes
    };
    assert_eq!(refused(&with(0, b'x')), StoredError::Version);
    assert_eq!(refused(&with(8, 77)), StoredError::Version);
    assert_eq!(refused(&with(24, 4)), StoredError::Scene);
    assert_eq!(read_all(&bytes, &facets[1..]).map(|_| ()).unwrap_err(), StoredError::Scene);
    for end in [0, 5, 87, 88, 1000, bytes.len() - 1] {
        assert_eq!(refused(&bytes[..end]), StoredError::Damaged);
    }
    assert_eq!(refused(&[&bytes[..], &[0]].concat()), StoredError::Damaged);
    // Lengths that would need much memory.
    assert_eq!(refused(&with(19, 255)), StoredError::Damaged);
    assert_eq!(refused(&with(23, 255)), StoredError::Damaged);
}

#[test]
fn references_in_a_circle_and_beyond_the_end_are_refused_whatever_the_hash_says() {
    let (facets, hierarchy, bytes) = built(1000);
    let child = |node: usize, slot: usize| 88 + 128 * node + 96 + 4 * slot;
    let with = |at: usize, to: u32| {
        let mut bytes = bytes.clone();
        bytes[at..at + 4].copy_from_slice(&to.to_ne_bytes());
        read_all(&sealed(bytes), &facets).map(|_| ())
    };
    assert_eq!(with(child(0, 0), hierarchy.nodes[0].children[0]), Ok(()));
    let (nodes, blocks) = (hierarchy.nodes.len() as u32, hierarchy.blocks.len() as u32);
    for reference in [0, nodes, hierarchy.nodes[0].children[1], LEAF | blocks] {
        assert_eq!(with(child(0, 0), reference), Err(StoredError::Damaged), "{reference:x}");
    }
    let first_block = 88 + 128 * hierarchy.nodes.len();
    assert_eq!(with(first_block, 1000), Err(StoredError::Damaged));
}

proptest! {
    #[test]
    fn changed_bytes_give_a_hierarchy_or_an_error(
        changes in proptest::collection::vec((any::<proptest::sample::Index>(), any::<u8>()), 1..8),
        is_sealed: bool,
    ) {
        let (facets, _, mut bytes) = built(300);
        for (at, to) in changes {
            let at = at.index(bytes.len());
            bytes[at] = to;
        }
        let bytes = if is_sealed { sealed(bytes) } else { bytes };
        let _ = read_all(&bytes, &facets);
    }
}
