//! Shelves, books and the things between them.

use super::decor::{bowl, vase};
use crate::material::{AQUA, BOOKS, CERAMIC_BLUE, COPPER, NamedMaterial, PAPER};
use crate::mesh::Mesh;
use crate::random::SeededRandom;
use crate::shapes::{cuboid, rectangle, sheet};
use glam::DVec3;

/// Depth of a bookcase.
const DEPTH: f64 = 0.32;
const BOARD: f64 = 0.022;

/// A filled bookcase of `columns` × `rows` compartments; 0.36 m per row.
pub fn bookcase(
    wood: &'static NamedMaterial,
    w: f64,
    columns: usize,
    rows: usize,
    seed: u64,
) -> Mesh {
    let random = &mut SeededRandom::new(seed);
    let (pitch, step) = ((w - BOARD) / columns as f64, 0.36);
    let h = 0.08 + rows as f64 * step + BOARD;
    let mut case = cuboid(wood, [-w / 2.0, 0.0, 0.0], [w / 2.0, 0.012, h]);
    for i in 0..=columns {
        let x = -w / 2.0 + i as f64 * pitch;
        case.add(cuboid(wood, [x, 0.012, 0.0], [x + BOARD, DEPTH, h]));
    }
    for i in 0..columns {
        let x0 = -w / 2.0 + i as f64 * pitch + BOARD;
        let x1 = x0 + pitch - BOARD;
        case.add(cuboid(wood, [x0, 0.012, 0.0], [x1, DEPTH - 0.03, 0.08]));
        for j in 0..=rows {
            let z = 0.08 + j as f64 * step;
            case.add(cuboid(wood, [x0, 0.012, z], [x1, DEPTH - 0.004, z + BOARD]));
            if j < rows {
                case.add(compartment(x1 - x0, step - BOARD, random).at(x0, 0.0, z + BOARD));
            }
        }
    }
    case
}

/// The contents of a compartment from x = 0 to `w`: books, and sometimes a thing at the end.
fn compartment(w: f64, h: f64, random: &mut SeededRandom) -> Mesh {
    let mut filled = Mesh::default();
    let mut end = w;
    let kind = random.unit();
    if kind < 0.25 {
        end -= 0.24;
        let thing = if kind < 0.08 {
            vase(&CERAMIC_BLUE).scaled(0.8, 0.8, 0.8)
        } else if kind < 0.16 {
            bowl(&COPPER, 0.09)
        } else {
            vase(&AQUA).scaled(0.7, 0.7, 0.8)
        };
        filled.add(thing.at(w - 0.12, 0.17, 0.0));
    } else if kind < 0.5 {
        end -= 0.28;
        filled.add(pile(4, random).at(w - 0.14, 0.17, 0.0));
    }
    let mut x = 0.003;
    loop {
        let thick = random.range(0.016, 0.046);
        if x + thick > end - 0.02 {
            return filled;
        }
        // Some books lean a little, and their neighbours leave room.
        let lean: f64 = if random.unit() < 0.06 { random.range(3.0, 7.0) } else { 0.0 };
        let height = random.range(0.6, 0.92) * h;
        let room = thick + height * lean.to_radians().sin();
        if x + room < end - 0.02 {
            let upright = standing_book(thick, random.range(0.14, 0.2), height, random);
            let tipped = upright.transformed(glam::DAffine3::from_rotation_y(lean.to_radians()));
            let lift = thick * lean.to_radians().sin();
            filled.add(tipped.at(x, random.range(0.07, 0.1), lift));
        }
        x += room + random.range(0.0005, 0.002);
    }
}

/// A book with a round spine towards +y, its lower left edge on the y axis.
fn standing_book(thick: f64, deep: f64, high: f64, random: &mut SeededRandom) -> Mesh {
    let cover = random.pick(BOOKS);
    let spine = |u: f64, v: f64| {
        let angle = std::f64::consts::PI * u;
        DVec3::new(thick * (0.5 + 0.5 * angle.cos()), deep + 0.006 * angle.sin(), high * v)
    };
    Mesh::of([
        cuboid(cover, [0.0, 0.0, 0.0], [thick, deep, high]),
        // The pages, seen from above.
        rectangle(
            &PAPER,
            [0.002, 0.002, high + 0.0003],
            [thick - 0.004, 0.0, 0.0],
            [0.0, deep - 0.004, 0.0],
        ),
        sheet(cover, 5, 1, spine),
    ])
}

/// A pile of lying books.
pub fn pile(books: usize, random: &mut SeededRandom) -> Mesh {
    let mut pile = Mesh::default();
    let mut z = 0.0;
    for _ in 0..books {
        let thick = random.range(0.018, 0.036);
        let book = standing_book(thick, random.range(0.15, 0.18), random.range(0.20, 0.24), random);
        // Laid on its side: its thickness becomes its height.
        let lying = book.transformed(glam::DAffine3::from_rotation_y(std::f64::consts::FRAC_PI_2));
        let settled = lying.at(-0.11, -0.08, thick).turned(random.range(-9.0, 9.0));
        pile.add(settled.at(0.0, 0.0, z));
        z += thick;
    }
    pile
}
