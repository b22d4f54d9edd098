//! A bathroom: tub, washbasins, water closet, rails and towels.

use super::kitchen::tap;
use super::lamp::rod;
use crate::material::{
    CERAMIC, CHROME, CORAL, LACQUER, LINEN, NamedMaterial, STONE, STRIP_COOL, TEAL, WALNUT, WINDOW,
};
use crate::mesh::Mesh;
use crate::shapes::{
    ball, bent, cuboid, lathe, rectangle, rounded, sheet, superellipsoid, tube, turned,
};
use glam::DVec3;
use std::f64::consts::{FRAC_PI_2, TAU};

/// A built-in tub, `w` long in x and 0.75 m deep, 0.56 m high, with a screen of glass at its left
/// end.
pub fn tub(panel: &'static NamedMaterial, w: f64) -> Mesh {
    let (d, h) = (0.75, 0.56);
    let mut tub = cuboid(panel, [-w / 2.0, d - 0.02, 0.0], [w / 2.0, d, h - 0.03]);
    // From the rim's rectangle to the rounded foot of the hollow: sinking rings of a superellipse.
    let rings = [
        (1.0, h, 60.0),
        (0.93, h, 9.0),
        (0.90, h - 0.02, 7.0),
        (0.84, 0.26, 5.0),
        (0.76, 0.15, 4.0),
        (0.5, 0.12, 3.0),
        (0.02, 0.115, 2.0),
    ];
    let ring = |angle: f64, (size, z, power): (f64, f64, f64)| {
        let (sin, cos) = angle.sin_cos();
        let norm = (cos.abs().powf(power) + sin.abs().powf(power)).powf(1.0 / power);
        DVec3::new(size * w / 2.0 * cos / norm, d / 2.0 + size * d / 2.0 * sin / norm, z)
    };
    tub.add(sheet(&CERAMIC, 72, 24, |u, v| {
        let at = v * (rings.len() - 1) as f64;
        let i = (at as usize).min(rings.len() - 2);
        ring(TAU * u, rings[i]).lerp(ring(TAU * u, rings[i + 1]), at - i as f64)
    }));
    tub.add(cuboid(panel, [-w / 2.0, 0.0, 0.0], [w / 2.0, d - 0.02, 0.1]));
    tub.add(rectangle(&WINDOW, [-w / 2.0, d - 0.04, h], [0.95, 0.0, 0.0], [0.0, 0.0, 1.4]));
    let edge =
        [DVec3::new(0.95 - w / 2.0, d - 0.04, h), DVec3::new(0.95 - w / 2.0, d - 0.04, h + 1.4)];
    tub.add(tube(&CHROME, &edge, 0.008, 12));
    tub.add(shower().at(-w / 2.0 + 0.45, 0.0, h));
    tub
}

/// A shower riser with its head, from the rim of a tub.
fn shower() -> Mesh {
    Mesh::of([
        bent(
            &CHROME,
            &[
                [0.0, 0.05, 0.35],
                [0.0, 0.05, 1.3],
                [0.0, 0.08, 1.52],
                [0.0, 0.25, 1.55],
                [0.0, 0.36, 1.52],
            ],
            0.011,
        ),
        lathe(
            &CHROME,
            36,
            &[(0.0, -0.02), (0.10, -0.02), (0.11, -0.012), (0.03, 0.0), (0.012, 0.02)],
        )
        .at(0.0, 0.36, 1.52),
        tube(&CHROME, &[DVec3::new(-0.12, 0.045, 0.40), DVec3::new(0.12, 0.045, 0.40)], 0.02, 16),
        bent(&CHROME, &[[0.0, 0.05, 0.38], [0.0, 0.14, 0.36], [0.0, 0.17, 0.30]], 0.014),
    ])
}

/// Two basins on a cupboard, `w` wide, under a mirror with lit rods beside it.
pub fn vanity(w: f64) -> Mesh {
    let mut vanity = rounded(&WALNUT, [w, 0.48, 0.42], 0.01).at(0.0, 0.25, 0.38);
    vanity.add(rounded(&STONE, [w + 0.04, 0.52, 0.035], 0.01).at(0.0, 0.26, 0.80));
    for i in 0..4 {
        let x = (f64::from(i) - 1.5) * w / 4.0;
        vanity.add(rounded(&WALNUT, [w / 4.0 - 0.008, 0.02, 0.40], 0.006).at(x, 0.495, 0.39));
        vanity.add(ball(&CHROME, 0.013, 14).at(x, 0.515, 0.70));
    }
    let bowl = [
        (0.0, 0.0),
        (0.12, 0.0),
        (0.17, 0.04),
        (0.20, 0.12),
        (0.195, 0.125),
        (0.185, 0.11),
        (0.15, 0.04),
        (0.02, 0.015),
        (0.0, 0.015),
    ];
    for x in [-w / 4.0, w / 4.0] {
        vanity.add(turned(&CERAMIC, 48, &bowl).at(x, 0.29, 0.835));
        vanity.add(tap(&CHROME).scaled(0.7, 0.7, 0.75).at(x, 0.07, 0.835));
    }
    vanity.add(
        turned(
            &CORAL,
            24,
            &[(0.0, 0.0), (0.03, 0.0), (0.033, 0.08), (0.012, 0.12), (0.01, 0.15), (0.0, 0.15)],
        )
        .at(0.06, 0.15, 0.835),
    );
    vanity.add(
        turned(
            &TEAL,
            24,
            &[(0.0, 0.0), (0.035, 0.0), (0.035, 0.10), (0.031, 0.10), (0.030, 0.01), (0.0, 0.01)],
        )
        .at(-0.06, 0.16, 0.835),
    );
    vanity.add(super::decor::mirror(&CHROME, w - 0.1, 0.95).at(0.0, 0.0, 1.12));
    for x in [-1.0, 1.0] {
        vanity.add(rod(&STRIP_COOL, 0.8).at(x * (w / 2.0 + 0.05), 0.0, 1.2));
    }
    vanity
}

/// A water closet with its lid down, hung on its wall.
pub fn water_closet() -> Mesh {
    let ring = |size: f64, lean: f64, z: f64| {
        move |angle: f64| {
            let (sin, cos) = angle.sin_cos();
            DVec3::new(0.18 * size * cos, 0.27 + lean + 0.27 * size * sin, z)
        }
    };
    let levels = [
        ring(0.45, -0.12, 0.12),
        ring(0.65, -0.08, 0.2),
        ring(0.92, -0.01, 0.32),
        ring(1.0, 0.0, 0.40),
    ];
    let body = sheet(&CERAMIC, 48, 12, |u, v| {
        let at = v * 3.0;
        let i = (at as usize).min(2);
        levels[i](TAU * u).lerp(levels[i + 1](TAU * u), at - i as f64)
    });
    Mesh::of([
        body,
        superellipsoid(&LACQUER, [0.38, 0.48, 0.05], 2.4, 4.0).at(0.0, 0.29, 0.40),
        rounded(&CERAMIC, [0.36, 0.16, 0.36], 0.03).at(0.0, 0.08, 0.10),
        rounded(&CHROME, [0.24, 0.012, 0.16], 0.005).at(0.0, 0.012, 0.95),
    ])
}

/// A rail with a towel over it, 0.6 m wide; the rail is at z = 0.
pub fn towel(cloth: &'static NamedMaterial) -> Mesh {
    let rail = [DVec3::new(-0.3, 0.07, 0.0), DVec3::new(0.3, 0.07, 0.0)];
    let mut towel = tube(&CHROME, &rail, 0.009, 14);
    for x in [-0.29, 0.29] {
        towel.add(tube(&CHROME, &[DVec3::new(x, 0.0, 0.0), DVec3::new(x, 0.07, 0.0)], 0.008, 12));
    }
    towel.add(sheet(cloth, 30, 40, |u, v| {
        let x = 0.42 * (u - 0.5);
        let swing = 0.006 * (24.0 * u + 1.0).sin();
        // Up behind, over the rail in a half turn, down in front.
        let (y, z) = if v < 0.42 {
            (0.055, -0.42 * (1.0 - v / 0.42))
        } else if v < 0.58 {
            let turn = (v - 0.5) / 0.08 * FRAC_PI_2;
            (0.07 + 0.015 * turn.sin(), 0.015 * turn.cos())
        } else {
            (0.085, -0.52 * (v - 0.58) / 0.42)
        };
        DVec3::new(x, y + swing * (-z / 0.3).clamp(0.0, 1.0), z)
    }));
    towel
}

/// A pile of rolled towels.
pub fn rolled_towels() -> Mesh {
    let roll = |cloth: &'static NamedMaterial| {
        lathe(
            cloth,
            24,
            &[
                (0.0, -0.17),
                (0.045, -0.17),
                (0.055, -0.16),
                (0.055, 0.16),
                (0.045, 0.17),
                (0.0, 0.17),
            ],
        )
        .tilted(90.0)
    };
    Mesh::of([
        roll(&LINEN).at(-0.057, 0.0, 0.055),
        roll(&TEAL).at(0.057, 0.0, 0.055),
        roll(&LINEN).at(0.0, 0.0, 0.153),
    ])
}

/// A heated rail of bent rods, 0.5 m wide and 1.1 m high.
pub fn heated_rail() -> Mesh {
    let mut rail = Mesh::default();
    for x in [-0.24, 0.24] {
        rail.add(tube(&CHROME, &[DVec3::new(x, 0.06, 0.0), DVec3::new(x, 0.06, 1.1)], 0.016, 16));
    }
    for i in 0..11 {
        let z = 0.06 + 0.098 * f64::from(i);
        rail.add(bent(
            &CHROME,
            &[[-0.24, 0.06, z], [-0.12, 0.085, z], [0.12, 0.085, z], [0.24, 0.06, z]],
            0.010,
        ));
    }
    rail
}
