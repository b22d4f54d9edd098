//! Storeys: the places of one level where eyes can be, and those among them that are indoors.

use std::collections::BTreeSet;
use std::f64::consts::PI;

use glam::DVec3;
use holo_raycast::{Ray, Raycaster};

use crate::columns::ColumnRun;
use crate::grid::SceneGrid;
use crate::lit;

/// Directions that are probed from a place.
const DIRECTIONS: usize = 26;

/// Share of a place's directions that must hit something for the place to be indoors.
const ENCLOSED: f64 = 0.62;

/// Most places of a level that are probed. Others get the result of a neighbour.
const MAX_PROBES: usize = 4000;

/// Share of places above a level floor from which on a region may be a room.
const FLAT: f64 = 0.6;

/// Share of back faces in sight from which on a region may be the inside of a solid.
const BACKS: f64 = 0.55;

/// Greatest share of back faces in sight of a hollow that is too low to stand in. The inside of a
/// seat, of a figure or of a car's skin shows more of them.
const BACKS_OF_HOLLOWS: f64 = 0.25;

/// What makes a region a room in spite of its back faces: furniture in a room whose walls face
/// outwards. These are its share of what is in sight, and its numbers of materials and triangles.
/// A cuboid has twelve triangles.
const FURNITURE: f64 = 0.1;
const FURNISHED: usize = 2;
const MORE_THAN_A_BOX: usize = 13;

/// The free places of one storey.
pub(crate) struct Storey {
    /// The cell at eye height.
    pub eye: usize,
    /// The free cells around the eye at each place: the lowest, and the one above the highest.
    pub runs: Vec<Option<(u32, u32)>>,
    /// True for each place in a room.
    pub indoors: Vec<bool>,
}

/// Counts of what is visible around a place.
#[derive(Default)]
struct SightCounts {
    hits: usize,
    backs: usize,
    is_flat: bool,
    has_lamp: bool,
    /// Those of front faces.
    materials: BTreeSet<u32>,
    triangles: BTreeSet<u32>,
}

/// Heights in cells.
#[derive(Clone, Copy)]
pub(crate) struct Heights {
    /// Height of eyes above floors.
    pub eye: u32,
    /// Height below eyes that must be free. It leaves room for chairs and beds.
    pub below: u32,
    /// Greatest difference between floors of one storey.
    pub slack: u32,
    /// True if nobody can stand between floor and ceiling.
    pub is_low: bool,
}

/// Most storeys, and the least area of one, as a share of the largest.
const MAX_LEVELS: usize = 12;
const LEAST_AREA: f64 = 0.2;

/// Returns the storeys that have rooms, from below.
pub(crate) fn levels(
    grid: &SceneGrid,
    raycaster: &Raycaster,
    runs: &[ColumnRun],
    heights: Heights,
) -> Vec<Storey> {
    let headroom = (heights.eye / 10).max(1);
    let mut left: Vec<ColumnRun> = runs.to_vec();
    let mut levels: Vec<Storey> = Vec::new();
    for _ in 0..MAX_LEVELS {
        let mut floors = vec![0usize; grid.size[2] + 1];
        let tall = left.iter().filter(|run| run.height() > heights.eye + headroom);
        tall.for_each(|run| floors[run.from as usize] += 1);
        let commonest = (0..floors.len()).rev().max_by_key(|&floor| floors[floor]);
        let Some(floor) = commonest.filter(|&floor| floors[floor] > 0) else { break };
        let floor = floor as u32;
        let eye = floor + heights.eye;
        // Places above furniture count, too: a table is no storey of its own.
        let is_here = |run: &ColumnRun| {
            (run.from + heights.below..run.to).contains(&eye) && run.from + heights.slack >= floor
        };
        let mut level = Storey::new(grid, eye as usize, left.iter().filter(|run| is_here(run)));
        left.retain(|run| !is_here(run) && run.from != floor);
        level.find_rooms(grid, raycaster, heights.is_low);
        levels.push(level);
    }
    let most = levels.iter().map(Storey::area).max().unwrap_or(0);
    levels.retain(|level| level.area() as f64 > LEAST_AREA * most as f64);
    levels.sort_by_key(|level| level.eye);
    levels
}

impl Storey {
    fn new<'a>(grid: &SceneGrid, eye: usize, runs: impl Iterator<Item = &'a ColumnRun>) -> Storey {
        let mut places = vec![None; grid.size[0] * grid.size[1]];
        for run in runs {
            places[run.x as usize * grid.size[1] + run.y as usize] = Some((run.from, run.to));
        }
        Storey { eye, indoors: vec![false; places.len()], runs: places }
    }

    /// Returns the number of places in rooms.
    fn area(&self) -> usize {
        self.indoors.iter().filter(|&&is_indoors| is_indoors).count()
    }

    /// Returns true for each place in a room that is at least `margin` cells away from places
    /// outside rooms.
    pub(crate) fn away_from_walls(&self, grid: &SceneGrid, margin: usize) -> Vec<bool> {
        let [depth, width, _] = grid.size;
        let mut mask = self.indoors.clone();
        for _ in 0..margin {
            let before = mask.clone();
            let at = |x: usize, y: usize| before[x * width + y];
            for x in 0..depth {
                for y in 0..width {
                    let is_inner = x > 0 && y > 0 && x + 1 < depth && y + 1 < width;
                    mask[x * width + y] =
                        is_inner && (x - 1..=x + 1).all(|x| (y - 1..=y + 1).all(|y| at(x, y)));
                }
            }
        }
        mask
    }

    /// Determines which places are in rooms, or in hollows that `is_low`.
    fn find_rooms(&mut self, grid: &SceneGrid, raycaster: &Raycaster, is_low: bool) {
        let width = grid.size[1];
        let count = self.runs.iter().filter(|run| run.is_some()).count();
        let stride = (count as f64 / MAX_PROBES as f64).sqrt().ceil().max(1.0) as usize;
        let probed = |place: usize| {
            (place / width / stride) * stride * width + (place % width / stride) * stride
        };
        let mut seen: Vec<Option<SightCounts>> = Vec::new();
        seen.resize_with(self.runs.len(), || None);
        let mut inside = vec![false; self.runs.len()];
        let free = self.runs.iter().enumerate().filter_map(|(place, run)| run.map(|_| place));
        for place in free {
            // The first free place of a square is probed for the whole square.
            let corner = probed(place);
            let answer = seen[corner].get_or_insert_with(|| {
                look_around(grid, raycaster, grid.middle([place / width, place % width, self.eye]))
            });
            inside[place] = answer.hits as f64 >= ENCLOSED * DIRECTIONS as f64;
        }
        for region in regions(&inside, width) {
            let corners: BTreeSet<usize> = region.iter().map(|&place| probed(place)).collect();
            let views: Vec<&SightCounts> =
                corners.iter().filter_map(|&corner| seen[corner].as_ref()).collect();
            if is_room(&views, is_low) {
                region.iter().for_each(|&place| self.indoors[place] = true);
            }
        }
    }
}

fn is_room(views: &[&SightCounts], is_low: bool) -> bool {
    let sum =
        |of: fn(&SightCounts) -> usize| views.iter().map(|seen| of(seen)).sum::<usize>() as f64;
    let (hits, backs) = (sum(|seen| seen.hits), sum(|seen| seen.backs));
    let flat = sum(|seen| usize::from(seen.is_flat));
    let distinct = |of: fn(&SightCounts) -> &BTreeSet<u32>| {
        views.iter().flat_map(|seen| of(seen)).collect::<BTreeSet<_>>().len()
    };
    let is_on_a_floor = flat >= FLAT * views.len() as f64;
    if is_low {
        return is_on_a_floor && backs <= BACKS_OF_HOLLOWS * hits;
    }
    if views.iter().any(|seen| seen.has_lamp) {
        return true;
    }
    let is_furnished = || {
        hits - backs >= FURNITURE * hits
            && distinct(|seen| &seen.materials) >= FURNISHED
            && distinct(|seen| &seen.triangles) >= MORE_THAN_A_BOX
    };
    is_on_a_floor && (backs <= BACKS * hits || is_furnished())
}

fn look_around(grid: &SceneGrid, raycaster: &Raycaster, from: DVec3) -> SightCounts {
    let scene = raycaster.scene();
    let origin = grid.frame.to_world(from).as_vec3();
    let mut seen = SightCounts::default();
    for direction in directions() {
        let world = grid.frame.to_world(direction).as_vec3();
        let Some(hit) = raycaster.nearest(&Ray::new(origin, world)) else { continue };
        let normal = raycaster.geometric_normal(hit.triangle);
        let id = scene.material_id(hit.triangle);
        let material = &scene.materials[id as usize];
        let is_back = normal.dot(world) > 0.0;
        seen.hits += 1;
        seen.backs += usize::from(is_back);
        // The back of a glowing shell is visible only from inside it.
        seen.has_lamp |= (!is_back || material.two_sided_emission)
            && lit::glow(scene, hit.triangle, hit.u, hit.v) > 0.0;
        if !is_back {
            seen.materials.insert(id);
            seen.triangles.insert(hit.triangle);
        }
        if direction.z < -0.999 {
            seen.is_flat = normal.as_dvec3().dot(grid.frame.up).abs() > 0.99;
        }
    }
    seen
}

/// Returns evenly spread directions (a spiral), the first of them straight down.
fn directions() -> impl Iterator<Item = DVec3> {
    let golden = PI * (3.0 - 5f64.sqrt());
    (0..DIRECTIONS).map(move |i| {
        let z = if i == 0 { -1.0 } else { -1.0 + 2.0 * (i as f64 + 0.5) / DIRECTIONS as f64 };
        let (sin, cos) = (golden * i as f64).sin_cos();
        let level = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(level * cos, level * sin, z)
    })
}

/// Returns the connected regions of set places, in rows of `width`.
fn regions(mask: &[bool], width: usize) -> Vec<Vec<usize>> {
    let mut left = mask.to_vec();
    let mut regions = Vec::new();
    for start in 0..mask.len() {
        if !left[start] {
            continue;
        }
        left[start] = false;
        let mut region = vec![start];
        let mut next = 0;
        while let Some(&place) = region.get(next) {
            next += 1;
            let (row, column) = (place / width, place % width);
            let neighbours = [
                (row > 0).then(|| place - width),
                (place + width < mask.len()).then_some(place + width),
                (column > 0).then(|| place - 1),
                (column + 1 < width).then_some(place + 1),
            ];
            for neighbour in neighbours.into_iter().flatten() {
                if left[neighbour] {
                    left[neighbour] = false;
                    region.push(neighbour);
                }
            }
        }
        regions.push(region);
    }
    regions
}
