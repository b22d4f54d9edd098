//! The cells of a layer: squares of pixels, with what is seen of objects in each.

use std::ops::Range;

use glam::Vec3;

/// Side of a tile, cells.
pub(super) const TILE: u32 = 16;

/// How objects touch cells.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Touch {
    /// They may be seen there.
    Sight,
    /// Their shadows may be.
    Shadow,
    /// One of both.
    Both,
}

/// The cells of a grid that objects touch.
pub(super) struct TouchedCells {
    pub grid: CellGrid,
    pub touch: Touch,
    pub tiles: Vec<LayerTile>,
}

/// The cells of a tile that objects touch.
pub(super) struct LayerTile {
    /// The row of tiles.
    pub row: u32,
    /// Passes that are drawn.
    pub passes: u32,
    pub cells: Vec<LayerCell>,
}

/// A cell that objects touch, and sums over its passes.
#[derive(Clone, Copy)]
pub(super) struct LayerCell {
    pub column: u32,
    pub row: u32,
    /// Whether an object may be seen here, and whether its shadow may be.
    pub may_show: bool,
    pub may_shadow: bool,
    /// Whether one of both may be in a mirror of the room, or behind solid glass.
    pub may_mirror: bool,
    /// Whether an object may be in a glossy surface of the room.
    pub may_gleam: bool,
    /// Radiance of objects.
    pub radiance: Vec3,
    /// Share of what is behind them that is seen, with the light that they leave there.
    pub behind: Vec3,
    /// Number of passes that see an object, and the sum of its distances.
    pub seen: u32,
    pub distance: f32,
}

/// The cells of a picture.
#[derive(Clone, Copy)]
pub(super) struct CellGrid {
    /// Columns and rows of the picture.
    pub size: (u32, u32),
    /// Side of a cell, pixels.
    pub step: u32,
}

impl LayerTile {
    /// Returns the cells, each with its passes: an interrupted pass is a part of some.
    pub(super) fn cells_and_passes(&self) -> impl Iterator<Item = (&LayerCell, u32)> {
        self.cells.iter().map(|cell| (cell, self.passes))
    }
}

impl TouchedCells {
    pub(super) fn cells(&self) -> impl Iterator<Item = &LayerCell> {
        self.tiles.iter().flat_map(|tile| &tile.cells)
    }
}

impl CellGrid {
    /// Returns the columns and rows of cells.
    pub(super) fn cells(self) -> (u32, u32) {
        (self.size.0.div_ceil(self.step), self.size.1.div_ceil(self.step))
    }

    /// Returns the column and row of the pixel through whose middle a cell's ray goes.
    pub(super) fn place(self, column: u32, row: u32) -> (u32, u32) {
        let of = |cell: u32, most: u32| (cell * self.step + self.step / 2).min(most - 1);
        (of(column, self.size.0), of(row, self.size.1))
    }

    /// Returns the pixels of a range that lie between the middles of two cells, with the number of
    /// the first cell: from -1, before the picture.
    pub(super) fn squares(self, pixels: Range<u32>) -> impl Iterator<Item = (i64, Range<u32>)> {
        let (step, half) = (i64::from(self.step), i64::from(self.step / 2));
        let cell = move |pixel: u32| (i64::from(pixel) - half).div_euclid(step);
        (cell(pixels.start)..=cell(pixels.end - 1)).map(move |cell| {
            let first = (cell * step + half).max(i64::from(pixels.start)) as u32;
            let end = ((cell + 1) * step + half).min(i64::from(pixels.end)) as u32;
            (cell, first..end)
        })
    }

    /// Returns where a pixel lies between the middle of a cell, 0, and that of the next one, 1.
    pub(super) fn share(self, cell: i64, pixel: u32) -> f32 {
        let (step, half) = (i64::from(self.step), i64::from(self.step / 2));
        (i64::from(pixel) - half - cell * step) as f32 / step as f32
    }

    /// Returns the number of that pixel.
    pub(super) fn pixel(self, column: u32, row: u32) -> usize {
        let (column, row) = self.place(column, row);
        (row * self.size.0 + column) as usize
    }
}
