//! Files that the tests read.

use glam::{DVec3, Vec3};
use holo_splats::{Origin, SplatTree, Surfel};

/// A random number from 0 to 1, by its number.
pub fn random(number: u64) -> f32 {
    let mixed = (number ^ number >> 31).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let mixed = (mixed ^ mixed >> 29).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    (mixed >> 40) as f32 / (1 << 24) as f32
}

/// Where the tests' splats come from.
pub fn origin(spacing: f64) -> Origin {
    Origin {
        origin: DVec3::new(10.0, -20.0, 30.0),
        spacing,
        unit: 0.3048,
        up: [0.0, 0.0, 1.0],
        sky: [0.25, 0.5, 1.0],
        samples: 98_765,
        generation: 3,
        scene: std::array::from_fn(|at| at as u8),
    }
}

/// Surfels on a sphere that is brighter at the top.
pub fn ball(count: u32) -> Vec<Surfel> {
    let surfel = |at: u32| {
        let z = 1.0 - 2.0 * (at as f32 + 0.5) / count as f32;
        let turn = at as f32 * 2.399_963;
        let across = (1.0 - z * z).sqrt();
        let normal = Vec3::new(across * turn.cos(), across * turn.sin(), z);
        Surfel {
            position: normal * 2.0,
            normal,
            radius: 0.05,
            light: [1.5 + z, 1.0, 0.5],
            colour: [1.0; 3],
            error: 0.04,
            is_directional: at.is_multiple_of(7),
        }
    };
    (0..count).map(surfel).collect()
}

/// The bytes of a file with these surfels.
pub fn file(surfels: Vec<Surfel>) -> Vec<u8> {
    SplatTree::new(surfels, 0.05).unwrap().to_bytes(&origin(0.05))
}
