//! Scenes for what the papers show in pictures: a carved object seen from outside, glass with
//! bubbles, and a mirror in a small room (Larson & Simmons 1999, Images 8 to 10 and 12). Metres, +Z
//! up.
//!
//! Invariant: each scene has one section, which its views look into or out of.

use std::fmt::Write as _;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use glam::DVec3;

use crate::material::{
    ALL, AMBER, AQUA, BIRCH, CERAMIC, CORAL, CRYSTAL, CURTAIN_BLUE, LACQUER, MIRROR, MUSTARD,
    NamedMaterial, OAK, OAK_DARK, PANEL, PLASTER, STEEL, TEAL, TILE_FLOOR, TILE_FLOOR_DARK,
    TILE_SEA, TILE_WHITE, WALNUT,
};
use crate::mesh::Mesh;
use crate::obj;
use crate::rooms::Object;
use crate::shapes::{ball, bent, block, cuboid, rectangle, rounded, tube, turned};

/// A scene of a paper.
struct PaperScene {
    name: &'static str,
    objects: fn() -> Vec<Object>,
    /// The rest of its configuration: sky, section and views.
    config: &'static str,
}

const SCENES: [PaperScene; 3] = [
    PaperScene {
        name: "chess",
        objects: chess,
        config: r#"sky = [0.6, 0.65, 0.7]

[[section]]
name = "around the game"
origin = [-0.38, -0.38, -0.03]
axes = [[0.76, 0, 0], [0, 0.76, 0], [0, 0, 0.7]]
exterior = true

[[view]]
name = "game"
vp = [1.15, -0.8, 0.85]
vd = [-1.15, 0.8, -0.6]
vu = [0, 0, 1]
vh = 38
"#,
    },
    PaperScene {
        name: "bubbles",
        objects: bubbles,
        config: r#"sky = [0, 0, 0]

[[section]]
name = "around the glass"
origin = [-0.25, -0.2, 0.72]
axes = [[0.5, 0, 0], [0, 0.4, 0], [0, 0, 0.45]]
exterior = true

[[view]]
name = "glass"
vp = [0.35, -0.75, 1.1]
vd = [-0.35, 0.75, -0.18]
vu = [0, 0, 1]
vh = 34
"#,
    },
    PaperScene {
        name: "mirror",
        objects: mirror,
        config: r#"sky = [0, 0, 0]

[[section]]
name = "before the mirror"
origin = [0.35, 0.3, 1.0]
axes = [[1.75, 0, 0], [0, 1.1, 0], [0, 0, 0.95]]

[[view]]
name = "basin"
vp = [1.85, 0.45, 1.5]
vd = [-0.42, 0.88, -0.05]
vu = [0, 0, 1]
vh = 60

[[view]]
name = "door"
vp = [0.6, 0.6, 1.6]
vd = [0.45, 0.87, -0.1]
vu = [0, 0, 1]
vh = 60
"#,
    },
];

/// Radius and height of the profiles of chess pieces, in units of their heights.
#[rustfmt::skip] // Several points a line.
const PIECES: [&[(f64, f64)]; 4] = [
    // Pawn, rook, bishop, king.
    &[
        (0.0, 0.0), (0.3, 0.0), (0.32, 0.08), (0.22, 0.16), (0.12, 0.35), (0.11, 0.55),
        (0.2, 0.6), (0.12, 0.64), (0.2, 0.74), (0.22, 0.84), (0.15, 0.95), (0.0, 1.0),
    ],
    &[
        (0.0, 0.0), (0.26, 0.0), (0.28, 0.07), (0.2, 0.15), (0.15, 0.4), (0.15, 0.65),
        (0.24, 0.72), (0.24, 0.98), (0.17, 1.0), (0.16, 0.9), (0.0, 0.88),
    ],
    &[
        (0.0, 0.0), (0.22, 0.0), (0.24, 0.06), (0.16, 0.12), (0.08, 0.35), (0.08, 0.58),
        (0.15, 0.62), (0.09, 0.66), (0.14, 0.76), (0.1, 0.88), (0.03, 0.94), (0.04, 0.98),
        (0.0, 1.0),
    ],
    &[
        (0.0, 0.0), (0.2, 0.0), (0.22, 0.05), (0.15, 0.1), (0.08, 0.3), (0.09, 0.55),
        (0.15, 0.6), (0.1, 0.64), (0.15, 0.82), (0.12, 0.86), (0.03, 0.9), (0.04, 0.96),
        (0.0, 1.0),
    ],
];

/// A game of chess on three boards, one above the other, on a table under a lamp.
fn chess() -> Vec<Object> {
    const FIELDS: usize = 5;
    const FIELD: f64 = 0.07;
    let half = FIELDS as f64 * FIELD / 2.0;
    let place = |level: usize, column: usize, row: usize| {
        let middle = |n: usize| (n as f64 + 0.5) * FIELD - half;
        // Each board is a little behind the one below.
        (middle(column), middle(row) + 0.06 * (level as f64 - 1.0), 0.04 + 0.2 * level as f64)
    };
    let mut boards = Mesh::default();
    for level in 0..3 {
        for column in 0..FIELDS {
            for row in 0..FIELDS {
                let wood = if (column + row + level) % 2 == 0 { &BIRCH } else { &WALNUT };
                let (x, y, z) = place(level, column, row);
                boards.add(block(wood, [FIELD - 0.001, FIELD - 0.001, 0.012]).at(x, y, z - 0.012));
            }
        }
    }
    let posts = [-half, half].into_iter().flat_map(|x| {
        let rise = |y: f64| [DVec3::new(x, y, 0.0), DVec3::new(x, y + 0.14, 0.47)];
        [-0.12, 0.0].map(|y| tube(&STEEL, &rise(y), 0.006, 12))
    });
    // Board, column, row and piece; the first half is light.
    #[rustfmt::skip] // By board.
    const GAME: [(usize, usize, usize, usize); 16] = [
        (0, 0, 0, 1), (0, 1, 1, 0), (0, 3, 0, 2), (0, 4, 1, 0), (1, 0, 1, 0), (1, 2, 0, 3),
        (1, 3, 1, 0), (2, 1, 0, 2), (0, 1, 4, 2), (0, 3, 3, 0), (1, 1, 3, 0), (1, 4, 4, 1),
        (2, 0, 3, 0), (2, 2, 4, 3), (2, 3, 2, 0), (2, 4, 3, 1),
    ];
    let pieces = GAME.iter().enumerate().map(|(number, &(level, column, row, piece))| {
        let wood = if number < GAME.len() / 2 { &BIRCH } else { &OAK_DARK };
        let height = [0.055, 0.065, 0.085, 0.11][piece];
        let (x, y, z) = place(level, column, row);
        turned(wood, 14, PIECES[piece]).scaled(height, height, height).at(x, y, z)
    });
    vec![
        object("boards", boards),
        object("posts", Mesh::of(posts)),
        object("pieces", Mesh::of(pieces)),
        object("table", cuboid(&LACQUER, [-0.37, -0.37, -0.02], [0.37, 0.37, 0.0])),
        object("lamp", lamp([-0.3, -0.6, 1.9], 0.6)),
    ]
}

/// A block of glass with bubbles, a bent rod and a coloured ball inside, on a table in a room.
fn bubbles() -> Vec<Object> {
    let mut glass = rounded(&CRYSTAL, [0.26, 0.14, 0.3], 0.03);
    #[rustfmt::skip] // Three a line.
    let holes: [([f64; 3], f64); 9] = [
        ([-0.08, 0.0, 0.08], 0.025), ([-0.03, 0.03, 0.14], 0.016), ([0.06, -0.02, 0.07], 0.03),
        ([0.09, 0.02, 0.17], 0.012), ([-0.09, -0.02, 0.2], 0.018), ([0.02, 0.0, 0.23], 0.028),
        ([0.08, -0.03, 0.24], 0.01), ([-0.05, 0.01, 0.26], 0.008), ([0.0, -0.04, 0.1], 0.009),
    ];
    for ([x, y, z], radius) in holes {
        // A surface of the glass that faces inwards is a hole.
        glass.add(ball(&CRYSTAL, radius, 40).at(x, y, z).inside_out());
    }
    let through = [[-0.1, 0.0, 0.03], [0.0, 0.04, 0.1], [0.03, -0.03, 0.18], [-0.06, 0.0, 0.27]];
    let inside = Mesh::of([
        bent(&CORAL, &through, 0.008),
        ball(&AMBER, 0.022, 32).at(0.07, 0.02, 0.12),
        ball(&MUSTARD, 0.012, 24).at(-0.02, 0.03, 0.2),
    ]);
    let stand = |mesh: Mesh| mesh.turned(-12.0).at(0.0, 0.0, 0.75);
    let mut room = shell([-1.5, -1.5, 0.0], [1.5, 1.5, 2.5], &OAK, [&PLASTER, &TEAL, &CORAL]);
    room.add(lamp([-0.4, -0.9, 2.499], 0.8));
    room.add(lamp([-1.3, 0.6, 2.499], 0.5));
    vec![
        object("glass", stand(glass)),
        object("inside the glass", stand(inside)),
        object("table", cuboid(&WALNUT, [-0.6, -0.5, 0.71], [0.6, 0.5, 0.75])),
        object("room", room),
    ]
}

/// A small tiled room with a mirror over a basin.
fn mirror() -> Vec<Object> {
    const WIDTH: f64 = 2.4;
    const DEPTH: f64 = 2.0;
    const HEIGHT: f64 = 2.4;
    let mut room = shell(
        [0.0, 0.0, 0.0],
        [WIDTH, DEPTH, HEIGHT],
        &TILE_FLOOR,
        [&PLASTER, &TILE_WHITE, &TILE_SEA],
    );
    // Tiles stand out by 2 mm, in rows around the room.
    for number in 0..12 {
        let at = 0.2 * f64::from(number);
        for row in 0..6 {
            let z = 0.1 + 0.4 * f64::from(row);
            let tile = if (number + row) % 2 == 0 { &TILE_SEA } else { &LACQUER };
            let (side, up) = (0.16, [0.0, 0.0, 0.16]);
            room.add(rectangle(tile, [at + 0.02, 0.002, z], up, [side, 0.0, 0.0]));
            if at + 0.18 < DEPTH {
                room.add(rectangle(tile, [0.002, at + 0.02, z], [0.0, side, 0.0], up));
            }
        }
        for row in 0..10 {
            let tile = if (number + row) % 2 == 0 { &TILE_FLOOR } else { &TILE_FLOOR_DARK };
            let y = 0.2 * f64::from(row);
            room.add(rectangle(tile, [at, y, 0.002], [0.2, 0.0, 0.0], [0.0, 0.2, 0.0]));
        }
    }
    room.add(lamp([0.8, 0.5, HEIGHT - 0.001], 0.8));
    // `scripts/bench.d/papers.py` knows the corners of the glass.
    let glass = rectangle(&MIRROR, [0.5, 1.98, 1.0], [1.4, 0.0, 0.0], [0.0, 0.0, 0.9]);
    let backing = cuboid(&OAK_DARK, [0.47, 1.981, 0.97], [1.93, 1.999, 1.93]);
    let basin = rounded(&CERAMIC, [0.6, 0.4, 0.14], 0.05).at(1.2, 1.75, 0.78);
    let foot = block(&CERAMIC, [0.16, 0.16, 0.78]).at(1.2, 1.8, 0.0);
    let small = Mesh::of([
        ball(&AQUA, 0.05, 24).at(0.98, 1.7, 0.97),
        block(&CORAL, [0.05, 0.05, 0.18]).at(1.42, 1.72, 0.92),
        bent(&STEEL, &[[1.2, 1.9, 0.92], [1.2, 1.88, 1.06], [1.2, 1.74, 1.02]], 0.012),
    ]);
    let towels = Mesh::of([
        cuboid(&CURTAIN_BLUE, [0.4, 0.004, 0.9], [0.8, 0.04, 1.6]),
        cuboid(&MUSTARD, [1.1, 0.004, 1.0], [1.4, 0.04, 1.5]),
        cuboid(&CORAL, [1.7, 0.004, 0.8], [2.0, 0.04, 1.7]),
    ]);
    vec![
        object("room", room),
        object("mirror", glass),
        object("frame", backing),
        object("basin", Mesh::of([basin, foot, small])),
        object("towels", towels),
    ]
}

fn object(name: &'static str, mesh: Mesh) -> Object {
    Object { name, mesh }
}

/// Returns a lamp of a side, which shines down, with its lowest corner here.
fn lamp([x, y, z]: [f64; 3], side: f64) -> Mesh {
    rectangle(&PANEL, [x, y, z], [0.0, side, 0.0], [side, 0.0, 0.0])
}

/// Returns a room's floor, ceiling and walls, which face inwards: the materials of ceiling and
/// walls along x, along -x and along both directions of y.
fn shell(
    [x0, y0, z0]: [f64; 3],
    [x1, y1, z1]: [f64; 3],
    floor: &'static NamedMaterial,
    [ceiling, ends, sides]: [&'static NamedMaterial; 3],
) -> Mesh {
    let (w, d, h) = (x1 - x0, y1 - y0, z1 - z0);
    Mesh::of([
        rectangle(floor, [x0, y0, z0], [w, 0.0, 0.0], [0.0, d, 0.0]),
        rectangle(ceiling, [x0, y0, z1], [0.0, d, 0.0], [w, 0.0, 0.0]),
        rectangle(ends, [x0, y0, z0], [0.0, d, 0.0], [0.0, 0.0, h]),
        rectangle(ends, [x1, y0, z0], [0.0, 0.0, h], [0.0, d, 0.0]),
        rectangle(sides, [x0, y0, z0], [0.0, 0.0, h], [w, 0.0, 0.0]),
        rectangle(sides, [x0, y1, z0], [w, 0.0, 0.0], [0.0, 0.0, h]),
    ])
}

/// Writes all scenes as NAME.obj and NAME.toml into `dir`, which is created if it does not exist,
/// with the library `papers.mtl`. Returns the paths of the configurations.
///
/// # Errors
/// Those of the file system.
pub fn write_papers(dir: &Path) -> io::Result<Vec<PathBuf>> {
    fs::create_dir_all(dir)?;
    let library: Vec<_> = ALL.iter().map(|material| material.to_string()).collect();
    fs::write(dir.join("papers.mtl"), library.join("\n"))?;
    let write = |PaperScene { name, objects, config }: &PaperScene| {
        fs::write(dir.join(format!("{name}.obj")), obj::write(&objects(), "papers.mtl"))?;
        let mut text = format!("# For `holodeck --config`.\nscene = \"{name}.obj\"\n");
        let _ = write!(text, "up = [0, 0, 1]\nunit = 1.0\ntwo_sided_lights = false\n{config}");
        let path = dir.join(format!("{name}.toml"));
        fs::write(&path, text).map(|()| path)
    };
    SCENES.iter().map(write).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use holo_scene::{LoadOptions, load};

    /// Returns the volume that the faces of a material enclose, positive if they face outwards.
    fn volume(objects: &[Object], material: &NamedMaterial) -> f64 {
        let triangles = objects.iter().flat_map(|object| object.mesh.triangles());
        triangles
            .filter(|(_, of)| of.name == material.name)
            .map(|([a, b, c], _)| a.dot(b.cross(c)) / 6.0)
            .sum()
    }

    #[test]
    fn the_scenes_load_without_complaint_and_have_the_same_bytes_each_time() {
        let dirs = [(); 2].map(|()| tempfile::tempdir().unwrap());
        let written = dirs.each_ref().map(|dir| write_papers(dir.path()).unwrap());
        for (one, other) in written[0].iter().zip(&written[1]) {
            for extension in ["toml", "obj"] {
                let read = |path: &PathBuf| fs::read(path.with_extension(extension)).unwrap();
                assert_eq!(read(one), read(other), "{}", one.display());
            }
            let loaded = load(&one.with_extension("obj"), &LoadOptions::default()).unwrap();
            assert!(loaded.warnings.is_empty(), "{}: {:?}", one.display(), loaded.warnings);
        }
    }

    #[test]
    fn the_carved_object_has_about_ten_thousand_triangles() {
        let count: usize = chess().iter().map(|object| object.mesh.faces.len()).sum();
        assert!((8_000..=12_000).contains(&count), "{count}");
    }

    #[test]
    fn bubbles_take_their_volume_out_of_the_glass() {
        let objects = bubbles();
        let bubbles: f64 = [0.025, 0.016, 0.03, 0.012, 0.018, 0.028, 0.01, 0.008, 0.009]
            .map(|radius: f64| 4.0 / 3.0 * std::f64::consts::PI * radius.powi(3))
            .iter()
            .sum();
        let full: f64 =
            volume(&[object("block", rounded(&CRYSTAL, [0.26, 0.14, 0.3], 0.03))], &CRYSTAL);
        let found = full - volume(&objects, &CRYSTAL);
        // A ball of 40 segments lacks a little of its volume.
        assert!((0.97 * bubbles..bubbles).contains(&found), "{found} of {bubbles}");
    }
}
