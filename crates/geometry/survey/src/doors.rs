//! Doors: boxes that join the boxes of rooms, so that a person who walks from room to room is
//! always in a box.
//!
//! One flood fill finds all ways from room to room. The shortest ways that join rooms not yet
//! joined are kept (Kruskal's algorithm). Boxes as wide as the passage allows cover them.

use std::collections::{BTreeMap, VecDeque};

use crate::grid::SceneGrid;
use crate::level::Storey;
use crate::rectangle::CellRectangle;

/// Least width of a passage, as a share of the eye's height: 0.4 m for a person.
const LEAST_WIDTH: f64 = 0.25;

/// Greatest width of a box in a passage. A wider box costs samples and shows no more than the rooms
/// do.
const MOST_WIDTH: f64 = 0.75;

/// Longest way between two boxes that is joined: through thick walls, or past furniture beside a
/// door.
const LONGEST: f64 = 2.5;

/// Most boxes of one way.
const MOST_BOXES: usize = 4;

/// Stands for no box: no flood has reached the place.
const NONE: usize = usize::MAX;

/// Returns boxes that join rooms of one storey, in the order of their ways' lengths. `eye` is the
/// height of eyes in cells.
pub(crate) fn joints(
    grid: &SceneGrid,
    level: &Storey,
    rooms: &[CellRectangle],
    eye: f64,
) -> Vec<CellRectangle> {
    let free = Free { mask: level.away_from_walls(grid, 1), size: [grid.size[0], grid.size[1]] };
    let mut joined: Vec<usize> = (0..rooms.len()).collect();
    let mut joints: Vec<CellRectangle> = Vec::new();
    for way in free.ways(rooms, (LONGEST * eye) as usize) {
        let [a, b] = way.rooms.map(|room| joined[room]);
        let covered: Vec<CellRectangle> = rooms.iter().chain(&joints).copied().collect();
        if a == b {
            continue;
        }
        let Some(boxes) = free.boxes(&way.places, &covered, eye) else { continue };
        joined.iter_mut().filter(|group| **group == b).for_each(|group| *group = a);
        joints.extend(boxes);
    }
    joints
}

/// The places of a storey where a person may stand.
struct Free {
    mask: Vec<bool>,
    size: [usize; 2],
}

/// The shortest way from one room to another.
struct DoorAxis {
    rooms: [usize; 2],
    /// Neighbouring places on the way, from room to room.
    places: Vec<[usize; 2]>,
}

impl Free {
    fn index(&self, [x, y]: [usize; 2]) -> usize {
        x * self.size[1] + y
    }

    fn is_free(&self, at: [usize; 2]) -> bool {
        at[0] < self.size[0] && at[1] < self.size[1] && self.mask[self.index(at)]
    }

    /// Returns the free places beside one: first both along one axis, then both along the other.
    fn beside(&self, at: [usize; 2]) -> impl Iterator<Item = [usize; 2]> {
        let [x, y] = at;
        let around = [[x.wrapping_sub(1), y], [x + 1, y], [x, y.wrapping_sub(1)], [x, y + 1]];
        around.into_iter().filter(|&at| self.is_free(at))
    }

    /// Floods from all rooms at once. Returns the shortest way between each pair of rooms whose
    /// floods meet, the shortest first.
    fn ways(&self, rooms: &[CellRectangle], longest: usize) -> Vec<DoorAxis> {
        let mut flood = vec![(NONE, 0, [0; 2]); self.mask.len()];
        let mut queue = VecDeque::new();
        for (number, room) in rooms.iter().enumerate() {
            for at in room.places() {
                flood[self.index(at)] = (number, 0, at);
                queue.push_back(at);
            }
        }
        let mut shortest: BTreeMap<[usize; 2], (usize, [[usize; 2]; 2])> = BTreeMap::new();
        while let Some(at) = queue.pop_front() {
            let (room, distance, _) = flood[self.index(at)];
            for next in self.beside(at) {
                let index = self.index(next);
                let (other, farther, _) = flood[index];
                if other == NONE && 2 * distance <= longest {
                    flood[index] = (room, distance + 1, at);
                    queue.push_back(next);
                } else if other != NONE && other != room {
                    let (length, meeting) = (distance + farther, [at, next]);
                    let (rooms, meeting) = match room < other {
                        true => ([room, other], meeting),
                        false => ([other, room], [next, at]),
                    };
                    let known = shortest.entry(rooms).or_insert((length, meeting));
                    if length < known.0 {
                        *known = (length, meeting);
                    }
                }
            }
        }
        let mut found: Vec<_> =
            shortest.into_iter().filter(|(_, (length, _))| *length <= longest).collect();
        found.sort_by_key(|(_, (length, _))| *length);
        let back = |mut at: [usize; 2]| {
            let mut places = vec![at];
            while flood[self.index(at)].1 > 0 {
                at = flood[self.index(at)].2;
                places.push(at);
            }
            places
        };
        let way = |(rooms, (_, [from, to])): ([usize; 2], (usize, [[usize; 2]; 2]))| {
            let mut places = back(from);
            places.reverse();
            places.extend(back(to));
            DoorAxis { rooms, places }
        };
        found.into_iter().map(way).collect()
    }

    /// Covers a way by free boxes that overlap by a place. The ends of a way lie in rooms. `None`
    /// if the way is too narrow, or needs too many boxes.
    fn boxes(
        &self,
        way: &[[usize; 2]],
        covered: &[CellRectangle],
        eye: f64,
    ) -> Option<Vec<CellRectangle>> {
        let mut boxes: Vec<CellRectangle> = Vec::new();
        let is_covered = |at: &[usize; 2]| covered.iter().any(|rectangle| rectangle.contains(*at));
        let mut next = way.iter().position(|at| !is_covered(at)).unwrap_or(way.len());
        while next < way.len() {
            if boxes.len() == MOST_BOXES {
                return None;
            }
            // Begin at the covered place before, so that boxes overlap.
            let first = next.saturating_sub(1);
            let mut found = CellRectangle { low: way[first], high: way[first] };
            let mut last = first;
            for (step, &at) in way.iter().enumerate().skip(first) {
                let longer = found.with(at);
                if !longer.places().all(|at| self.is_free(at)) {
                    break;
                }
                (found, last) = (longer, step);
                if step > next && is_covered(&at) {
                    break;
                }
            }
            let most = (MOST_WIDTH * eye) as usize;
            let found = self.widened(found, most);
            let side = |axis: usize| found.high[axis] + 1 - found.low[axis];
            if (side(0).min(side(1)) as f64) < LEAST_WIDTH * eye {
                return None;
            }
            boxes.push(found);
            let rest = way.iter().enumerate().skip(last.max(next));
            next = rest
                .filter(|(_, at)| !is_covered(at) && !found.contains(**at))
                .map(|(step, _)| step)
                .next()
                .unwrap_or(way.len());
        }
        Some(boxes)
    }

    /// Widens a rectangle to both sides where it is free, up to `most` places on each side.
    fn widened(&self, rectangle: CellRectangle, most: usize) -> CellRectangle {
        let mut found = rectangle;
        loop {
            let before = found;
            for axis in 0..2 {
                let mut lower = found;
                lower.low[axis] = lower.low[axis].wrapping_sub(1);
                let mut higher = found;
                higher.high[axis] += 1;
                for wider in [lower, higher] {
                    let is_new = |at: &[usize; 2]| !found.contains(*at);
                    let is_wide = found.high[axis] + 1 - found.low[axis] >= most;
                    if !is_wide
                        && wider.low[axis] <= wider.high[axis]
                        && wider.places().filter(is_new).all(|at| self.is_free(at))
                    {
                        found = found.with(wider.low).with(wider.high);
                    }
                }
            }
            if found == before {
                return found;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn free(rows: &[&str]) -> Free {
        let mask = rows.concat().chars().map(|c| c != '#').collect();
        Free { mask, size: [rows.len(), rows[0].len()] }
    }

    fn rectangle(low: [usize; 2], high: [usize; 2]) -> CellRectangle {
        CellRectangle { low, high }
    }

    #[test]
    fn the_shortest_way_from_room_to_room_is_found() {
        let plan = free(&[
            "..###...", //
            "........", "..###...", "..###...", "........",
        ]);
        let rooms = [rectangle([0, 0], [4, 1]), rectangle([0, 5], [4, 6])];
        let ways = plan.ways(&rooms, 9);
        assert_eq!(ways.len(), 1);
        assert_eq!((ways[0].rooms, ways[0].places.len()), ([0, 1], 5));
        assert!(ways[0].places.windows(2).all(|p| p[0][0] == p[1][0] && p[0][1] + 1 == p[1][1]));
        assert!(plan.ways(&rooms, 2).is_empty(), "three places are between");
    }

    #[test]
    fn a_way_round_a_corner_takes_boxes_that_overlap() {
        let plan = free(&[
            "..########", //
            "..########",
            "......####",
            "......####",
            "####..####",
            "####......",
            "####......",
        ]);
        let rooms = [rectangle([0, 0], [1, 1]), rectangle([5, 8], [6, 9])];
        let ways = plan.ways(&rooms, 20);
        let boxes = plan.boxes(&ways[0].places, &rooms, 8.0).unwrap();
        let all: Vec<CellRectangle> = rooms.iter().chain(&boxes).copied().collect();
        for step in ways[0].places.windows(2) {
            assert!(all.iter().any(|r| r.contains(step[0]) && r.contains(step[1])), "{step:?}");
        }
        for place in boxes.iter().flat_map(|r| r.places()) {
            assert!(plan.is_free(place), "{place:?}");
        }
        assert_eq!(boxes.len(), 4, "one for each leg: {boxes:?}");
        assert!(plan.boxes(&ways[0].places, &rooms, 12.0).is_none(), "too narrow for this eye");
    }
}
