//! A kitchen: cupboards below and above, worktop, sink, hob, oven, hood, refrigerator.

use crate::furniture::lamp::strip;
use crate::material::{
    BRASS, CABINET, CHROME, COPPER, GROUT, INK, NamedMaterial, STEEL, STONE, STONE_DARK, STRIP,
    TILE_WHITE,
};
use crate::mesh::Mesh;
use crate::shapes::{bent, cuboid, lathe, rounded, tube};
use glam::DVec3;

/// Height of the worktop.
const TOP: f64 = 0.90;

/// Fronts from `z0` to `z1` along `w`, at depth `d`, each with a handle bar.
fn fronts(w: f64, d: f64, z0: f64, z1: f64, count: usize, grip: f64) -> Mesh {
    let pitch = w / count as f64;
    Mesh::of((0..count).map(|i| {
        let x = (i as f64 + 0.5) * pitch - w / 2.0;
        let bar = [DVec3::new(x - 0.09, d + 0.03, grip), DVec3::new(x + 0.09, d + 0.03, grip)];
        let post = |x: f64| {
            tube(&BRASS, &[DVec3::new(x, d, grip), DVec3::new(x, d + 0.03, grip)], 0.004, 8)
        };
        Mesh::of([
            rounded(&CABINET, [pitch - 0.006, 0.022, z1 - z0 - 0.006], 0.006).at(
                x,
                d - 0.011,
                z0 + 0.003,
            ),
            tube(&BRASS, &bar, 0.006, 12),
            post(x - 0.07),
            post(x + 0.07),
        ])
    }))
}

/// The units along a wall, `w` wide: base cupboards with worktop, a sink on the left, and a hob
/// with oven and hood on the right. Behind are tiles; above are cupboards with strips of light
/// beneath.
pub fn run(w: f64) -> Mesh {
    let sink = -w / 4.0;
    let hob = w / 4.0;
    let mut run = cuboid(&CABINET, [-w / 2.0, 0.0, 0.1], [w / 2.0, 0.58, TOP - 0.24]);
    run.add(cuboid(&INK, [-w / 2.0, 0.0, 0.0], [w / 2.0, 0.53, 0.1]));
    run.add(fronts(w, 0.60, 0.1, 0.64, (w / 0.6) as usize, 0.58));
    run.add(fronts(w, 0.60, 0.64, TOP - 0.03, (w / 0.6) as usize, 0.80));
    run.add(worktop(w, sink));
    run.add(basin(&STEEL, 0.56, 0.40, 0.2).at(sink, 0.32, TOP - 0.2));
    run.add(tap(&CHROME).at(sink, 0.085, TOP));
    run.add(range().at(hob, 0.0, 0.0));
    run.add(tiles(&TILE_WHITE, w, 0.55, 0.15, 0.075).at(0.0, 0.0, TOP));
    for (x, w) in
        [(-w / 8.0 - 0.2, 0.75 * w - 0.4), (hob + 0.425 + (w / 4.0 - 0.425) / 2.0, w / 4.0 - 0.425)]
    {
        run.add(cuboid(&CABINET, [x - w / 2.0, 0.0, TOP + 0.55], [x + w / 2.0, 0.31, 2.25]));
        run.add(
            fronts(w, 0.333, TOP + 0.55, 2.25, (w / 0.5).ceil() as usize, TOP + 0.60)
                .at(x, 0.0, 0.0),
        );
        run.add(strip(&STRIP, w - 0.1).tilted(180.0).at(x, 0.22, TOP + 0.549));
    }
    run
}

/// The slab around the opening of the sink.
fn worktop(w: f64, sink: f64) -> Mesh {
    let (z0, z1) = (TOP - 0.03, TOP);
    let (x0, x1) = (sink - 0.28, sink + 0.28);
    Mesh::of([
        cuboid(&STONE, [-w / 2.0 - 0.02, 0.0, z0], [x0, 0.63, z1]),
        cuboid(&STONE, [x1, 0.0, z0], [w / 2.0 + 0.02, 0.63, z1]),
        cuboid(&STONE, [x0, 0.0, z0], [x1, 0.12, z1]),
        cuboid(&STONE, [x0, 0.52, z0], [x1, 0.63, z1]),
    ])
}

/// An open box: the inside of a sink, with its rim at z = `deep`.
pub fn basin(material: &'static NamedMaterial, w: f64, d: f64, deep: f64) -> Mesh {
    let (x, y, wall) = (w / 2.0, d / 2.0, 0.008);
    Mesh::of([
        cuboid(material, [-x, -y, 0.0], [x, y, wall]),
        cuboid(material, [-x, -y, wall], [wall - x, y, deep]),
        cuboid(material, [x - wall, -y, wall], [x, y, deep]),
        cuboid(material, [wall - x, -y, wall], [x - wall, wall - y, deep]),
        cuboid(material, [wall - x, y - wall, wall], [x - wall, y, deep]),
        lathe(&CHROME, 20, &[(0.03, wall + 0.002), (0.0, wall + 0.001)]),
    ])
}

/// A high tap that arches towards +y.
pub fn tap(metal: &'static NamedMaterial) -> Mesh {
    Mesh::of([
        lathe(
            metal,
            24,
            &[(0.0, 0.0), (0.03, 0.0), (0.028, 0.012), (0.016, 0.03), (0.014, 0.05), (0.0, 0.05)],
        ),
        bent(
            metal,
            &[
                [0.0, 0.0, 0.04],
                [0.0, 0.0, 0.24],
                [0.0, 0.07, 0.32],
                [0.0, 0.17, 0.28],
                [0.0, 0.18, 0.20],
            ],
            0.012,
        ),
        bent(metal, &[[0.02, 0.0, 0.05], [0.05, 0.0, 0.06], [0.09, 0.0, 0.09]], 0.006),
    ])
}

/// Hob, oven and hood, with a pot.
fn range() -> Mesh {
    let mut range = rounded(&STONE_DARK, [0.76, 0.50, 0.012], 0.004).at(0.0, 0.32, TOP);
    for (x, y) in [(-0.2, 0.2), (0.2, 0.2), (-0.2, 0.44), (0.2, 0.44)] {
        range.add(
            lathe(&STEEL, 36, &[(0.085, 0.0125), (0.09, 0.0135), (0.095, 0.0125)]).at(x, y, TOP),
        );
    }
    let pot = [
        (0.0, 0.0),
        (0.105, 0.0),
        (0.11, 0.01),
        (0.11, 0.12),
        (0.115, 0.125),
        (0.10, 0.135),
        (0.02, 0.15),
        (0.0, 0.15),
    ];
    range.add(lathe(&COPPER, 40, &pot).at(-0.2, 0.2, TOP + 0.014));
    range.add(rounded(&COPPER, [0.05, 0.03, 0.025], 0.01).at(-0.2, 0.2, TOP + 0.164));
    range.add(rounded(&STEEL, [0.58, 0.03, 0.58], 0.008).at(0.0, 0.61, 0.14));
    range.add(cuboid(&STONE_DARK, [-0.22, 0.62, 0.22], [0.22, 0.6275, 0.52]));
    let bar = [DVec3::new(-0.24, 0.66, 0.63), DVec3::new(0.24, 0.66, 0.63)];
    range.add(tube(&CHROME, &bar, 0.009, 14));
    range.add(hood());
    range
}

/// A hood: a pyramid of four sides under a shaft, with two lights.
fn hood() -> Mesh {
    let (low, high) = (1.62, 1.92);
    let foot = [(-0.4, 0.0), (0.4, 0.0), (0.4, 0.46), (-0.4, 0.46)];
    let head = [(-0.14, 0.0), (0.14, 0.0), (0.14, 0.24), (-0.14, 0.24)];
    let mut hood = Mesh::default();
    for ((x, y), z) in foot.map(|p| (p, low + 0.05)).into_iter().chain(head.map(|p| (p, high))) {
        hood.point(DVec3::new(x, y, z));
    }
    for i in 0..4 {
        let next = (i + 1) % 4;
        hood.quad(&STEEL, [i, next, next + 4, i + 4]);
    }
    hood.add(cuboid(&STEEL, [-0.4, 0.0, low], [0.4, 0.46, low + 0.05]));
    hood.add(cuboid(&STEEL, [-0.14, 0.0, high], [0.14, 0.24, 2.7]));
    for x in [-0.22, 0.22] {
        hood.add(super::lamp::downlight().scaled(0.7, 0.7, 0.7).at(x, 0.28, low));
    }
    hood
}

/// Single tiles on a wall from z = 0, centred in x, in front of a bed of grout.
pub fn tiles(tile: &'static NamedMaterial, w: f64, h: f64, tile_w: f64, tile_h: f64) -> Mesh {
    let (columns, rows) = ((w / tile_w).round() as usize, (h / tile_h).round() as usize);
    let (cw, ch) = (w / columns as f64, h / rows as f64);
    let mut wall = cuboid(&GROUT, [-w / 2.0, 0.0, 0.0], [w / 2.0, 0.004, h]);
    for i in 0..columns {
        for j in 0..rows {
            let (x, z) = (i as f64 * cw - w / 2.0, j as f64 * ch);
            wall.add(cuboid(
                tile,
                [x + 0.0015, 0.003, z + 0.0015],
                [x + cw - 0.0015, 0.008, z + ch - 0.0015],
            ));
        }
    }
    wall
}

/// A tall refrigerator of brushed steel.
pub fn refrigerator() -> Mesh {
    let mut body = rounded(&STEEL, [0.70, 0.62, 1.98], 0.02).at(0.0, 0.31, 0.02);
    for (z, h) in [(0.05, 0.62), (0.69, 1.29)] {
        body.add(rounded(&STEEL, [0.69, 0.05, h], 0.012).at(0.0, 0.65, z));
        let grip = z + h / 2.0;
        let bar = [DVec3::new(-0.29, 0.72, grip - 0.2), DVec3::new(-0.29, 0.72, grip + 0.2)];
        body.add(tube(&CHROME, &bar, 0.011, 16));
        for z in [grip - 0.17, grip + 0.17] {
            body.add(tube(
                &CHROME,
                &[DVec3::new(-0.29, 0.67, z), DVec3::new(-0.29, 0.72, z)],
                0.007,
                10,
            ));
        }
    }
    body
}
