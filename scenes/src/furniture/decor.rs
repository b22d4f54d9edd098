//! Pictures, mirrors, rugs, curtains, and things on tables.

use crate::material::{
    AMBER, BOOKS, CERAMIC, CERAMIC_BLUE, CORAL, CRYSTAL, INK, LIME, MIRROR, MUSTARD, NamedMaterial,
    PAPER, STEEL, TEAL,
};
use crate::mesh::Mesh;
use crate::random::SeededRandom;
use crate::shapes::{ball, block, cuboid, lathe, rounded, sheet, tube, turned};
use glam::DVec3;
use std::f64::consts::TAU;

/// A framed abstract picture of bands and discs, which depend on `seed`; its lower edge is at z =
/// 0.
pub fn picture(frame: &'static NamedMaterial, w: f64, h: f64, seed: u64) -> Mesh {
    let random = &mut SeededRandom::new(seed);
    let mut art = framed(frame, &PAPER, w, h);
    let (x0, z0, pw, ph) = (0.09 - w / 2.0, 0.09, w - 0.18, h - 0.18);
    let bands = 3 + (random.unit() * 3.0) as usize;
    let mut z = z0;
    for band in 0..bands {
        let top = z0 + ph * (band as f64 + random.range(0.7, 1.0)) / bands as f64;
        let wave = random.range(0.0, 0.04);
        let phase = random.range(0.0, TAU);
        let colour = random.pick(BOOKS);
        art.add(sheet(colour, 24, 1, |u, v| {
            let edge = if v > 0.5 { top - wave * (1.0 + (4.0 * u + phase).sin()) / 2.0 } else { z };
            DVec3::new(x0 + pw * (1.0 - u), 0.022 + 0.0004 * band as f64, edge)
        }));
        z = top - wave;
    }
    let radius = random.range(0.12, 0.22) * pw.min(ph);
    let disc = lathe(random.pick(&[&MUSTARD, &CORAL, &INK]), 40, &[(radius, 0.0), (0.0, 0.0)])
        .tilted(-90.0);
    art.add(disc.at(x0 + pw * random.range(0.3, 0.7), 0.026, z0 + ph * random.range(0.5, 0.72)));
    art
}

/// A framed mirror; its lower edge is at z = 0.
pub fn mirror(frame: &'static NamedMaterial, w: f64, h: f64) -> Mesh {
    framed(frame, &MIRROR, w, h)
}

/// A round mirror in a rim; its lower edge is at z = 0.
pub fn round_mirror(rim: &'static NamedMaterial, radius: f64) -> Mesh {
    let ring = [(radius, 0.0), (radius + 0.02, 0.0), (radius + 0.02, 0.03), (radius, 0.03)];
    Mesh::of([
        lathe(rim, 64, &ring).tilted(-90.0),
        lathe(&MIRROR, 64, &[(radius + 0.001, 0.02), (0.0, 0.02)]).tilted(-90.0),
    ])
    .at(0.0, 0.0, radius + 0.02)
}

fn framed(frame: &'static NamedMaterial, inside: &'static NamedMaterial, w: f64, h: f64) -> Mesh {
    let (bar, deep) = (0.03, 0.035);
    let mut framed = cuboid(
        inside,
        [bar / 2.0 - w / 2.0, 0.004, bar / 2.0],
        [w / 2.0 - bar / 2.0, 0.02, h - bar / 2.0],
    );
    for z in [0.0, h - bar] {
        framed.add(rounded(frame, [w, deep, bar], 0.006).at(0.0, deep / 2.0, z));
    }
    for x in [-1.0, 1.0] {
        framed.add(rounded(frame, [bar, deep, h], 0.006).at(x * (w - bar) / 2.0, deep / 2.0, 0.0));
    }
    framed
}

/// A rug with a border and stripes, 12 mm thick.
pub fn rug(ground: &'static NamedMaterial, stripe: &'static NamedMaterial, w: f64, d: f64) -> Mesh {
    let mut rug = rounded(stripe, [w, d, 0.010], 0.005);
    rug.add(cuboid(
        ground,
        [0.08 - w / 2.0, 0.08 - d / 2.0, 0.002],
        [w / 2.0 - 0.08, d / 2.0 - 0.08, 0.012],
    ));
    let stripes = (d / 0.3) as usize;
    for i in 1..stripes {
        let y = d * (i as f64 / stripes as f64 - 0.5);
        let wavy = |u: f64, v: f64| {
            let x = (w - 0.24) * (u - 0.5);
            DVec3::new(x, y + 0.035 * (x * 9.0 + i as f64).sin() + 0.03 * (v - 0.5), 0.0126)
        };
        rug.add(sheet(stripe, 60, 1, wavy));
    }
    rug
}

/// A pair of curtains on a rod, drawn aside from a window `w` wide. Each gathers in folds over
/// `part` of the width.
pub fn curtains(cloth: &'static NamedMaterial, w: f64, h: f64, part: f64) -> Mesh {
    let reach = w / 2.0 + 0.2;
    let rod = [DVec3::new(-reach, 0.09, h), DVec3::new(reach, 0.09, h)];
    let mut pair = tube(&STEEL, &rod, 0.012, 16);
    for side in [-1.0, 1.0] {
        pair.add(ball(&STEEL, 0.025, 16).at(side * reach, 0.09, h));
        pair.add(tube(
            &STEEL,
            &[
                DVec3::new(side * (reach - 0.08), 0.0, h),
                DVec3::new(side * (reach - 0.08), 0.09, h),
            ],
            0.008,
            10,
        ));
        let width = part * w;
        pair.add(sheet(cloth, 120, 9, |u, v| {
            let folds = (width / 0.115).round();
            let gather = 0.022 + 0.022 * (1.0 - v);
            let phase = TAU * folds * u + 0.5 * (3.0 * v + side).sin();
            // Tied slightly narrower at two fifths of its height.
            let tie = 1.0 - 0.16 * (-(v - 0.4) * (v - 0.4) / 0.03).exp();
            let x = side * (reach - 0.06 - width * u * tie) + 0.012 * (2.0 * phase).sin();
            DVec3::new(x, 0.09 + gather * phase.sin(), 0.015 + (h - 0.02) * v)
        }));
    }
    pair
}

/// A vase with a narrow neck, 0.3 m high, open at the top. It is a closed solid, so it may be of
/// glass.
pub fn vase(material: &'static NamedMaterial) -> Mesh {
    turned(
        material,
        28,
        &[
            (0.0, 0.0),
            (0.05, 0.0),
            (0.085, 0.09),
            (0.075, 0.16),
            (0.032, 0.23),
            (0.042, 0.30),
            (0.037, 0.30),
            (0.027, 0.23),
            (0.068, 0.16),
            (0.078, 0.09),
            (0.045, 0.012),
            (0.0, 0.012),
        ],
    )
}

/// A bowl.
pub fn bowl(material: &'static NamedMaterial, radius: f64) -> Mesh {
    let profile = [
        (0.0, 0.0),
        (0.4, 0.0),
        (0.42, 0.05),
        (0.8, 0.28),
        (1.0, 0.6),
        (0.96, 0.6),
        (0.76, 0.33),
        (0.4, 0.12),
        (0.0, 0.09),
    ];
    turned(material, 22, &profile.map(|(r, z)| (r * radius, z * radius)))
}

/// A bowl of fruit.
pub fn fruit(material: &'static NamedMaterial) -> Mesh {
    let mut filled = bowl(material, 0.18);
    let colours = [&CORAL, &LIME, &MUSTARD];
    for i in 0..9_u8 {
        let angle = TAU * f64::from(i) / 6.0;
        let (r, z) = if i < 6 { (0.085, 0.085) } else { (0.04, 0.135) };
        let colour = colours[usize::from(i) % 3];
        filled.add(ball(colour, 0.04, 18).scaled(1.0, 1.0, 0.92).at(
            r * angle.cos(),
            r * angle.sin(),
            z,
        ));
    }
    filled
}

/// A wine glass, 0.21 m high.
pub fn wine_glass() -> Mesh {
    turned(
        &CRYSTAL,
        18,
        &[
            (0.0, 0.0),
            (0.034, 0.0),
            (0.033, 0.003),
            (0.006, 0.010),
            (0.0045, 0.05),
            (0.008, 0.085),
            (0.036, 0.125),
            (0.039, 0.16),
            (0.031, 0.21),
            (0.0298, 0.21),
            (0.0375, 0.16),
            (0.0345, 0.127),
            (0.008, 0.094),
            (0.0, 0.092),
        ],
    )
}

/// A bottle of amber glass, stoppered.
pub fn bottle() -> Mesh {
    let body = [
        (0.0, 0.0),
        (0.037, 0.0),
        (0.038, 0.02),
        (0.038, 0.16),
        (0.030, 0.20),
        (0.014, 0.23),
        (0.014, 0.285),
        (0.0, 0.29),
    ];
    Mesh::of([
        lathe(&AMBER, 32, &body),
        lathe(&INK, 16, &[(0.0, 0.292), (0.012, 0.292), (0.012, 0.31), (0.0, 0.31)]),
    ])
}

/// A set place at a table: plates, a bowl, cutlery, a glass. The guest sits towards -y.
pub fn place_setting() -> Mesh {
    let plate = |r: f64| {
        turned(
            &CERAMIC,
            24,
            &[
                (0.0, 0.0),
                (0.6 * r, 0.0),
                (0.7 * r, 0.006),
                (r, 0.018),
                (0.98 * r, 0.021),
                (0.68 * r, 0.010),
                (0.0, 0.006),
            ],
        )
    };
    let mut set = plate(0.135);
    set.add(plate(0.10).at(0.0, 0.0, 0.012));
    set.add(bowl(&CERAMIC_BLUE, 0.07).at(0.0, 0.0, 0.020));
    for (x, long) in [(-0.17, 0.19), (0.165, 0.20), (0.19, 0.18)] {
        set.add(block(&STEEL, [0.012, long, 0.003]).at(x, -0.01, 0.0));
        set.add(block(&STEEL, [0.022, 0.05, 0.003]).at(x, long / 2.0 - 0.01, 0.0));
    }
    set.add(wine_glass().at(0.15, 0.19, 0.0));
    set
}

/// A globe on a stand.
pub fn globe() -> Mesh {
    let ring: Vec<_> = (0..=24)
        .map(|i| {
            let (sin, cos) = (-0.5 + 4.0 * f64::from(i) / 24.0 - 1.2_f64).sin_cos();
            DVec3::new(0.155 * cos, 0.0, 0.2 + 0.155 * sin)
        })
        .collect();
    Mesh::of([
        ball(&TEAL, 0.14, 36).at(0.0, 0.0, 0.2),
        tube(&MUSTARD, &ring, 0.006, 10),
        turned(&INK, 28, &[(0.0, 0.0), (0.09, 0.0), (0.08, 0.015), (0.012, 0.03), (0.01, 0.05)]),
    ])
}
