//! Tables, desks and low cupboards.

use super::seat::leg;
use crate::material::{BRASS, NamedMaterial, STEEL, TABLE_GLASS};
use crate::mesh::Mesh;
use crate::shapes::{ball, cuboid, rectangle, rounded, tube, turned};
use glam::DVec3;

/// A low table: a pane of glass over a shelf, in a frame; 0.42 m high.
pub fn coffee_table(wood: &'static NamedMaterial) -> Mesh {
    let (w, d) = (1.20, 0.70);
    let mut table =
        rectangle(&TABLE_GLASS, [-w / 2.0, -d / 2.0, 0.418], [w, 0.0, 0.0], [0.0, d, 0.0]);
    table.add(rounded(wood, [w - 0.1, d - 0.1, 0.03], 0.01).at(0.0, 0.0, 0.14));
    for side in [-1.0, 1.0] {
        table.add(rounded(wood, [w + 0.04, 0.04, 0.04], 0.01).at(0.0, side * d / 2.0, 0.38));
        table.add(rounded(wood, [0.04, d - 0.04, 0.04], 0.01).at(side * w / 2.0, 0.0, 0.38));
        for end in [-1.0, 1.0] {
            table.add(leg(0.39).at(side * (w / 2.0 - 0.01), end * (d / 2.0 - 0.01), 0.0));
        }
    }
    table
}

/// A dining table, 0.75 m high, long in y.
pub fn dining_table(wood: &'static NamedMaterial, w: f64, d: f64) -> Mesh {
    let mut table = rounded(wood, [w, d, 0.04], 0.014).at(0.0, 0.0, 0.71);
    table.add(rounded(wood, [w - 0.2, d - 0.2, 0.08], 0.01).at(0.0, 0.0, 0.63));
    let profile = [
        (0.0, 0.0),
        (0.028, 0.0),
        (0.024, 0.05),
        (0.036, 0.20),
        (0.044, 0.45),
        (0.034, 0.52),
        (0.045, 0.56),
        (0.045, 0.70),
    ];
    for x in [-1.0, 1.0] {
        for y in [-1.0, 1.0] {
            table.add(turned(wood, 24, &profile).at(x * (w / 2.0 - 0.1), y * (d / 2.0 - 0.1), 0.0));
        }
    }
    table
}

/// A round side table on one foot.
pub fn side_table(wood: &'static NamedMaterial, height: f64) -> Mesh {
    let top = [
        (0.0, height - 0.03),
        (0.22, height - 0.03),
        (0.235, height - 0.015),
        (0.22, height),
        (0.0, height),
    ];
    Mesh::of([
        crate::shapes::lathe(wood, 48, &top),
        tube(&BRASS, &[DVec3::new(0.0, 0.0, 0.02), DVec3::new(0.0, 0.0, height - 0.02)], 0.014, 16),
        turned(&BRASS, 36, &[(0.0, 0.0), (0.15, 0.0), (0.14, 0.012), (0.02, 0.03)]),
    ])
}

/// A desk against a wall, 0.74 m high, with drawers on one side.
pub fn desk(wood: &'static NamedMaterial, front: &'static NamedMaterial, w: f64) -> Mesh {
    let mut desk = rounded(wood, [w, 0.70, 0.035], 0.012).at(0.0, 0.35, 0.705);
    desk.add(chest(wood, front, 0.42, 0.60, 0.60, 1, 3).at(w / 2.0 - 0.26, 0.04, 0.105));
    for y in [0.08, 0.62] {
        desk.add(tube(
            &STEEL,
            &[DVec3::new(0.1 - w / 2.0, y, 0.0), DVec3::new(0.1 - w / 2.0, y, 0.71)],
            0.018,
            14,
        ));
        desk.add(tube(
            &STEEL,
            &[DVec3::new(w / 2.0 - 0.1, y, 0.0), DVec3::new(w / 2.0 - 0.1, y, 0.11)],
            0.018,
            14,
        ));
    }
    desk
}

/// A cupboard on legs: a `columns` × `rows` front with knobs.
pub fn sideboard(
    wood: &'static NamedMaterial,
    front: &'static NamedMaterial,
    w: f64,
    columns: usize,
    rows: usize,
) -> Mesh {
    let mut board = chest(wood, front, w, 0.42, 0.58, columns, rows).at(0.0, 0.0, 0.18);
    for x in [-1.0, 1.0] {
        for y in [0.06, 0.36] {
            board.add(leg(0.18).at(x * (w / 2.0 - 0.08), y, 0.0));
        }
    }
    board
}

/// A small cupboard beside a bed, 0.5 m high.
pub fn nightstand(wood: &'static NamedMaterial, front: &'static NamedMaterial) -> Mesh {
    let mut stand = chest(wood, front, 0.46, 0.40, 0.36, 1, 2).at(0.0, 0.0, 0.14);
    for x in [-0.19, 0.19] {
        for y in [0.05, 0.35] {
            stand.add(leg(0.14).at(x, y, 0.0));
        }
    }
    stand
}

/// A narrow hallway table, 0.8 m high.
pub fn console(wood: &'static NamedMaterial, w: f64) -> Mesh {
    let mut table = rounded(wood, [w, 0.28, 0.035], 0.012).at(0.0, 0.15, 0.765);
    table.add(rounded(wood, [w - 0.06, 0.24, 0.02], 0.008).at(0.0, 0.15, 0.2));
    for x in [-1.0, 1.0] {
        for y in [0.04, 0.26] {
            let x = x * (w / 2.0 - 0.04);
            table.add(tube(&BRASS, &[DVec3::new(x, y, 0.0), DVec3::new(x, y, 0.77)], 0.012, 12));
        }
    }
    table
}

/// A chest with rounded fronts and a knob on each.
fn chest(
    wood: &'static NamedMaterial,
    front: &'static NamedMaterial,
    w: f64,
    d: f64,
    h: f64,
    columns: usize,
    rows: usize,
) -> Mesh {
    let mut chest = cuboid(wood, [-w / 2.0, 0.0, 0.0], [w / 2.0, d - 0.02, h]);
    let (cw, ch) = ((w - 0.02) / columns as f64, (h - 0.02) / rows as f64);
    for i in 0..columns {
        for j in 0..rows {
            let x = 0.01 - w / 2.0 + (i as f64 + 0.5) * cw;
            let z = 0.01 + j as f64 * ch;
            chest.add(rounded(front, [cw - 0.006, 0.024, ch - 0.006], 0.006).at(
                x,
                d - 0.012,
                z + 0.003,
            ));
            chest.add(ball(&BRASS, 0.014, 14).at(x, d + 0.012, z + ch * 0.6));
        }
    }
    chest
}
