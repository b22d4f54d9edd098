//! Runs of free cells in the columns of a grid, from floor to ceiling.

use crate::grid::SceneGrid;

/// Free cells of one column above a touched cell.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ColumnRun {
    pub x: u32,
    pub y: u32,
    /// The lowest free cell.
    pub from: u32,
    /// The cell above the highest free one.
    pub to: u32,
    /// True if a touched cell ends the run above.
    pub roofed: bool,
}

impl ColumnRun {
    /// Returns the number of cells.
    pub(crate) fn height(&self) -> u32 {
        self.to - self.from
    }
}

/// Returns all runs of a grid.
pub(crate) fn runs(grid: &SceneGrid) -> Vec<ColumnRun> {
    let mut runs = Vec::new();
    for x in 0..grid.size[0] {
        for y in 0..grid.size[1] {
            let column = grid.column(x, y);
            let mut floor = None;
            for (z, &touched) in column.iter().enumerate() {
                if touched {
                    push(&mut runs, x, y, floor, z, true);
                    floor = Some(z + 1);
                }
            }
            push(&mut runs, x, y, floor, column.len(), false);
        }
    }
    runs
}

fn push(
    runs: &mut Vec<ColumnRun>,
    x: usize,
    y: usize,
    floor: Option<usize>,
    to: usize,
    roofed: bool,
) {
    if let Some(from) = floor.filter(|&from| from < to) {
        let (x, y, from, to) = (x as u32, y as u32, from as u32, to as u32);
        runs.push(ColumnRun { x, y, from, to, roofed });
    }
}

/// Returns the commonest height of a storey in cells, from floor to ceiling. Heights within 15 % of
/// each other count together, each by its volume, because spaces below tables and in walls are many
/// but low. `None` without a roof.
pub(crate) fn storey(runs: &[ColumnRun]) -> Option<f64> {
    let mut volume: Vec<f64> = Vec::new();
    for run in runs.iter().filter(|run| run.roofed && run.height() >= 3) {
        let height = run.height() as usize;
        if volume.len() <= height {
            volume.resize(height + 1, 0.0);
        }
        volume[height] += height as f64;
    }
    let last = |height: usize| ((height as f64 * 1.15) as usize + 1).min(volume.len());
    let sum = |height: usize| volume[height..last(height)].iter().sum::<f64>();
    let best = (0..volume.len()).max_by(|&a, &b| sum(a).total_cmp(&sum(b)))?;
    let mean = (best..last(best)).map(|height| height as f64 * volume[height]).sum::<f64>();
    (sum(best) > 0.0).then(|| mean / sum(best))
}
