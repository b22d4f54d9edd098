//! Plants in pots: arching fronds, broad leaves, a small tree.

use crate::material::{CLAY, LEAF, LEAF_DARK, LEAF_LIGHT, NamedMaterial, SOIL, WALNUT};
use crate::mesh::Mesh;
use crate::random::SeededRandom;
use crate::shapes::{bent, lathe, sheet};
use glam::{DAffine3, DMat3, DVec3};
use std::f64::consts::PI;

const LEAVES: [&NamedMaterial; 4] = [&LEAF, &LEAF, &LEAF_LIGHT, &LEAF_DARK];

/// A leaf along +x that droops; parameters are its length, its greatest width, and the fall of its
/// tip.
fn leaf(material: &'static NamedMaterial, length: f64, width: f64, droop: f64) -> Mesh {
    sheet(material, 5, 2, |u, v| {
        let side = 2.0 * v - 1.0;
        let broad = (PI * u.powf(0.75)).sin() * width / 2.0;
        // Folded along its middle like a real leaf; otherwise it would be a flat card.
        let keel = 0.25 * broad * side.abs();
        DVec3::new(length * u, side * broad, keel - droop * u * u)
    })
}

/// Places `leaf` with its root at `root`, pointing at an azimuth and elevation.
fn pointed(leaf: Mesh, root: DVec3, azimuth: f64, elevation: f64) -> Mesh {
    let turn = DMat3::from_rotation_z(azimuth) * DMat3::from_rotation_y(-elevation);
    leaf.transformed(DAffine3::from_mat3_translation(turn, root))
}

/// A tapered pot with soil; `height` high.
fn pot(material: &'static NamedMaterial, radius: f64, height: f64) -> Mesh {
    let profile = [
        (0.0, 0.0),
        (radius * 0.72, 0.0),
        (radius * 0.95, height * 0.85),
        (radius, height * 0.86),
        (radius, height),
        (radius * 0.9, height),
        (radius * 0.86, height * 0.9),
    ];
    Mesh::of([
        lathe(material, 36, &profile),
        lathe(
            &SOIL,
            36,
            &[(radius * 0.88, height * 0.9), (radius * 0.4, height * 0.93), (0.0, height * 0.92)],
        ),
    ])
}

/// A palm, about `height` tall: stems from the middle, each with rows of narrow leaflets.
pub fn palm(height: f64, stems: usize, seed: u64) -> Mesh {
    let random = &mut SeededRandom::new(seed);
    let mut palm = pot(&CLAY, 0.19, 0.36);
    for i in 0..stems {
        let azimuth = 2.0 * PI * (i as f64 + random.range(-0.3, 0.3)) / stems as f64;
        let reach = random.range(0.18, 0.40);
        let tall = (height - 0.34) * random.range(0.65, 1.0);
        let along = |t: f64| {
            let out = reach * t * t;
            DVec3::new(
                out * azimuth.cos(),
                out * azimuth.sin(),
                0.33 + tall * (t - 0.28 * t * t * t) / 0.72,
            )
        };
        let path = [0.0, 0.25, 0.5, 0.75, 1.0].map(|t| along(t).to_array());
        palm.add(bent(&LEAF_LIGHT, &path, 0.005));
        for k in 0..11 {
            let t = 0.38 + 0.62 * f64::from(k) / 10.0;
            for side in [-1.0, 1.0] {
                let long = 0.24 * (1.15 - (t - 0.6).abs()) * random.range(0.85, 1.1);
                let blade = leaf(random.pick(&LEAVES), long, 0.030, 0.09);
                palm.add(pointed(blade, along(t), azimuth + side * random.range(0.7, 1.1), 0.25));
            }
        }
    }
    palm
}

/// Broad leaves on stalks from one root; spreads about 0.35 m, `height` tall.
pub fn broadleaf(height: f64, count: usize, seed: u64) -> Mesh {
    let random = &mut SeededRandom::new(seed);
    let mut plant = pot(&CLAY, 0.13, 0.24);
    for i in 0..count {
        let azimuth = 2.399_963 * i as f64;
        let outer = ((i as f64 + 0.5) / count as f64).sqrt();
        let (reach, tall) =
            (0.16 * outer, (height - 0.24) * (1.0 - 0.55 * outer) * random.range(0.8, 1.0));
        let tip = DVec3::new(reach * azimuth.cos(), reach * azimuth.sin(), 0.22 + tall);
        plant.add(bent(
            &LEAF_LIGHT,
            &[[0.0, 0.0, 0.21], [tip.x * 0.4, tip.y * 0.4, 0.22 + tall * 0.6], tip.to_array()],
            0.004,
        ));
        let blade =
            leaf(random.pick(&LEAVES), random.range(0.16, 0.24), random.range(0.09, 0.14), 0.08);
        plant.add(pointed(blade, tip, azimuth, random.range(-0.1, 0.5)));
    }
    plant
}

/// A small tree with a round crown of `count` leaves.
pub fn tree(height: f64, crown: f64, count: usize, seed: u64) -> Mesh {
    let random = &mut SeededRandom::new(seed);
    let mut tree = pot(&CLAY, 0.21, 0.38);
    let middle = height - crown;
    tree.add(bent(
        &WALNUT,
        &[[0.0, 0.0, 0.34], [0.02, 0.01, 0.7 * middle], [-0.01, 0.02, middle + 0.1]],
        0.02,
    ));
    for i in 0..count {
        // Evenly distributed over a ball (a Fibonacci lattice), at varying depths.
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / count as f64;
        let azimuth = 2.399_963 * i as f64;
        let ring = (1.0 - z * z).sqrt();
        let depth = crown * random.range(0.35, 0.85);
        let root = DVec3::new(ring * azimuth.cos(), ring * azimuth.sin(), z) * depth
            + DVec3::new(0.0, 0.0, middle);
        let blade =
            leaf(random.pick(&LEAVES), random.range(0.09, 0.14), random.range(0.045, 0.065), 0.03);
        tree.add(pointed(
            blade,
            root,
            azimuth + random.range(-0.6, 0.6),
            z * 0.9 + random.range(-0.5, 0.3),
        ));
    }
    for i in 0..9 {
        let azimuth = 2.399_963 * f64::from(i);
        let end = [
            0.6 * crown * azimuth.cos(),
            0.6 * crown * azimuth.sin(),
            middle + crown * (f64::from(i) / 9.0 - 0.4),
        ];
        tree.add(bent(
            &WALNUT,
            &[[0.0, 0.01, middle - 0.25], [end[0] * 0.4, end[1] * 0.4, middle - 0.05], end],
            0.006,
        ));
    }
    tree
}
