//! Draws cells of several pixels over a frame, by distance.

use glam::Vec3;
use holo_display::Frame;
use rayon::prelude::*;

use super::cells::{LayerCell, TILE, TouchedCells};

/// Relative difference of distances within which two pixels show the same surface.
const SAME_DEPTH: f32 = 0.05;

/// Weight of cells in pixels that show another surface.
const OTHER_DEPTH: f32 = 1e-3;

impl TouchedCells {
    /// Draws over a frame whose pixels lie between the middles of cells. `depth` has its distances
    /// without objects.
    pub(super) fn compose(&self, frame: &mut Frame, depth: &[f32]) {
        let (grid, (across, down)) = (self.grid, self.grid.cells());
        let mut places = vec![u32::MAX; across as usize * down as usize];
        let changes = |cell: &&LayerCell| cell.seen > 0 || cell.behind != Vec3::ONE;
        let cells: Vec<&LayerCell> = self.cells().filter(changes).collect();
        for (number, cell) in (0..).zip(&cells) {
            places[(cell.row * across + cell.column) as usize] = number;
        }
        let corner = |column: i64, row: i64| {
            let of = |cell: i64, count: u32| cell.clamp(0, i64::from(count) - 1) as u32;
            let (column, row) = (of(column, across), of(row, down));
            let cell = cells.get(places[(row * across + column) as usize] as usize);
            BlendCorner { cell: cell.copied(), depth: depth[grid.pixel(column, row)] }
        };
        let (width, side) = (grid.size.0, TILE * grid.step);
        let band = (width * side) as usize;
        let bands = frame.picture.pixels.par_chunks_mut(band);
        bands.zip(frame.depth.par_chunks_mut(band)).enumerate().for_each(|(number, band)| {
            let (pixels, distances) = band;
            let top = number as u32 * side;
            let rows = top..top + (pixels.len() / width as usize) as u32;
            for tile in self.tiles.iter().filter(|tile| tile.row as usize == number) {
                let left = tile.cells[0].column / TILE * side;
                let columns = left..(left + side).min(width);
                for (cell_row, rows) in grid.squares(rows.clone()) {
                    for (cell_column, columns) in grid.squares(columns.clone()) {
                        let at = |x: i64, y: i64| corner(cell_column + x, cell_row + y);
                        let corners = [at(0, 0), at(1, 0), at(0, 1), at(1, 1)];
                        if corners.iter().all(|corner| corner.cell.is_none()) {
                            continue;
                        }
                        for row in rows.clone() {
                            let y = grid.share(cell_row, row);
                            for column in columns.clone() {
                                let here = depth[(row * width + column) as usize];
                                let place = [grid.share(cell_column, column), y];
                                let (behind, radiance, distance) = blend(&corners, place, here);
                                let at = ((row - top) * width + column) as usize;
                                let seen = Vec3::from(pixels[at]) * behind + radiance;
                                pixels[at] = seen.to_array();
                                distances[at] = distance.unwrap_or(distances[at]);
                            }
                        }
                    }
                }
            }
        });
    }
}

/// One of the four cells around a pixel.
struct BlendCorner<'a> {
    /// `None` if objects change nothing there.
    cell: Option<&'a LayerCell>,
    /// Distance of the room at the cell's middle.
    depth: f32,
}

/// Returns what the cells around a pixel say: the share of what is behind the objects, their
/// radiance, and their distance if one is seen. The pixel's place between them is from 0 to 1.
///
/// A cell counts little where the room is at another distance than at its middle.
fn blend(corners: &[BlendCorner<'_>; 4], [x, y]: [f32; 2], here: f32) -> (Vec3, Vec3, Option<f32>) {
    let weights = [(1.0 - x) * (1.0 - y), x * (1.0 - y), (1.0 - x) * y, x * y];
    let (mut behind, mut radiance) = (Vec3::ZERO, Vec3::ZERO);
    let (mut whole, mut seen, mut distance) = (0.0, 0.0, 0.0);
    for (BlendCorner { cell, depth }, weight) in corners.iter().zip(weights) {
        let is_same = *depth == here || (depth - here).abs() < SAME_DEPTH * here;
        let weight = if is_same { weight } else { OTHER_DEPTH * weight };
        whole += weight;
        let Some(cell) = cell else {
            behind += Vec3::splat(weight);
            continue;
        };
        behind += cell.behind * weight;
        radiance += cell.radiance * weight;
        if cell.seen > 0 {
            seen += weight;
            distance += cell.distance * weight;
        }
    }
    let distance = (2.0 * seen > whole).then(|| distance / seen);
    let share = 1.0 / whole.max(f32::MIN_POSITIVE);
    (behind * share, radiance * share, distance)
}
