//! The bytes of a file, as the format's page draws them.

use glam::Vec3;
use holo_splats::{SplatFile, SplatTree, Surfel, write};

use crate::common::{ball, file, origin};

/// Two surfels, with numbers that come out even.
fn two() -> Vec<Surfel> {
    let surfel = |x: f32, light: [f32; 3]| Surfel {
        position: Vec3::new(x, 0.0, 0.0),
        normal: Vec3::Z,
        radius: 1.0,
        light,
        colour: [1.0; 3],
        error: 0.25,
        is_directional: x > 0.0,
    };
    vec![surfel(-1.0, [4.0; 3]), surfel(1.0, [1.0; 3])]
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

#[test]
fn a_file_has_the_bytes_that_its_page_draws() {
    let bytes = SplatTree::new(two(), 1.0).unwrap().to_bytes(&origin(1.0));
    assert_eq!(bytes.len(), 1024 + 24 + 3 * 8);
    let field = |at: usize, length: usize| hex(&bytes[at..at + length]);
    assert_eq!(&bytes[..8], b"holosplt");
    assert_eq!(field(8, 4), "01000000", "version");
    assert_eq!(field(12, 4), "02000000", "levels");
    assert_eq!(field(16, 8), "0300000000000000", "nodes");
    assert_eq!(field(24, 8), "0200000000000000", "surfels");
    assert_eq!(field(32, 8), hex(&10_f64.to_le_bytes()), "origin");
    assert_eq!(field(56, 12), "000000000000000000000000", "middle of the sphere");
    assert_eq!(field(68, 4), hex(&2_f32.to_le_bytes()), "its radius");
    assert_eq!(field(72, 4), hex(&2_f32.to_le_bytes()), "binary logarithm of the peak");
    assert_eq!(field(76, 4), hex(&0.25_f32.to_le_bytes()), "red of the sky");
    assert_eq!(field(88, 8), hex(&1_f64.to_le_bytes()), "spacing");
    assert_eq!(field(96, 8), hex(&0.3048_f64.to_le_bytes()), "metres per unit");
    assert_eq!(field(120, 8), hex(&1_f64.to_le_bytes()), "z of up");
    assert_eq!(field(128, 8), hex(&98_765_u64.to_le_bytes()), "samples");
    assert_eq!(field(136, 4), "03000000", "generation");
    assert_eq!(field(144, 4), "00010203", "the scene's hash");
    assert_eq!(field(256, 24), "000000000000000001000000000000000000000000000000", "levels");
    assert_eq!(hex(&bytes[960..992]), blake3::hash(&bytes[1024..1048]).to_string());
    assert_eq!(hex(&bytes[992..1024]), blake3::hash(&bytes[..992]).to_string());
    let nodes = &bytes[1048..];
    assert_eq!(field(1024, 16), blake3::hash(nodes).to_string()[..32]);
    assert_eq!(field(1040, 8), "0100000000000000", "first child");
    // Root: the middle of its sphere, with all its radius; two children; normal +z; light 2.5, a
    // third of it red and a third blue.
    let words: Vec<u64> =
        nodes.chunks(8).map(|node| u64::from_le_bytes(node.try_into().unwrap())).collect();
    let root = [15, 15, 15, 7, 1, 1, 15 + 15 * 31, 0, 4095 - 87, 42, 42, 20];
    let left = [8, 15, 15, 5, 0, 0, 15 + 15 * 31, 0, 4095, 42, 42, 20];
    let right = [23, 15, 15, 5, 0, 1, 15 + 15 * 31, 0, 4095 - 256, 42, 42, 20];
    for (word, fields) in words.iter().zip([root, left, right]) {
        let widths = [5, 5, 5, 3, 2, 1, 10, 2, 12, 7, 7, 5];
        let (mut found, mut rest) = (Vec::new(), *word);
        for width in widths {
            found.push(rest & ((1 << width) - 1));
            rest >>= width;
        }
        assert_eq!(found, fields);
    }
}

#[test]
fn the_same_surfels_give_the_bytes_that_they_always_gave() {
    // If this changes, files of earlier versions are read wrong, unless the version changes too.
    let hash = blake3::hash(&file(ball(3000))).to_string();
    assert_eq!(hash, include_str!("../golden/ball.hash").trim());
}

#[test]
fn a_written_file_is_read_back_and_appears_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("ball.splats");
    let tree = SplatTree::new(ball(500), 0.05).unwrap();
    for _ in 0..2 {
        write(&path, &tree, &origin(0.05)).unwrap();
        let file = SplatFile::open(&path).unwrap();
        file.verify().unwrap();
        assert_eq!((file.header().surfels, file.header().samples), (500, 98_765));
        assert_eq!(std::fs::read(&path).unwrap(), tree.to_bytes(&origin(0.05)));
    }
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "no draft is left");
    let nowhere = folder.path().join("none").join("ball.splats");
    let error = write(&nowhere, &tree, &origin(0.05)).unwrap_err().to_string();
    assert!(error.contains("writing") && error.contains("none"), "{error}");
}
