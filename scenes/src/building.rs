//! The building: rooms, walls with openings, floors, windows and doors.
//!
//! Invariant: walls, floor and ceiling are solids that meet without gaps, so light enters only
//! through windows. They do not intrude into the space of a [`RoomSpace`].

use crate::material::{
    BRASS, CEILING, FACADE, GROUT, LACQUER, NamedMaterial, OAK, OAK_DARK, OAK_LIGHT, TRIM, WINDOW,
};
use crate::mesh::Mesh;
use crate::random::SeededRandom;
use crate::shapes::{ball, cuboid, rectangle, rounded};

/// Height of the rooms from floor to ceiling.
pub const HEIGHT: f64 = 2.7;
/// Thickness of the outer walls, the floor slab and the ceiling slab.
pub const OUTER: f64 = 0.3;

/// The space of a room between its walls.
#[derive(Debug)]
pub struct RoomSpace {
    /// Its name.
    pub name: &'static str,
    /// Extent from west to east.
    pub x: (f64, f64),
    /// Extent from south to north.
    pub y: (f64, f64),
}

pub static LIVING: RoomSpace = RoomSpace { name: "living room", x: (0.0, 6.0), y: (0.0, 5.0) };
pub static KITCHEN: RoomSpace = RoomSpace { name: "kitchen", x: (6.15, 11.15), y: (0.0, 5.0) };
pub static HALL: RoomSpace = RoomSpace { name: "hallway", x: (0.0, 11.15), y: (5.15, 6.55) };
pub static BEDROOM: RoomSpace = RoomSpace { name: "bedroom", x: (0.0, 5.0), y: (6.7, 10.7) };
pub static BATH: RoomSpace = RoomSpace { name: "bathroom", x: (5.15, 8.15), y: (6.7, 10.7) };
pub static STUDY: RoomSpace = RoomSpace { name: "study", x: (8.3, 11.15), y: (6.7, 10.7) };
/// All rooms.
pub static ROOMS: [&RoomSpace; 6] = [&LIVING, &KITCHEN, &HALL, &BEDROOM, &BATH, &STUDY];

/// The wall of a room against which something stands.
#[derive(Clone, Copy)]
pub enum WallSide {
    South,
    North,
    West,
    East,
}

impl RoomSpace {
    /// Places `thing`, modelled with its back at y = 0, against a wall at coordinate `along` it,
    /// facing the room.
    pub fn against(&self, side: WallSide, along: f64, thing: Mesh) -> Mesh {
        match side {
            WallSide::South => thing.at(along, self.y.0, 0.0),
            WallSide::North => thing.turned(180.0).at(along, self.y.1, 0.0),
            WallSide::West => thing.turned(-90.0).at(self.x.0, along, 0.0),
            WallSide::East => thing.turned(90.0).at(self.x.1, along, 0.0),
        }
    }

    /// Places `thing`, modelled to hang from z = 0, under the ceiling.
    pub fn hung(&self, x: f64, y: f64, thing: Mesh) -> Mesh {
        thing.at(x, y, HEIGHT)
    }

    fn panels(&self) -> [f64; 4] {
        [self.x.0, self.y.0, self.x.1, self.y.1]
    }
}

/// A hole in a wall, by coordinate along the wall and by height. It is a door if it reaches the
/// floor, otherwise a window.
#[derive(Clone, Copy)]
pub struct WallOpening {
    pub from: f64,
    pub to: f64,
    pub sill: f64,
    pub head: f64,
}

const fn door(from: f64) -> WallOpening {
    WallOpening { from, to: from + 0.9, sill: 0.0, head: 2.1 }
}

const fn window(from: f64, to: f64, sill: f64, head: f64) -> WallOpening {
    WallOpening { from, to, sill, head }
}

/// A straight wall between `near` and `far` across it. `faces` are the materials of its two sides,
/// the side of the lower coordinate first.
struct Wall<'a> {
    along_x: bool,
    from: f64,
    to: f64,
    near: f64,
    far: f64,
    faces: [&'static NamedMaterial; 2],
    openings: &'a [WallOpening],
}

impl Wall<'_> {
    /// Returns a box, given along the wall, across it, and in height.
    fn solid(
        &self,
        material: &'static NamedMaterial,
        along: (f64, f64),
        across: (f64, f64),
        z: (f64, f64),
    ) -> Mesh {
        if self.along_x {
            cuboid(material, [along.0, across.0, z.0], [along.1, across.1, z.1])
        } else {
            cuboid(material, [across.0, along.0, z.0], [across.1, along.1, z.1])
        }
    }

    /// Returns a piece of the wall. Its sides have the colours of the adjacent rooms, and a
    /// skirting board if the piece stands on the floor.
    fn piece(&self, along: (f64, f64), z: (f64, f64)) -> Mesh {
        let mut piece = self.solid(&TRIM, along, (self.near, self.far), z);
        // The faces of a cuboid come in pairs of triangles: -z +z -y +y -x +x.
        let first = if self.along_x { 4 } else { 8 };
        for (face, material) in
            piece.faces[first..first + 4].iter_mut().zip([0, 0, 1, 1].map(|side| self.faces[side]))
        {
            face.material = material;
        }
        if z.0 == 0.0 {
            for (face, across) in
                [(0, (self.near - 0.012, self.near)), (1, (self.far, self.far + 0.012))]
            {
                if !std::ptr::eq(self.faces[face], &FACADE) {
                    piece.add(self.solid(&TRIM, along, across, (0.0, 0.08)));
                }
            }
        }
        piece
    }

    fn build(&self) -> Mesh {
        let mut wall = Mesh::default();
        let mut at = self.from;
        for hole in self.openings {
            let along = (hole.from, hole.to);
            wall.add(self.piece((at, hole.from), (0.0, HEIGHT)));
            wall.add(self.piece(along, (hole.head, HEIGHT)));
            if hole.sill > 0.0 {
                wall.add(self.piece(along, (0.0, hole.sill)));
                wall.add(self.window(hole));
            } else {
                wall.add(self.solid(&OAK_DARK, along, (self.near, self.far), (-0.02, 0.004)));
                wall.add(self.casing(hole));
            }
            at = hole.to;
        }
        wall.add(self.piece((at, self.to), (0.0, HEIGHT)));
        wall
    }

    /// Returns boards around a door, on both sides of the wall.
    fn casing(&self, hole: &WallOpening) -> Mesh {
        let (wide, proud) = (0.07, 0.018);
        Mesh::of(
            [(self.near - proud, self.near), (self.far, self.far + proud)].into_iter().flat_map(
                |across| {
                    [
                        self.solid(&TRIM, (hole.from - wide, hole.from), across, (0.0, hole.head)),
                        self.solid(&TRIM, (hole.to, hole.to + wide), across, (0.0, hole.head)),
                        self.solid(
                            &TRIM,
                            (hole.from - wide, hole.to + wide),
                            across,
                            (hole.head, hole.head + wide),
                        ),
                    ]
                },
            ),
        )
    }

    /// Returns a frame with mullions, one pane of glass in the middle of the wall, and a sill on
    /// each side.
    fn window(&self, hole: &WallOpening) -> Mesh {
        let middle = (self.near + self.far) / 2.0;
        let (across, bar) = ((middle - 0.03, middle + 0.03), 0.05);
        let lights = ((hole.to - hole.from) / 1.1).round().max(1.0) as usize;
        let pitch = (hole.to - hole.from) / lights as f64;
        let mut window = Mesh::default();
        for z in [hole.sill, hole.head - bar] {
            window.add(self.solid(&TRIM, (hole.from, hole.to), across, (z, z + bar)));
        }
        for i in 0..=lights {
            let at = hole.from + i as f64 * pitch;
            let along = ((at - bar / 2.0).max(hole.from), (at + bar / 2.0).min(hole.to));
            window.add(self.solid(&TRIM, along, across, (hole.sill + bar, hole.head - bar)));
        }
        window.add(self.solid(
            &TRIM,
            (hole.from - 0.04, hole.to + 0.04),
            (self.near - 0.03, self.far + 0.03),
            (hole.sill - 0.025, hole.sill + 0.006),
        ));
        let (long, high) = (hole.to - hole.from, hole.head - hole.sill);
        window.add(if self.along_x {
            rectangle(&WINDOW, [hole.from, middle, hole.sill], [long, 0.0, 0.0], [0.0, 0.0, high])
        } else {
            rectangle(&WINDOW, [middle, hole.from, hole.sill], [0.0, long, 0.0], [0.0, 0.0, high])
        });
        window
    }
}

/// Returns walls, slabs, windows and casings: everything that bounds the rooms.
pub fn shell(paint: impl Fn(&RoomSpace) -> &'static NamedMaterial) -> Mesh {
    let [living, kitchen, hall, bedroom, bath, study] = ROOMS.map(&paint);
    let (west, east, south, north) = (-OUTER, 11.15 + OUTER, -OUTER, 10.7 + OUTER);
    let wall = |along_x, span: (f64, f64), across: (f64, f64), faces, openings| {
        Wall { along_x, from: span.0, to: span.1, near: across.0, far: across.1, faces, openings }
            .build()
    };
    let mut shell = Mesh::of([
        cuboid(&CEILING, [west, south, HEIGHT], [east, north, HEIGHT + OUTER]),
        cuboid(&GROUT, [west, south, -0.02 - OUTER], [east, north, -0.02]),
        // Walls from west to east, south and north of the hallway.
        wall(
            true,
            (west, 6.075),
            (-OUTER, 0.0),
            [&FACADE, living],
            &[window(0.8, 5.2, 0.35, 2.4)][..],
        ),
        wall(
            true,
            (6.075, east),
            (-OUTER, 0.0),
            [&FACADE, kitchen],
            &[window(7.1, 9.7, 0.95, 2.3)],
        ),
        wall(true, (0.0, 6.075), (5.0, 5.15), [living, hall], &[door(4.85)]),
        wall(true, (6.075, 11.15), (5.0, 5.15), [kitchen, hall], &[door(9.3)]),
        wall(true, (0.0, 5.075), (6.55, 6.7), [hall, bedroom], &[door(3.35)]),
        wall(true, (5.075, 8.225), (6.55, 6.7), [hall, bath], &[door(7.0)]),
        wall(true, (8.225, 11.15), (6.55, 6.7), [hall, study], &[door(9.3)]),
        wall(
            true,
            (west, 5.075),
            (10.7, 10.7 + OUTER),
            [bedroom, &FACADE],
            &[window(1.1, 3.9, 0.8, 2.3)],
        ),
        wall(
            true,
            (5.075, 8.225),
            (10.7, 10.7 + OUTER),
            [bath, &FACADE],
            &[window(6.9, 7.7, 1.5, 2.2)],
        ),
        wall(
            true,
            (8.225, east),
            (10.7, 10.7 + OUTER),
            [study, &FACADE],
            &[window(9.0, 10.7, 0.95, 2.3)],
        ),
        // Walls from south to north.
        wall(false, (0.0, 5.0), (west, 0.0), [&FACADE, living], &[]),
        wall(false, (5.0, 6.7), (west, 0.0), [&FACADE, hall], &[]),
        wall(false, (6.7, 10.7), (west, 0.0), [&FACADE, bedroom], &[]),
        wall(
            false,
            (0.0, 5.0),
            (6.0, 6.15),
            [living, kitchen],
            &[WallOpening { from: 1.2, to: 3.7, sill: 0.0, head: 2.35 }],
        ),
        wall(false, (6.7, 10.7), (5.0, 5.15), [bedroom, bath], &[]),
        wall(false, (6.7, 10.7), (8.15, 8.3), [bath, study], &[]),
        wall(false, (0.0, 5.0), (11.15, east), [kitchen, &FACADE], &[]),
        wall(false, (5.0, 6.7), (11.15, east), [hall, &FACADE], &[]),
        wall(false, (6.7, 10.7), (11.15, east), [study, &FACADE], &[window(7.6, 9.2, 0.95, 2.3)]),
    ]);
    for room in [&LIVING, &BEDROOM, &HALL, &STUDY] {
        shell.add(planks(room));
    }
    shell
}

/// Returns a floor of separate boards along x, 2 cm thick.
fn planks(room: &RoomSpace) -> Mesh {
    let [x0, y0, x1, y1] = room.panels();
    let (wide, gap) = (0.16, 0.0015);
    let random = &mut SeededRandom::new((x0 * 100.0 + y0 * 10_000.0) as u64);
    let mut floor = Mesh::default();
    let rows = ((y1 - y0) / wide).ceil() as usize;
    for row in 0..rows {
        let y = y0 + row as f64 * wide;
        let mut x = x0 - random.range(0.0, 1.8);
        while x < x1 {
            let long = random.range(1.6, 2.4);
            let board = random.pick(&[&OAK, &OAK, &OAK_LIGHT, &OAK_DARK]);
            let (from, to) = (x.max(x0), (x + long - gap).min(x1));
            if to - from > 0.01 {
                floor.add(cuboid(board, [from, y, -0.02], [to, (y + wide - gap).min(y1), 0.0]));
            }
            x += long;
        }
    }
    floor
}

/// Returns a floor of square tiles, 2 cm thick, of which every fourth has the second colour.
pub fn tiled_floor(
    room: &RoomSpace,
    tile: &'static NamedMaterial,
    second: &'static NamedMaterial,
    size: f64,
) -> Mesh {
    let [x0, y0, x1, y1] = room.panels();
    let (columns, rows) =
        (((x1 - x0) / size).round() as usize, ((y1 - y0) / size).round() as usize);
    let (w, d) = ((x1 - x0) / columns as f64, (y1 - y0) / rows as f64);
    let mut floor = Mesh::default();
    for i in 0..columns {
        for j in 0..rows {
            let (x, y) = (x0 + i as f64 * w, y0 + j as f64 * d);
            let colour = if i % 2 == 1 && j % 2 == 1 { second } else { tile };
            floor.add(cuboid(
                colour,
                [x + 0.0015, y + 0.0015, -0.02],
                [x + w - 0.0015, y + d - 0.0015, 0.0],
            ));
        }
    }
    floor
}

/// Returns the leaf of a door, 0.88 m wide, hinged at the origin, along +x, with handles.
pub fn leaf() -> Mesh {
    let mut leaf = rounded(&LACQUER, [0.88, 0.04, 2.07], 0.006).at(0.44, 0.0, 0.012);
    for side in [-1.0, 1.0] {
        for (z, h) in [(0.2, 0.75), (1.1, 0.8)] {
            leaf.add(rounded(&TRIM, [0.62, 0.012, h], 0.005).at(0.44, side * 0.02, z));
        }
        leaf.add(ball(&BRASS, 0.024, 18).at(0.82, side * 0.055, 1.02));
        leaf.add(rounded(&BRASS, [0.012, 0.05, 0.012], 0.004).at(0.82, side * 0.035, 1.014));
    }
    leaf
}
