//! The garden outside the windows: a terrace, a lawn, hedges and trees. It is coarse because it is
//! seen from far away, through glass.

use crate::furniture::plant::tree;
use crate::material::{LAWN, LEAF, LEAF_DARK, NamedMaterial, OAK_DARK, SLATE, WALNUT};
use crate::mesh::Mesh;
use crate::random::SeededRandom;
use crate::shapes::{ball, block, cuboid, lathe, rounded};
use glam::DVec3;

/// Height of the lawn; the floor of the house is at 0.
const LAWN_Z: f64 = -0.32;

/// Returns everything outdoors.
pub fn garden() -> Mesh {
    let random = &mut SeededRandom::new(2);
    let mut garden = cuboid(&LAWN, [-16.0, -18.0, LAWN_Z - 0.2], [28.0, 28.0, LAWN_Z]);
    for i in 0..14 {
        let y = -0.32 - 0.2 * f64::from(i);
        garden.add(cuboid(&OAK_DARK, [0.0, y - 0.195, -0.06], [7.0, y, -0.03]));
    }
    garden.add(cuboid(&SLATE, [0.05, -3.05, LAWN_Z], [6.95, -0.32, -0.06]));
    for (x, y) in [(0.4, -2.7), (6.6, -2.7)] {
        garden.add(tree(1.7, 0.42, 150, 31).at(x, y, -0.03));
    }
    for (size, x, y) in [
        ([30.0, 1.0, 1.5], 6.0, -12.0),
        ([30.0, 1.0, 1.7], 6.0, 21.0),
        ([1.0, 32.0, 1.6], 20.0, 4.0),
        ([1.0, 32.0, 1.6], -10.0, 4.0),
    ] {
        garden.add(rounded(&LEAF_DARK, size, 0.2).at(x, y, LAWN_Z));
    }
    for (x, y) in [(-2.0, -9.5), (2.4, -10.5), (8.5, -10.0)] {
        garden.add(grown_tree(random).at(x, y, LAWN_Z));
    }
    for (x, y) in [(-3.0, 18.5), (1.5, 19.5), (9.0, 19.0), (17.5, 10.5)] {
        garden.add(grown_tree(random).at(x, y, LAWN_Z));
    }
    garden.add(block(&SLATE, [0.9, 2.5, 0.3]).at(11.95, 5.85, LAWN_Z));
    garden
}

/// Returns a tree: a trunk under a crown of lumps.
fn grown_tree(random: &mut SeededRandom) -> Mesh {
    let height = random.range(2.6, 3.8);
    let mut tree = lathe(&WALNUT, 10, &[(0.16, 0.0), (0.10, height * 0.5), (0.05, height)]);
    for i in 0..10 {
        let azimuth = 2.399_963 * f64::from(i);
        let out = if i == 0 { 0.0 } else { random.range(0.5, 0.95) };
        let radius = random.range(0.4, 0.75);
        tree.add(lump(random.pick(&[&LEAF, &LEAF_DARK]), radius, random.range(0.0, 6.0)).at(
            out * azimuth.cos(),
            out * azimuth.sin(),
            height + random.range(-0.7, 0.7),
        ));
    }
    tree
}

/// Returns a bumpy ball of foliage.
fn lump(material: &'static NamedMaterial, radius: f64, phase: f64) -> Mesh {
    let mut lump = ball(material, radius, 14);
    for p in &mut lump.points {
        let q = *p / radius;
        let bump = (5.0 * q + DVec3::splat(phase)).to_array().map(f64::sin);
        *p *= 1.0 + 0.11 * (bump[0] + bump[1] * bump[2]);
    }
    lump
}
