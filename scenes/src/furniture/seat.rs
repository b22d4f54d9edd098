//! Sofas, armchairs, chairs and stools.

use crate::material::{NamedMaterial, STEEL, WALNUT};
use crate::mesh::Mesh;
use crate::shapes::{bent, block, cushion, lathe, rounded, superellipsoid, tube, turned};
use glam::DVec3;

/// A sofa `seats` × 0.75 m wide with loose cushions in `accents`; its back is 0.85 m high.
pub fn sofa(
    fabric: &'static NamedMaterial,
    seats: usize,
    accents: &[&'static NamedMaterial],
) -> Mesh {
    let inside = seats as f64 * 0.75;
    let mut sofa = rounded(fabric, [inside + 0.4, 0.90, 0.20], 0.04).at(0.0, 0.47, 0.12);
    sofa.add(rounded(fabric, [inside + 0.4, 0.22, 0.60], 0.07).at(0.0, 0.13, 0.18));
    for side in [-1.0, 1.0] {
        sofa.add(rounded(fabric, [0.20, 0.90, 0.48], 0.07).at(
            side * (inside / 2.0 + 0.1),
            0.47,
            0.14,
        ));
        for y in [0.1, 0.84] {
            sofa.add(leg(0.12).at(side * (inside / 2.0 + 0.1), y, 0.0));
        }
    }
    for seat in 0..seats {
        let x = (seat as f64 + 0.5) * 0.75 - inside / 2.0;
        sofa.add(superellipsoid(fabric, [0.74, 0.72, 0.18], 8.0, 4.0).at(x, 0.57, 0.31));
        let back = superellipsoid(fabric, [0.72, 0.42, 0.20], 7.0, 3.0).tilted(102.0);
        sofa.add(back.at(x, 0.40, 0.62));
    }
    for (i, &accent) in accents.iter().enumerate() {
        let end = if i % 2 == 0 { -1.0 } else { 1.0 };
        let x = end * (inside / 2.0 - 0.24 - 0.34 * (i / 2) as f64);
        let loose = cushion(accent, [0.42, 0.42, 0.15]).tilted(112.0).turned(end * 12.0);
        sofa.add(loose.at(x, 0.56, 0.67));
    }
    sofa
}

/// A deep chair with a round shell.
pub fn armchair(fabric: &'static NamedMaterial, accent: &'static NamedMaterial) -> Mesh {
    let mut chair = superellipsoid(fabric, [0.66, 0.64, 0.20], 5.0, 4.0).at(0.0, 0.42, 0.26);
    // The shell: an arc of upholstery behind and beside the seat, lower towards its ends.
    let (segments, radius, thick) = (28, 0.38, 0.055);
    let shell = |u: f64, v: f64| {
        let angle = (-195.0 + 210.0 * u).to_radians();
        let height = 0.52 + 0.28 * (std::f64::consts::PI * u).sin();
        let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
        let r = radius + thick * cos;
        let z = 0.18 + (height - 0.18) * (0.5 + 0.5 * sin);
        DVec3::new(r * angle.cos(), 0.44 + r * angle.sin(), z)
    };
    chair.add(crate::shapes::sheet(fabric, segments, 16, shell));
    for end in [0.0_f64, 1.0] {
        let angle = (-195.0 + 210.0 * end).to_radians();
        let cap = superellipsoid(fabric, [0.11, 0.06, 0.34], 2.0, 2.5);
        chair.add(cap.turned(angle.to_degrees()).at(
            radius * angle.cos(),
            0.44 + radius * angle.sin(),
            0.18,
        ));
    }
    chair.add(cushion(accent, [0.38, 0.38, 0.14]).tilted(114.0).at(0.0, 0.24, 0.58));
    for (x, y) in [(-0.26, 0.2), (0.26, 0.2), (-0.24, 0.66), (0.24, 0.66)] {
        chair.add(leg(0.28).at(x, y, 0.0));
    }
    chair
}

/// A tapered wooden leg.
pub fn leg(height: f64) -> Mesh {
    lathe(&WALNUT, 14, &[(0.0, 0.0), (0.014, 0.0), (0.024, height), (0.0, height)])
}

/// A dining chair, centred, its back towards -y, 0.84 m high.
pub fn chair(wood: &'static NamedMaterial, fabric: &'static NamedMaterial) -> Mesh {
    let mut chair = superellipsoid(fabric, [0.45, 0.44, 0.07], 5.0, 2.6).at(0.0, 0.0, 0.42);
    chair.add(rounded(wood, [0.43, 0.42, 0.03], 0.012).at(0.0, 0.0, 0.40));
    for side in [-1.0, 1.0] {
        chair.add(bent(
            wood,
            &[[side * 0.20, 0.20, 0.0], [side * 0.19, 0.19, 0.2], [side * 0.18, 0.17, 0.41]],
            0.016,
        ));
        chair.add(bent(
            wood,
            &[
                [side * 0.20, -0.23, 0.0],
                [side * 0.19, -0.19, 0.40],
                [side * 0.19, -0.21, 0.62],
                [side * 0.185, -0.26, 0.82],
            ],
            0.016,
        ));
        let rung = [DVec3::new(side * 0.195, 0.19, 0.2), DVec3::new(side * 0.195, -0.205, 0.2)];
        chair.add(tube(wood, &rung, 0.009, 10));
    }
    // The back: a board that curves around the sitter.
    for (z, y) in [(0.62, -0.215), (0.76, -0.245)] {
        let slat = |u: f64, v: f64| {
            let bow = 0.045 * (1.0 - (2.0 * u - 1.0) * (2.0 * u - 1.0));
            let (sin, cos) = (std::f64::consts::TAU * v).sin_cos();
            DVec3::new(0.39 * (u - 0.5), y - bow + 0.009 * cos, z + 0.035 * sin)
        };
        chair.add(crate::shapes::sheet(wood, 10, 8, slat));
    }
    chair
}

/// A high stool with a metal ring for the feet.
pub fn stool(wood: &'static NamedMaterial) -> Mesh {
    let mut stool =
        turned(wood, 32, &[(0.0, 0.60), (0.15, 0.60), (0.17, 0.62), (0.165, 0.645), (0.0, 0.64)]);
    for i in 0..4 {
        let (sin, cos) = (std::f64::consts::TAU * (f64::from(i) + 0.5) / 4.0).sin_cos();
        let path =
            [DVec3::new(0.20 * cos, 0.20 * sin, 0.0), DVec3::new(0.11 * cos, 0.11 * sin, 0.61)];
        stool.add(tube(wood, &path, 0.014, 12));
    }
    let ring: Vec<_> = (0..=32)
        .map(|i| {
            let (sin, cos) = (std::f64::consts::TAU * f64::from(i) / 32.0).sin_cos();
            DVec3::new(0.175 * cos, 0.175 * sin, 0.2)
        })
        .collect();
    stool.add(tube(&STEEL, &ring, 0.007, 10));
    stool
}

/// A desk chair on a star of five feet, centred, its back towards -y, 0.98 m high.
pub fn desk_chair(fabric: &'static NamedMaterial) -> Mesh {
    let mut chair = superellipsoid(fabric, [0.50, 0.48, 0.10], 5.0, 2.6).at(0.0, 0.0, 0.42);
    chair.add(
        superellipsoid(fabric, [0.44, 0.48, 0.09], 5.0, 2.6).tilted(96.0).at(0.0, -0.20, 0.74),
    );
    chair.add(bent(
        &STEEL,
        &[[0.0, 0.0, 0.41], [0.0, -0.22, 0.42], [0.0, -0.26, 0.55], [0.0, -0.24, 0.78]],
        0.016,
    ));
    chair.add(tube(&STEEL, &[DVec3::new(0.0, 0.0, 0.07), DVec3::new(0.0, 0.0, 0.44)], 0.025, 16));
    for i in 0..5 {
        let foot = Mesh::of([
            block(&STEEL, [0.30, 0.03, 0.025]).at(0.15, 0.0, 0.06),
            crate::shapes::ball(fabric, 0.03, 12).at(0.29, 0.0, 0.03),
        ]);
        chair.add(foot.turned(72.0 * f64::from(i)));
    }
    for side in [-1.0, 1.0] {
        chair.add(bent(
            &STEEL,
            &[[side * 0.20, 0.0, 0.43], [side * 0.29, 0.0, 0.50], [side * 0.28, 0.0, 0.63]],
            0.011,
        ));
        chair.add(rounded(fabric, [0.06, 0.26, 0.03], 0.012).at(side * 0.28, 0.0, 0.63));
    }
    chair
}
