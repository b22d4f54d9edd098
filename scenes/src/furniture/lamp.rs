//! Lamps: luminous surfaces and their holders.
//!
//! Invariant: a luminous face points away from its housing. No light stands behind glass.

use crate::material::{
    BRASS, BULB, CEILING, CERAMIC, FABRIC_DARK, FLAME, GLOBE, INK, LINEN, NamedMaterial, PANEL,
    SHADE, SPOT, STEEL,
};
use crate::mesh::Mesh;
use crate::shapes::{ball, bent, block, cuboid, lathe, rectangle, rounded, tube, turned};
use glam::DVec3;

/// A spot set into a ceiling, 90 mm wide.
pub fn downlight() -> Mesh {
    Mesh::of([
        lathe(&STEEL, 24, &[(0.045, -0.004), (0.046, -0.012), (0.060, -0.010), (0.062, 0.0)]),
        lathe(&SPOT, 24, &[(0.0, -0.004), (0.045, -0.004)]),
    ])
}

/// A flat luminous panel under a ceiling.
pub fn panel(w: f64, d: f64) -> Mesh {
    let (w2, d2) = (w / 2.0, d / 2.0);
    Mesh::of([
        cuboid(&CEILING, [-w2 - 0.02, -d2 - 0.02, -0.05], [w2 + 0.02, d2 + 0.02, 0.0]),
        rectangle(&PANEL, [-w2, d2, -0.052], [w, 0.0, 0.0], [0.0, -d, 0.0]),
    ])
}

/// A luminous strip along x, 20 mm wide, that shines upwards; `tilted` by 180 degrees it shines
/// downwards.
pub fn strip(light: &'static NamedMaterial, length: f64) -> Mesh {
    Mesh::of([
        block(&STEEL, [length + 0.01, 0.026, 0.012]),
        rectangle(light, [-length / 2.0, -0.01, 0.013], [length, 0.0, 0.0], [0.0, 0.02, 0.0]),
    ])
}

/// A vertical luminous rod on a wall, beside a mirror.
pub fn rod(light: &'static NamedMaterial, length: f64) -> Mesh {
    Mesh::of([
        cuboid(&STEEL, [-0.02, 0.0, 0.0], [0.02, 0.02, length]),
        lathe(light, 16, &[(0.018, 0.019), (0.018, length - 0.019)]).at(0.0, 0.045, 0.0),
        block(&STEEL, [0.045, 0.05, 0.02]).at(0.0, 0.035, 0.0),
        block(&STEEL, [0.045, 0.05, 0.02]).at(0.0, 0.035, length - 0.02),
    ])
}

/// A rose, a cord, and a luminous globe whose centre hangs `drop` below the ceiling.
pub fn pendant(drop: f64, radius: f64) -> Mesh {
    Mesh::of([
        lathe(&BRASS, 24, &[(0.0, -0.025), (0.045, -0.025), (0.05, 0.0)]),
        cord(drop - radius),
        lathe(&BRASS, 24, &[(0.012, 0.06), (0.03, 0.045), (0.055, 0.03)]).at(
            0.0,
            0.0,
            -drop + radius,
        ),
        ball(&GLOBE, radius, 28).at(0.0, 0.0, -drop),
    ])
}

/// A bell of metal over a bulb; its rim hangs `drop` below the ceiling.
pub fn bell(metal: &'static NamedMaterial, drop: f64) -> Mesh {
    let outside =
        [(0.17, 0.0), (0.165, 0.05), (0.13, 0.12), (0.06, 0.17), (0.025, 0.21), (0.02, 0.26)];
    Mesh::of([
        lathe(&INK, 24, &[(0.0, -0.02), (0.04, -0.02), (0.045, 0.0)]),
        cord(drop - 0.25),
        turned(metal, 40, &outside).at(0.0, 0.0, -drop),
        // The lining, slightly inside, seen from below.
        turned(
            &LINEN,
            40,
            &[(0.025, 0.20), (0.055, 0.165), (0.125, 0.118), (0.16, 0.05), (0.165, 0.002)],
        )
        .at(0.0, 0.0, -drop),
        ball(&BULB, 0.04, 20).at(0.0, 0.0, -drop + 0.085),
    ])
}

fn cord(length: f64) -> Mesh {
    tube(&INK, &[DVec3::new(0.0, 0.0, -length), DVec3::new(0.0, 0.0, -0.01)], 0.004, 8)
}

/// A glowing shade open above and below, from radius `low` to `high`, with its bulb.
fn shade(low: f64, high: f64, height: f64) -> Mesh {
    Mesh::of([
        lathe(&SHADE, 36, &[(low, 0.0), (high, height)]),
        lathe(&LINEN, 36, &[(high - 0.004, height), (low - 0.004, 0.0)]),
        ball(&BULB, 0.03, 16).at(0.0, 0.0, height * 0.5),
    ])
}

/// A table lamp: a lathed foot and a glowing shade; 0.52 m high.
pub fn table_lamp(foot: &'static NamedMaterial) -> Mesh {
    let profile = [
        (0.0, 0.0),
        (0.07, 0.0),
        (0.075, 0.02),
        (0.05, 0.06),
        (0.085, 0.15),
        (0.05, 0.25),
        (0.015, 0.30),
    ];
    Mesh::of([
        turned(foot, 32, &profile),
        tube(&BRASS, &[DVec3::new(0.0, 0.0, 0.29), DVec3::new(0.0, 0.0, 0.36)], 0.008, 10),
        shade(0.15, 0.10, 0.20).at(0.0, 0.0, 0.32),
    ])
}

/// A standing lamp with a glowing shade; 1.62 m high.
pub fn floor_lamp() -> Mesh {
    Mesh::of([
        turned(&BRASS, 32, &[(0.0, 0.0), (0.15, 0.0), (0.15, 0.015), (0.03, 0.03), (0.012, 0.06)]),
        tube(&BRASS, &[DVec3::new(0.0, 0.0, 0.04), DVec3::new(0.0, 0.0, 1.40)], 0.011, 14),
        shade(0.22, 0.15, 0.30).at(0.0, 0.0, 1.32),
    ])
}

/// A desk lamp with a bent arm that shines downwards.
pub fn desk_lamp() -> Mesh {
    let head = lathe(&STEEL, 28, &[(0.07, 0.0), (0.065, 0.03), (0.03, 0.06), (0.0, 0.065)]);
    let light = lathe(&BULB, 28, &[(0.0, 0.008), (0.045, 0.008)]);
    Mesh::of([
        lathe(&STEEL, 28, &[(0.0, 0.0), (0.09, 0.0), (0.09, 0.015), (0.0, 0.02)]),
        bent(
            &STEEL,
            &[[0.0, 0.0, 0.015], [-0.05, 0.0, 0.20], [0.02, 0.0, 0.38], [0.20, 0.0, 0.40]],
            0.008,
        ),
        Mesh::of([head, light]).at(0.21, 0.0, 0.335),
    ])
}

/// A box on a wall that lights it upwards and downwards.
pub fn sconce() -> Mesh {
    let lit = |z: f64, up: f64| {
        rectangle(&BULB, [-0.03 * up, 0.025, z], [0.06 * up, 0.0, 0.0], [0.0, 0.05, 0.0])
    };
    Mesh::of([
        cuboid(&BRASS, [-0.05, 0.0, -0.07], [0.05, 0.09, 0.07]),
        lit(0.072, 1.0),
        lit(-0.072, -1.0),
    ])
}

/// A candle with its flame; 0.21 m high.
pub fn candle() -> Mesh {
    Mesh::of([
        turned(&BRASS, 24, &[(0.0, 0.0), (0.045, 0.0), (0.04, 0.01), (0.012, 0.02), (0.018, 0.04)]),
        lathe(&LINEN, 20, &[(0.0, 0.03), (0.011, 0.03), (0.0105, 0.165), (0.0, 0.17)]),
        ball(&FLAME, 0.007, 10).scaled(1.0, 1.0, 2.4).at(0.0, 0.0, 0.19),
    ])
}

/// A sagging cord along x with `count` small glowing balls, against a wall.
pub fn garland(length: f64, count: usize) -> Mesh {
    let hang = |u: f64| {
        let sag = 0.10 * (u * std::f64::consts::PI * 3.0).sin().abs();
        DVec3::new((u - 0.5) * length, 0.035, -sag)
    };
    let path: Vec<_> = (0..=60).map(|i| hang(f64::from(i) / 60.0)).collect();
    let balls = (0..count).map(|i| {
        let p = hang((i as f64 + 0.5) / count as f64);
        ball(&GLOBE, 0.018, 12).at(p.x, p.y, p.z - 0.022)
    });
    Mesh::of([tube(&FABRIC_DARK, &path, 0.002, 6)].into_iter().chain(balls))
}

/// A round ceiling lamp: a ceramic bowl with a luminous disc that shines downwards.
pub fn ceiling_disc(radius: f64) -> Mesh {
    Mesh::of([
        lathe(&CERAMIC, 40, &[(radius, -0.055), (radius + 0.03, -0.06), (radius + 0.03, 0.0)]),
        lathe(&PANEL, 40, &[(0.0, -0.055), (radius, -0.055)]),
    ])
}

/// A slab under the ceiling with luminous strips on its upper side, so that the ceiling reflects
/// the light.
pub fn raft(light: &'static NamedMaterial, w: f64, d: f64) -> Mesh {
    let mut raft = rounded(&CEILING, [w, d, 0.05], 0.015).at(0.0, 0.0, -0.17);
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        let rod = tube(&STEEL, &[DVec3::new(0.0, 0.0, -0.13), DVec3::ZERO], 0.006, 8);
        raft.add(rod.at(x * (w / 2.0 - 0.25), y * (d / 2.0 - 0.25), 0.0));
    }
    for side in [-1.0, 1.0] {
        raft.add(strip(light, w - 0.4).at(0.0, side * (d / 2.0 - 0.12), -0.12));
        raft.add(strip(light, d - 0.4).turned(90.0).at(side * (w / 2.0 - 0.12), 0.0, -0.12));
    }
    raft
}
