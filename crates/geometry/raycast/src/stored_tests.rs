//! Stored geometry: reading returns what was written, and refuses everything else.

use std::fs;

use glam::{DVec3, Vec3};
use holo_scene::{Material, Scene, Shading, to_octahedral};
use proptest::prelude::*;

use super::*;
use crate::raycaster::Raycaster;

/// Returns a scene of triangles along a spiral. Two of them lie at one place.
pub(crate) fn scene(triangles: usize) -> Scene {
    let corner = |i: usize| {
        let (sin, cos) = (i as f64 * 0.37).sin_cos();
        DVec3::new(cos * (1.0 + 0.01 * i as f64), sin, 0.02 * i as f64)
    };
    let corners: Vec<DVec3> = (0..triangles + 1).map(corner).collect();
    let mut indices: Vec<[u32; 3]> = (0..triangles as u32 - 1).map(|i| [i, i + 1, i + 2]).collect();
    indices.push([0, 1, 2]);
    let materials = vec![Material::grey("a"), Material::grey("b")];
    let ids: Vec<u32> = (0..triangles as u32).map(|i| i % 2).collect();
    Scene::from_world(&corners, &indices, &ids, materials, [1.0; 3]).unwrap().0
}

/// The same with normals and colours.
pub(crate) fn shaded(triangles: usize) -> Scene {
    let shading = Shading {
        normals: vec![[to_octahedral(Vec3::Z); 3]; triangles].into(),
        colours: vec![[[1, 2, 3]; 3]; triangles].into(),
        ..Shading::default()
    };
    scene(triangles).with_shading(shading).unwrap()
}

const HASH: [u8; 32] = [3; 32];

fn built(triangles: usize) -> (Raycaster, Vec<u8>) {
    let raycaster = Raycaster::build(Arc::new(scene(triangles))).unwrap();
    let mut bytes = Vec::new();
    let (own, cast) = (raycaster.scene().own(), raycaster.geometry());
    write(&own, &cast, HASH, &mut bytes).unwrap();
    (raycaster, bytes)
}

fn read_all(bytes: &[u8]) -> Result<StoredGeometry, SealError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("geometry");
    fs::write(&path, bytes).unwrap();
    read(&File::open(path).unwrap(), &HASH)
}

/// Writes a geometry whose arrays a forger changed.
fn forged(raycaster: &Raycaster, change: impl Fn(&mut Forgery)) -> Result<(), SealError> {
    let (own, cast) = (raycaster.scene().own(), raycaster.geometry());
    let mut forgery = Forgery {
        triangles: own.triangles.to_vec(),
        nodes: cast.hierarchy.nodes.to_vec(),
        blocks: cast.hierarchy.blocks.to_vec(),
    };
    change(&mut forgery);
    let Forgery { triangles, nodes, blocks } = forgery;
    let geometry = Geometry { triangles: &triangles, ..own };
    let hierarchy =
        Hierarchy { nodes: nodes.into(), blocks: blocks.into(), ..Hierarchy::default() };
    let mut bytes = Vec::new();
    let cast = CastGeometry { hierarchy: Arc::new(hierarchy), ..cast };
    write(&geometry, &cast, HASH, &mut bytes).unwrap();
    read_all(&bytes).map(|_| ())
}

struct Forgery {
    triangles: Vec<[u32; 3]>,
    nodes: Vec<WideNode>,
    blocks: Vec<TriangleBlock>,
}

#[test]
fn what_is_written_is_read() {
    for triangles in [65, 1000, 20_000] {
        let (raycaster, bytes) = built(triangles);
        let (read, cast) = (read_all(&bytes).unwrap(), raycaster.geometry());
        assert!(read.cast.hierarchy.stack_need >= cast.hierarchy.stack_need);
        assert_eq!(read.cast.reach.to_bits(), cast.reach.to_bits());
        let bytes = |cast: &CastGeometry| {
            let parts: [&[u8]; 3] = [
                cast_slice(&cast.hierarchy.nodes),
                cast_slice(&cast.hierarchy.blocks),
                cast_slice(&cast.facets),
            ];
            parts.concat()
        };
        assert!(bytes(&read.cast) == bytes(&cast));
        let own = raycaster.scene().own();
        assert!(read.positions[..] == *own.positions && read.triangles[..] == *own.triangles);
    }
}

#[test]
fn references_in_a_circle_and_beyond_the_end_are_refused_whatever_the_hash_says() {
    let (raycaster, _) = built(1000);
    let hierarchy = raycaster.geometry().hierarchy;
    let damaged = Err(SealError::Damaged);
    assert_eq!(forged(&raycaster, |_| {}), Ok(()));
    let (nodes, blocks) = (hierarchy.nodes.len() as u32, hierarchy.blocks.len() as u32);
    for reference in [0, nodes, hierarchy.nodes[0].children[1], LEAF | blocks] {
        let change = |forgery: &mut Forgery| forgery.nodes[0].children[0] = reference;
        assert_eq!(forged(&raycaster, change), damaged, "{reference:x}");
    }
    assert_eq!(forged(&raycaster, |forgery| forgery.triangles[7][1] = 1_000_000), damaged);
    assert_eq!(forged(&raycaster, |forgery| forgery.triangles.truncate(999)), damaged);
    assert_eq!(forged(&raycaster, |forgery| forgery.nodes.clear()), damaged);
    let other_triangle =
        |forgery: &mut Forgery| forgery.blocks[0].vertices[0][3][0] = f32::from_bits(1000);
    assert_eq!(forged(&raycaster, other_triangle), damaged);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn any_changed_byte_is_recognised(at: proptest::sample::Index, change in 1..=u8::MAX) {
        let (_, mut bytes) = built(80);
        let at = at.index(bytes.len());
        bytes[at] ^= change;
        prop_assert!(read_all(&bytes).is_err());
    }
}
