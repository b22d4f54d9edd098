//! A plan of the storeys that have rooms, as an image.

use glam::DVec3;

use crate::rectangle::CellRectangle;
use crate::rooms::Survey;

/// An image of 8 bits, red, green and blue, in rows from the top.
pub struct FloorPlan {
    /// Width in pixels.
    pub width: usize,
    /// Height in pixels.
    pub height: usize,
    /// Three bytes for each pixel.
    pub rgb: Vec<u8>,
}

const SOLID: [u8; 3] = [60, 60, 66];
const OUTSIDE: [u8; 3] = [222, 224, 228];
const INDOORS: [u8; 3] = [250, 247, 238];
const EYE: [u8; 3] = [20, 20, 20];
/// Colours of rooms, in order.
const ROOMS: [[u8; 3]; 8] = [
    [214, 84, 60],
    [66, 122, 196],
    [76, 158, 92],
    [208, 152, 48],
    [142, 98, 186],
    [64, 160, 168],
    [190, 92, 140],
    [130, 130, 84],
];

/// Colour of boxes that join rooms.
const DOOR: [u8; 3] = [168, 196, 120];

/// Least width of a plan, in pixels.
const LEAST_WIDTH: usize = 480;

impl Survey {
    /// Draws the storeys with rooms, one below the other from the top storey on. Walls and
    /// furniture at eye height are dark, rooms and doors are coloured, and a dot with a line is a
    /// view. `None` without rooms.
    #[must_use]
    pub fn plan(&self) -> Option<FloorPlan> {
        let grid = self.grid.as_ref().filter(|_| !self.rooms.is_empty())?;
        let [across, along, _] = grid.size;
        let zoom = LEAST_WIDTH.div_ceil(across).max(1);
        let gap = 4;
        let (width, each) = (across * zoom, along * zoom + gap);
        let used: Vec<usize> =
            (0..self.levels.len()).filter(|&n| self.rooms.iter().any(|r| r.level == n)).collect();
        let mut plan = FloorPlan { width, height: each * used.len() - gap, rgb: Vec::new() };
        plan.rgb = [255; 3].repeat(plan.width * plan.height);
        for (place, &n) in used.iter().rev().enumerate() {
            let level = &self.levels[n];
            for y in 0..along * zoom {
                for x in 0..width {
                    // Ahead is upwards in the plan.
                    let at = [x / zoom, along - 1 - y / zoom];
                    let index = at[0] * along + at[1];
                    let is_solid = grid.column(at[0], at[1])[level.eye];
                    let plain = match () {
                        () if is_solid => SOLID,
                        () if level.indoors[index] => INDOORS,
                        () => OUTSIDE,
                    };
                    plan.set(x, place * each + y, self.room_colour(n, at).unwrap_or(plain));
                }
            }
            for room in self.rooms.iter().filter(|room| room.level == n) {
                let local = grid.frame.to_local(room.sight.eye - self.origin);
                let ahead = grid.frame.to_local(room.sight.direction);
                let cells = (local - grid.low) / grid.cell;
                plan.draw_view(cells, ahead, zoom, [place * each, along * zoom]);
            }
        }
        Some(plan)
    }

    fn room_colour(&self, level: usize, at: [usize; 2]) -> Option<[u8; 3]> {
        let is_here = |of: usize, rectangle: CellRectangle| of == level && rectangle.contains(at);
        let room = self.rooms.iter().position(|room| is_here(room.level, room.rectangle));
        let is_door = || self.doors.iter().any(|door| is_here(door.level, door.rectangle));
        room.map(|index| ROOMS[index % ROOMS.len()]).or_else(|| is_door().then_some(DOOR))
    }
}

impl FloorPlan {
    fn set(&mut self, x: usize, y: usize, colour: [u8; 3]) {
        if x < self.width && y < self.height {
            self.rgb[3 * (y * self.width + x)..][..3].copy_from_slice(&colour);
        }
    }

    fn draw_view(&mut self, cells: DVec3, ahead: DVec3, zoom: usize, [top, height]: [usize; 2]) {
        let (x, y) = (cells.x * zoom as f64, cells.y * zoom as f64);
        let mut dot = |along: f64, radius: f64| {
            let (x, y) = (x + ahead.x * along, y + ahead.y * along);
            let steps = radius.ceil() as i64;
            for (dx, dy) in (-steps..=steps).flat_map(|dx| (-steps..=steps).map(move |dy| (dx, dy)))
            {
                let (px, py) = (x + dx as f64, height as f64 - y + dy as f64);
                let is_near = ((dx * dx + dy * dy) as f64) <= radius * radius;
                if is_near && px >= 0.0 && (0.0..height as f64).contains(&py) {
                    self.set(px as usize, top + py as usize, EYE);
                }
            }
        };
        dot(0.0, 4.0);
        (0..40).for_each(|step| dot(f64::from(step) * 0.6, 1.0));
    }
}
