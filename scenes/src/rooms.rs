//! The furnished rooms.
//!
//! Invariant: the middle of every room, from about one metre up, is free, because the sections of
//! the holodeck lie there.

use crate::building::{
    self, BATH, BEDROOM, HALL, KITCHEN, LIVING, RoomSpace, STUDY, WallSide, leaf, tiled_floor,
};
use crate::furniture::bath::{heated_rail, rolled_towels, towel, tub, vanity, water_closet};
use crate::furniture::bed::{bed, wardrobe};
use crate::furniture::decor::{
    bottle, bowl, curtains, fruit, globe, mirror, picture, place_setting, round_mirror, rug, vase,
};
use crate::furniture::kitchen::{refrigerator, run, tiles};
use crate::furniture::lamp::{
    bell, candle, ceiling_disc, desk_lamp, downlight, floor_lamp, garland, panel, pendant, raft,
    sconce, table_lamp,
};
use crate::furniture::plant::{broadleaf, palm, tree};
use crate::furniture::seat::{armchair, chair, desk_chair, sofa, stool};
use crate::furniture::shelf::{bookcase, pile};
use crate::furniture::table::{
    coffee_table, console, desk, dining_table, nightstand, side_table, sideboard,
};
use crate::garden::garden;
use crate::material::*;
use crate::mesh::Mesh;
use crate::random::SeededRandom;
use crate::shapes::rounded;

/// A named part of the scene.
pub struct Object {
    /// Its name in the OBJ file.
    pub name: &'static str,
    /// Its surfaces.
    pub mesh: Mesh,
}

/// The name of the object that holds walls, floors, ceilings and windows.
pub const SHELL: &str = "shell";

/// Returns the whole interior.
pub fn interior() -> Vec<Object> {
    let shell = building::shell(|room| match room.name {
        "living room" => &WALL_WARM,
        "kitchen" => &PLASTER,
        "hallway" => &PLASTER,
        "bedroom" => &WALL_BLUE,
        "study" => &WALL_SAGE,
        _ => &TILE_WHITE,
    });
    [
        (SHELL, shell),
        ("garden", garden()),
        ("living_room", Mesh::of(living())),
        ("kitchen", Mesh::of(kitchen())),
        ("hallway", Mesh::of(hallway())),
        ("bedroom", Mesh::of(bedroom())),
        ("bathroom", Mesh::of(bathroom())),
        ("study", Mesh::of(study())),
    ]
    .map(|(name, mesh)| Object { name, mesh })
    .into()
}

/// Returns a grid of downlights between two corners.
fn downlights(room: &RoomSpace, x: &[f64], y: &[f64]) -> Mesh {
    Mesh::of(x.iter().flat_map(|&x| y.iter().map(move |&y| room.hung(x, y, downlight()))))
}

fn living() -> Vec<Mesh> {
    let room = &LIVING;
    let hang = |side, along, z, thing: Mesh| room.against(side, along, thing.at(0.0, 0.0, z));
    let random = &mut SeededRandom::new(11);
    vec![
        rug(&RUG, &RUG_NAVY, 3.4, 2.6).at(2.7, 2.5, 0.0),
        room.against(WallSide::North, 2.7, sofa(&FABRIC, 3, &[&MUSTARD, &TEAL, &CORAL])),
        coffee_table(&WALNUT).at(2.7, 2.75, 0.012),
        pile(3, random).turned(15.0).at(2.4, 2.65, 0.432),
        vase(&AQUA).at(2.95, 2.85, 0.432),
        bowl(&BRASS, 0.12).at(2.75, 2.55, 0.432),
        armchair(&LEATHER, &LINEN).turned(-18.0).at(1.75, 1.15, 0.012),
        armchair(&TEAL, &MUSTARD).turned(20.0).at(3.75, 1.15, 0.012),
        side_table(&WALNUT, 0.5).at(4.55, 4.45, 0.0),
        table_lamp(&CERAMIC_BLUE).at(4.55, 4.45, 0.5),
        floor_lamp().at(0.75, 4.6, 0.0),
        room.against(WallSide::West, 2.55, bookcase(&WALNUT, 2.9, 4, 6, 5)),
        palm(1.75, 11, 3).at(5.5, 0.55, 0.0),
        broadleaf(0.85, 34, 8).at(0.42, 0.45, 0.0),
        hang(WallSide::North, 2.7, 1.18, mirror(&BRASS, 1.9, 1.0)),
        hang(WallSide::East, 4.4, 1.15, picture(&INK, 0.85, 1.05, 21)),
        hang(WallSide::East, 0.58, 1.30, picture(&OAK, 0.6, 0.8, 22)),
        hang(WallSide::North, 0.85, 1.75, sconce()),
        hang(WallSide::North, 4.4, 1.75, sconce()),
        room.against(WallSide::South, 3.0, curtains(&CURTAIN, 4.6, 2.52, 0.16)),
        room.hung(2.7, 2.5, raft(&STRIP, 3.0, 2.2)),
        downlights(room, &[0.7, 5.3], &[0.9, 2.5, 4.1]),
        downlights(room, &[2.1, 3.3], &[2.1, 2.9]).at(0.0, 0.0, -0.17),
    ]
}

fn kitchen() -> Vec<Mesh> {
    let room = &KITCHEN;
    let hang = |side, along, z, thing: Mesh| room.against(side, along, thing.at(0.0, 0.0, z));
    let (x, y) = (8.1, 2.35);
    let mut parts = vec![
        tiled_floor(room, &TILE_FLOOR, &TILE_FLOOR_DARK, 0.5),
        room.against(WallSide::East, 2.15, run(3.9)),
        room.against(WallSide::East, 4.5, refrigerator()),
        dining_table(&OAK_DARK, 1.0, 2.2).at(x, y, 0.0),
        fruit(&CERAMIC).at(x, y, 0.75),
        candle().at(x - 0.05, y - 0.45, 0.75),
        candle().at(x + 0.07, y - 0.35, 0.75),
        candle().at(x, y + 0.42, 0.75),
        bottle().scaled(0.75, 0.75, 0.75).at(x + 0.12, y + 0.32, 0.75),
        room.against(WallSide::North, 7.5, sideboard(&WALNUT, &LACQUER, 1.9, 4, 1)),
        vase(&CERAMIC_BLUE).at(6.8, 4.78, 0.76),
        bottle().at(7.95, 4.80, 0.76),
        bottle().at(8.06, 4.74, 0.76),
        bowl(&COPPER, 0.15).at(7.4, 4.78, 0.76),
        hang(WallSide::North, 7.5, 1.25, picture(&INK, 1.4, 0.9, 31)),
        hang(WallSide::West, 4.4, 1.2, picture(&BRASS, 0.7, 0.9, 32)),
        room.against(WallSide::South, 8.4, curtains(&CURTAIN, 2.8, 2.45, 0.15)),
        tree(1.9, 0.48, 300, 6).at(6.72, 0.62, 0.0),
        broadleaf(0.5, 22, 9).scaled(0.6, 0.6, 0.6).at(10.85, 0.5, 0.9),
        stool(&BIRCH).at(10.2, 0.9, 0.0),
        stool(&BIRCH).turned(30.0).at(10.15, 1.5, 0.0),
        downlights(room, &[6.8, 10.0], &[0.9, 2.4, 3.9]),
        room.hung(8.1, 4.2, panel(1.2, 0.3)),
    ];
    for along in [-0.7, 0.0, 0.7] {
        parts.push(room.hung(x, y + along, bell(&COPPER, 0.92)));
        for side in [-1.0, 1.0] {
            // Guests on the west side face east, and vice versa.
            parts.push(place_setting().turned(90.0 * side).at(x + side * 0.33, y + along, 0.75));
            parts.push(chair(&OAK_LIGHT, &CURTAIN_BLUE).turned(90.0 * side).at(
                x + side * 0.74,
                y + along,
                0.0,
            ));
        }
    }
    parts
}

fn hallway() -> Vec<Mesh> {
    let room = &HALL;
    let hang = |side, along, z, thing: Mesh| room.against(side, along, thing.at(0.0, 0.0, z));
    let mut parts = vec![
        rug(&RUG_RED, &RUG_NAVY, 0.8, 6.0).turned(90.0).at(5.0, 5.85, 0.0),
        room.against(WallSide::West, 5.85, mirror(&OAK, 0.95, 2.0).at(0.0, 0.0, 0.08)),
        room.against(WallSide::North, 5.75, console(&WALNUT, 1.1)),
        vase(&AMBER).at(6.1, 6.4, 0.8),
        pile(3, &mut SeededRandom::new(17)).at(5.45, 6.4, 0.8),
        hang(WallSide::North, 5.75, 1.2, round_mirror(&BRASS, 0.38)),
        hang(WallSide::North, 1.6, 1.1, picture(&INK, 1.1, 0.85, 41)),
        hang(WallSide::South, 1.4, 1.1, picture(&OAK, 0.7, 0.9, 42)),
        hang(WallSide::South, 2.6, 1.1, picture(&OAK, 0.7, 0.9, 43)),
        hang(WallSide::South, 3.8, 1.1, picture(&OAK, 0.7, 0.9, 44)),
        hang(WallSide::South, 7.5, 1.15, picture(&BRASS, 1.6, 0.8, 45)),
        palm(1.4, 9, 12).scaled(0.7, 0.7, 1.0).at(10.75, 5.5, 0.0),
        // The front door in the east wall, shut.
        room.against(WallSide::East, 5.85, leaf().at(-0.44, 0.08, 0.0)),
        downlights(room, &[1.0, 3.0, 5.0, 7.0, 9.0, 10.6], &[5.85]),
    ];
    for along in [2.0, 6.4, 8.6] {
        parts.push(hang(WallSide::South, along, 1.8, sconce()));
    }
    parts
}

fn bedroom() -> Vec<Mesh> {
    let room = &BEDROOM;
    let hang = |side, along, z, thing: Mesh| room.against(side, along, thing.at(0.0, 0.0, z));
    let mut parts = vec![
        rug(&LINEN, &CURTAIN_BLUE, 2.6, 2.0).turned(90.0).at(2.0, 8.7, 0.0),
        room.against(WallSide::West, 8.7, bed(&WALNUT, &FABRIC_DARK)),
        room.against(WallSide::East, 9.2, wardrobe(2.7, 4, 2)),
        room.against(WallSide::South, 1.6, sideboard(&OAK, &LACQUER, 1.5, 3, 2)),
        hang(WallSide::South, 1.6, 1.05, round_mirror(&BRASS, 0.4)),
        vase(&CLAY).at(1.05, 6.9, 0.76),
        hang(WallSide::West, 8.7, 1.2, picture(&OAK, 1.3, 0.75, 51)),
        hang(WallSide::West, 8.7, 2.25, garland(2.6, 15)),
        room.against(WallSide::North, 2.5, curtains(&CURTAIN_BLUE, 3.0, 2.45, 0.17)),
        broadleaf(0.95, 40, 14).at(4.45, 10.35, 0.0).at(-0.65, 0.0, 0.0),
        room.hung(2.4, 8.7, pendant(0.27, 0.17)),
        armchair(&MUSTARD, &CURTAIN_BLUE).turned(150.0).at(3.3, 10.2, 0.0),
        leaf().turned(85.0).at(4.25, 6.74, 0.0),
        downlights(room, &[0.6, 3.8], &[7.2, 10.2]),
    ];
    for y in [7.45, 9.95] {
        parts.push(room.against(WallSide::West, y, nightstand(&WALNUT, &LACQUER)));
        parts.push(table_lamp(&CERAMIC).scaled(0.8, 0.8, 0.8).at(0.22, y, 0.5));
    }
    parts
}

fn bathroom() -> Vec<Mesh> {
    let room = &BATH;
    let hang = |side, along, z, thing: Mesh| room.against(side, along, thing.at(0.0, 0.0, z));
    let (half, middle) = (1.5, 6.65);
    vec![
        tiled_floor(room, &TILE_FLOOR_DARK, &TILE_FLOOR, 0.25),
        room.against(WallSide::North, middle, tiles(&TILE_SEA, 2.0 * half, 1.45, 0.15, 0.145)),
        room.against(WallSide::West, 8.7, tiles(&TILE_SEA_DEEP, 4.0, 1.05, 0.20, 0.105)),
        room.against(WallSide::East, 8.7, tiles(&TILE_SEA, 4.0, 1.05, 0.20, 0.105)),
        room.against(
            WallSide::North,
            middle,
            tub(&TILE_WHITE, 2.0 * half - 0.02).at(0.0, 0.01, 0.0),
        ),
        room.against(WallSide::West, 8.35, vanity(1.6).at(0.0, 0.009, 0.0)),
        room.against(WallSide::East, 9.2, water_closet().at(0.0, 0.009, 0.0)),
        hang(WallSide::East, 8.3, 0.9, towel(&CORAL).at(0.0, 0.009, 0.0)),
        hang(WallSide::East, 7.4, 0.6, heated_rail().at(0.0, 0.009, 0.0)),
        hang(WallSide::South, 6.1, 1.55, towel(&TEAL)),
        rolled_towels().at(5.45, 7.3, 0.0),
        rounded(&LINEN, [0.9, 0.55, 0.014], 0.006).at(6.6, 9.55, 0.0),
        broadleaf(0.55, 24, 15).scaled(0.8, 0.8, 0.9).at(7.75, 10.35, 0.56),
        candle().at(7.3, 10.62, 0.56),
        candle().scaled(0.8, 0.8, 0.8).at(7.15, 10.63, 0.56),
        room.hung(6.7, 8.3, ceiling_disc(0.24)),
        downlights(room, &[5.6, 7.6], &[7.2, 10.2]),
    ]
}

fn study() -> Vec<Mesh> {
    let room = &STUDY;
    let hang = |side, along, z, thing: Mesh| room.against(side, along, thing.at(0.0, 0.0, z));
    vec![
        rug(&RUG_RED, &MUSTARD, 1.7, 1.3).turned(90.0).at(9.75, 8.5, 0.0),
        room.against(WallSide::North, 9.85, desk(&OAK, &LACQUER, 1.7)),
        desk_lamp().turned(-140.0).at(10.35, 10.45, 0.74),
        pile(4, &mut SeededRandom::new(23)).at(9.25, 10.4, 0.74),
        globe().at(9.6, 10.48, 0.74),
        rounded(&PAPER, [0.30, 0.21, 0.004], 0.001).turned(8.0).at(9.95, 10.2, 0.74),
        desk_chair(&FABRIC_DARK).turned(-12.0).at(9.8, 9.72, 0.0),
        room.against(WallSide::West, 8.9, bookcase(&OAK, 3.0, 4, 6, 7)),
        armchair(&CORAL, &LINEN).turned(70.0).at(10.75, 8.1, 0.0),
        side_table(&OAK, 0.5).at(10.85, 7.35, 0.0),
        bowl(&AQUA, 0.12).at(10.85, 7.35, 0.5),
        hang(WallSide::East, 9.8, 1.1, picture(&INK, 0.75, 0.95, 61)),
        hang(WallSide::East, 7.15, 1.1, picture(&INK, 0.5, 0.65, 62)),
        palm(1.5, 9, 25).scaled(0.75, 0.75, 1.0).at(10.75, 10.25, 0.0),
        room.hung(9.75, 8.5, panel(0.6, 1.2)),
        downlights(room, &[9.0, 10.6], &[7.2, 9.9]),
    ]
}
