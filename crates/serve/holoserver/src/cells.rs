//! Cells of surface light of all workers: kept in the file, and sent to whoever wants them.
//!
//! Invariants:
//! - The estimates of different makers are never added, so each maker's can be removed alone.
//! - Cells are only added, or grow. So a count of cells states which of them a connection has been
//!   sent.
//! - There are at most [`MAX_CELLS`].

use anyhow::{Context, Result, ensure};
use holo_beamfile::{BeamFile, Maker};
use holo_proto::bulk::{CellBatch, MAX_ESTIMATES, WireCell};
use rustc_hash::FxHashMap;

use crate::events::ConnectionId;

/// Most cells: 64 MB, and as much for their names.
const MAX_CELLS: usize = 1 << 20;

/// The names of blobs of cells begin so. The generation of the scene follows, a slash, and a
/// number. Blobs `cells-1/` come from earlier versions, whose makers did not say whose light they
/// used.
const BLOBS: &str = "cells-2/";

/// Most cells in one blob: 4 MB, a quarter of what a message may hold.
const BLOB_CELLS: usize = 1 << 16;

/// Growth of the number of estimates after which all cells are written again. The blobs of a file
/// then take at most three times the bytes of the last ones.
const GROWTH: f64 = 1.5;

/// What names a cell: its place, the bits of which are the same for all who have received it, and
/// its maker.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
struct Name {
    place: [u32; 6],
    material: u32,
    bounces: u32,
    level: u16,
    maker: u16,
}

impl Name {
    fn of(cell: &WireCell) -> Name {
        let WireCell {
            point: [a, b, c], normal: [d, e, f], material, bounces, level, maker, ..
        } = *cell;
        Name { place: [a, b, c, d, e, f].map(f32::to_bits), material, bounces, level, maker }
    }
}

/// All cells of a holodeck.
#[derive(Debug, Default)]
pub struct SharedCells {
    cells: Vec<WireCell>,
    /// The connection that sent each first; `None` for those from the file.
    sources: Vec<Option<ConnectionId>>,
    numbers: FxHashMap<Name, usize>,
    estimates: u64,
}

impl SharedCells {
    /// Returns how many there are.
    pub fn len(&self) -> usize {
        self.cells.len()
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.cells.is_empty()
    }

    /// Returns all of them.
    pub fn cells(&self) -> &[WireCell] {
        &self.cells
    }

    /// Returns the number of estimates of all cells.
    pub fn estimates(&self) -> u64 {
        self.estimates
    }

    /// Adds new estimates of a maker, as far as there is room. Returns for each its cell's number.
    pub(crate) fn add(
        &mut self,
        maker: Maker,
        source: Option<ConnectionId>,
        new: &[WireCell],
    ) -> Vec<Option<usize>> {
        let own = new.iter().map(|cell| WireCell { maker: maker.0, ..*cell });
        own.map(|cell| {
            let number = self.number(&cell, source)?;
            let known = &mut self.cells[number];
            // Sums of more estimates would lose digits; what they have is enough.
            if known.count <= MAX_ESTIMATES - cell.count {
                known.count += cell.count;
                self.estimates += u64::from(cell.count);
                for c in 0..3 {
                    known.light[c] = (known.light[c] + cell.light[c]).min(f32::MAX);
                    known.albedo[c] += cell.albedo[c];
                }
            }
            Some(number)
        })
        .collect()
    }

    /// Takes the cells of another file, whose makers may have other numbers here. Of a cell that
    /// both have, the one with more estimates stays: it contains those of the other.
    pub(crate) fn merge(&mut self, other: &SharedCells, maker: impl Fn(Maker) -> Maker) {
        for cell in &other.cells {
            let cell = WireCell { maker: maker(Maker(cell.maker)).0, ..*cell };
            if let Some(number) = self.number(&cell, None)
                && self.cells[number].count < cell.count
            {
                self.estimates += u64::from(cell.count - self.cells[number].count);
                self.cells[number] = cell;
            }
        }
    }

    /// Takes the cells of some makers of another file whose makers have the same numbers.
    pub(crate) fn merge_those(&mut self, other: &SharedCells, is_maker: impl Fn(Maker) -> bool) {
        let cells = other.cells.iter().filter(|cell| is_maker(Maker(cell.maker))).copied();
        cells.for_each(|cell| _ = self.add(Maker(cell.maker), None, &[cell]));
    }

    /// Returns cells from number `from` on, at most `most` and none that connection `to` has made,
    /// and the number to go on from.
    pub(crate) fn since(
        &self,
        from: usize,
        most: usize,
        to: ConnectionId,
    ) -> (Vec<WireCell>, usize) {
        let end = self.len().min(from + most);
        let others = (from..end).filter(|number| self.sources[*number] != Some(to));
        (others.map(|number| self.cells[number]).collect(), end)
    }

    /// Returns the number of a cell, which is new and has no estimates unless it is known. `None`
    /// if there is no room.
    fn number(&mut self, cell: &WireCell, source: Option<ConnectionId>) -> Option<usize> {
        let name = Name::of(cell);
        if let Some(number) = self.numbers.get(&name) {
            return Some(*number);
        }
        let number = self.cells.len();
        if number == MAX_CELLS {
            return None;
        }
        self.cells.push(WireCell { count: 0, light: [0.0; 3], albedo: [0.0; 3], ..*cell });
        self.sources.push(source);
        self.numbers.insert(name, number);
        Some(number)
    }
}

/// What the file has of them.
#[derive(Debug, Default)]
pub(crate) struct SavedCells {
    /// The generation of the scene that they belong to.
    generation: u32,
    estimates: u64,
}

impl SavedCells {
    /// Returns that a new file has none.
    pub fn none(generation: u32) -> SavedCells {
        SavedCells { generation, estimates: 0 }
    }

    /// Reads all cells of a generation in a file. Returns a warning for each damaged blob.
    pub fn load(file: &BeamFile, generation: u32) -> (SavedCells, SharedCells, Vec<String>) {
        let prefix = format!("{BLOBS}{generation}/");
        let (mut cells, mut warnings) = (SharedCells::default(), Vec::new());
        let names = file.blob_names();
        for name in names.iter().filter(|name| name.starts_with(&prefix)) {
            match read(file, name) {
                // A crash between two blobs may leave a cell in both.
                Ok(found) => {
                    let mut read = SharedCells::default();
                    for cell in found.cells {
                        read.add(Maker(cell.maker), None, &[cell]);
                    }
                    cells.merge(&read, |maker| maker);
                }
                Err(error) => warnings
                    .push(format!("cells of surface light are lost, and made again: {error:#}")),
            }
        }
        (SavedCells { generation, estimates: cells.estimates }, cells, warnings)
    }

    /// Returns what must be written: nothing unless there is much more than in the file or, at the
    /// end, anything.
    pub fn missing(&self, cells: &SharedCells, is_end: bool) -> Option<(u64, Vec<Vec<u8>>)> {
        let (now, saved) = (cells.estimates, self.estimates);
        let is_due = now as f64 >= GROWTH * saved as f64 || is_end;
        (now != saved && is_due).then(|| {
            let blobs = cells.cells.chunks(BLOB_CELLS);
            (now, blobs.map(|cells| CellBatch { cells: cells.to_vec() }.encode()).collect())
        })
    }

    /// Writes it. Waits for the disk.
    pub fn write(&mut self, file: &BeamFile, (now, blobs): (u64, Vec<Vec<u8>>)) -> Result<()> {
        for (number, bytes) in blobs.iter().enumerate() {
            file.put_blob(&format!("{BLOBS}{}/{number}", self.generation), bytes)?;
        }
        self.estimates = now;
        Ok(())
    }
}

fn read(file: &BeamFile, name: &str) -> Result<CellBatch> {
    let bytes = file.blob(name)?.with_context(|| format!("blob {name} is missing"))?;
    ensure!(!bytes.is_empty(), "blob {name} is empty");
    CellBatch::decode(&bytes).with_context(|| format!("blob {name}"))
}

#[cfg(test)]
mod tests {
    use holo_beamfile::Options;

    use super::*;

    fn cell(place: u32, count: u32) -> WireCell {
        let sum = count as f32;
        WireCell {
            point: [place as f32, 0.0, 0.0],
            normal: [0.0, 1.0, 0.0],
            material: 0,
            bounces: u32::MAX,
            level: 1,
            maker: 0,
            count,
            light: [sum; 3],
            albedo: [0.5 * sum; 3],
        }
    }

    #[test]
    fn estimates_of_a_maker_add_up_and_those_of_others_stay_apart() {
        let mut cells = SharedCells::default();
        let numbers = cells.add(Maker(1), None, &[cell(0, 4), cell(1, 4), cell(0, 3)]);
        assert_eq!(numbers, [Some(0), Some(1), Some(0)]);
        assert_eq!(cells.add(Maker(2), None, &[cell(0, 5)]), [Some(2)]);
        let of = |number: usize| (cells.cells[number].maker, cells.cells[number].count);
        assert_eq!([of(0), of(1), of(2)], [(1, 7), (1, 4), (2, 5)]);
        assert_eq!((cells.cells[0].light, cells.cells[0].albedo), ([7.0; 3], [3.5; 3]));
        assert_eq!(cells.estimates(), 16);
    }

    #[test]
    fn a_connection_is_sent_all_cells_but_those_that_it_made() {
        let mut cells = SharedCells::default();
        cells.add(Maker(1), None, &[cell(0, 4)]);
        let [first, second] = [ConnectionId::next(), ConnectionId::next()];
        cells.add(Maker(1), Some(first), &[cell(0, 1), cell(1, 4)]);
        cells.add(Maker(2), Some(second), &[cell(2, 4)]);
        let places = |from, to| {
            let (sent, next) = cells.since(from, 2, to);
            (sent.iter().map(|cell| cell.point[0]).collect::<Vec<_>>(), next)
        };
        assert_eq!(places(0, first), (vec![0.0], 2));
        assert_eq!(places(2, first), (vec![2.0], 3));
        assert_eq!(places(0, second), (vec![0.0, 1.0], 2));
    }

    #[test]
    fn merging_again_changes_nothing() {
        let (mut ours, mut theirs) = (SharedCells::default(), SharedCells::default());
        ours.add(Maker(3), None, &[cell(0, 4)]);
        theirs.add(Maker(1), None, &[cell(0, 6), cell(1, 2)]);
        for _ in 0..2 {
            ours.merge(&theirs, |maker| Maker(maker.0 + 2));
            let counts: Vec<u32> = ours.cells.iter().map(|cell| cell.count).collect();
            assert_eq!((counts, ours.estimates()), (vec![6, 2], 8));
        }
    }

    #[test]
    fn no_more_is_kept_than_there_is_room_for() {
        let mut cells = SharedCells::default();
        let many: Vec<WireCell> = (0..MAX_CELLS as u32 + 5).map(|place| cell(place, 1)).collect();
        let numbers = cells.add(Maker(1), None, &many);
        assert_eq!(cells.len(), MAX_CELLS);
        assert_eq!(numbers.iter().filter(|number| number.is_none()).count(), 5);
        for _ in 0..3 {
            cells.add(Maker(1), None, &[cell(0, MAX_ESTIMATES / 2)]);
        }
        assert!(cells.cells[0].is_valid());
    }

    #[test]
    fn what_is_written_is_read_again_and_damage_costs_one_blob() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.holo");
        let file = BeamFile::create(&path, Options { cache_bytes: 0, layout: vec![1] }).unwrap();
        let (mut saved, mut cells, _) = SavedCells::load(&file, 0);
        let many: Vec<WireCell> = (0..BLOB_CELLS as u32 + 10).map(|place| cell(place, 2)).collect();
        cells.add(Maker(7), None, &many);
        let missing = saved.missing(&cells, false).unwrap();
        saved.write(&file, missing).unwrap();
        cells.add(Maker(7), None, &many[..10]);
        assert!(saved.missing(&cells, false).is_none(), "a little more can wait");
        let missing = saved.missing(&cells, true).unwrap();
        saved.write(&file, missing).unwrap();
        let (again, read, warnings) = SavedCells::load(&file, 0);
        assert_eq!((read.len(), read.estimates()), (cells.len(), cells.estimates()));
        assert_eq!((again.estimates, warnings), (saved.estimates, vec![]));
        assert!(read.cells.iter().all(|cell| cell.maker == 7));
        file.put_blob("cells-2/0/1", b"no cells at all").unwrap();
        let (_, read, warnings) = SavedCells::load(&file, 0);
        assert_eq!((read.len(), warnings.len()), (BLOB_CELLS, 1), "{warnings:?}");
        let (_, read, warnings) = SavedCells::load(&file, 1);
        assert!(read.is_empty() && warnings.is_empty(), "each generation has its own");
    }
}
