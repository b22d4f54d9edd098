//! A bed with mattress, pillows, a duvet that hangs over its sides, and a folded blanket; and a
//! wardrobe.

use crate::material::{BRASS, CORAL, LACQUER, LINEN, MIRROR, MUSTARD, NamedMaterial, SHEET, TEAL};
use crate::mesh::Mesh;
use crate::shapes::{cuboid, cushion, rounded, sheet, superellipsoid, tube};
use glam::DVec3;

/// A bed 1.8 m × 2.1 m with an upholstered headboard of 0.98 m.
pub fn bed(wood: &'static NamedMaterial, fabric: &'static NamedMaterial) -> Mesh {
    let mut bed = rounded(wood, [1.86, 2.08, 0.22], 0.03).at(0.0, 1.12, 0.08);
    for (x, y) in [(-0.8, 0.25), (0.8, 0.25), (-0.8, 2.0), (0.8, 2.0)] {
        bed.add(cuboid(wood, [x - 0.03, y - 0.03, 0.0], [x + 0.03, y + 0.03, 0.09]));
    }
    for i in 0..6 {
        let x = (f64::from(i) - 2.5) * 0.33;
        bed.add(superellipsoid(fabric, [0.33, 0.09, 0.66], 4.0, 6.0).at(x, 0.05, 0.32));
    }
    bed.add(rounded(&SHEET, [1.78, 2.0, 0.24], 0.06).at(0.0, 1.11, 0.29));
    bed.add(cover(&LINEN, 0.72, 2.15, 0.565, 0.91));
    bed.add(cover(&TEAL, 1.42, 1.86, 0.59, 0.93));
    for x in [-0.44, 0.44] {
        bed.add(cushion(&SHEET, [0.70, 0.46, 0.20]).tilted(-28.0).at(x, 0.38, 0.58));
        bed.add(cushion(&LINEN, [0.66, 0.44, 0.19]).tilted(-52.0).at(x * 1.02, 0.27, 0.66));
    }
    bed.add(cushion(&MUSTARD, [0.42, 0.42, 0.15]).tilted(-42.0).at(-0.16, 0.60, 0.64));
    bed.add(cushion(&CORAL, [0.46, 0.30, 0.14]).tilted(-38.0).at(0.22, 0.63, 0.62));
    bed
}

/// A cloth over the bed from y0 to y1 at height `top`, in soft folds. It hangs down beyond `half`
/// of the width.
fn cover(cloth: &'static NamedMaterial, y0: f64, y1: f64, top: f64, half: f64) -> Mesh {
    let hang = top - 0.27;
    let span = half + hang;
    sheet(cloth, 64, 32, |u, v| {
        let across = (2.0 * u - 1.0) * span;
        let y = y0 + (y1 - y0) * v;
        let fold = 0.010 * (9.0 * y + 3.0 * across).sin() + 0.007 * (17.0 * across - 5.0 * y).sin();
        // Beyond the mattress it turns down over a radius, and waves.
        let over = (across.abs() - half).max(0.0);
        let turn = 1.0 - (-over / 0.05).exp();
        let wave = 0.022 * (21.0 * y).sin() * (over / hang);
        let x = across.signum() * (across.abs().min(half) + 0.04 * turn + wave);
        let rim = 0.014 * (1.0 - (v * (1.0 - v) * 12.0).min(1.0));
        DVec3::new(x, y, top + fold * (1.0 - turn) - rim - (over - 0.03 * turn).max(0.0))
    })
}

/// A wardrobe of `doors` doors, 2.2 m high; door number `mirrored` is a mirror.
pub fn wardrobe(w: f64, doors: usize, mirrored: usize) -> Mesh {
    let (d, h) = (0.58, 2.2);
    let mut wardrobe = cuboid(&LACQUER, [-w / 2.0, 0.0, 0.0], [w / 2.0, d - 0.025, h]);
    let pitch = w / doors as f64;
    for i in 0..doors {
        let x = (i as f64 + 0.5) * pitch - w / 2.0;
        wardrobe.add(rounded(&LACQUER, [pitch - 0.006, 0.024, h - 0.1], 0.008).at(
            x,
            d - 0.012,
            0.08,
        ));
        if i == mirrored {
            let (x0, x1) = (x - pitch / 2.0 + 0.05, x + pitch / 2.0 - 0.05);
            wardrobe.add(cuboid(&MIRROR, [x0, d - 0.01, 0.16], [x1, d + 0.003, h - 0.1]));
        }
        let x = x + (pitch / 2.0 - 0.03) * if i % 2 == 0 { 1.0 } else { -1.0 };
        let grip = [DVec3::new(x, d + 0.02, 0.95), DVec3::new(x, d + 0.02, 1.25)];
        wardrobe.add(tube(&BRASS, &grip, 0.007, 12));
    }
    wardrobe
}
