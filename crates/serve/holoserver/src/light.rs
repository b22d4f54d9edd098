//! Records of indirect light of all workers: kept in the file, and sent to whoever wants them.
//!
//! Invariants:
//! - Each record is there once, however often and from wherever it came.
//! - Records are only added. So a count of records states what a connection has been sent.
//! - There are at most [`MAX_RECORDS`].

use anyhow::{Context, Result, ensure};
use holo_beamfile::BeamFile;
use holo_light::{MAX_RECORDS, Record};
use holo_proto::bulk::Light;
use rustc_hash::FxHashSet;

use crate::events::ConnectionId;

/// The names of blobs of records begin so. The generation of the scene follows, a slash, and a
/// number. New records go into a new blob, so that none is written twice. Blobs `light/0/0/` to
/// `light-3/0/0/` come from earlier versions. Their records have another meaning and are ignored.
const BLOBS: &str = "light-4/0/";

/// Most records in one blob: half of what a message may hold.
const BLOB_RECORDS: usize = 1 << 16;

/// All records of a holodeck.
#[derive(Debug, Default)]
pub struct LightRecords {
    records: Vec<Record>,
    /// The worker that made each; `None` for those from the file.
    makers: Vec<Option<ConnectionId>>,
    ids: FxHashSet<u64>,
}

impl LightRecords {
    /// Returns how many there are.
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Returns whether there are none.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Returns all of them.
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// Returns the number of rays that were traced for all of them.
    pub fn rays(&self) -> u64 {
        self.records.iter().map(|record| u64::from(record.rays)).sum()
    }

    /// Adds the records that are new, as far as there is room. Returns how many it added.
    pub(crate) fn merge(&mut self, maker: Option<ConnectionId>, records: &[Record]) -> u64 {
        let before = self.len();
        for record in records {
            if self.len() < MAX_RECORDS && self.ids.insert(record.id) {
                self.records.push(*record);
                self.makers.push(maker);
            }
        }
        (self.len() - before) as u64
    }

    /// Returns records from number `from` on, at most `most` and none that `to` has made, and the
    /// number to go on from.
    pub(crate) fn since(&self, from: usize, most: usize, to: ConnectionId) -> (Vec<Record>, usize) {
        let mut found = Vec::new();
        let mut next = from;
        while next < self.len() && found.len() < most {
            if self.makers[next] != Some(to) {
                found.push(self.records[next]);
            }
            next += 1;
        }
        (found, next)
    }

    /// Returns the records from number `from` on as blobs: names, of numbers from `blob` on, and
    /// bytes.
    fn blobs(&self, generation: u32, from: usize, blob: usize) -> Vec<(String, Vec<u8>)> {
        let chunks = self.records[from..].chunks(BLOB_RECORDS).enumerate();
        chunks
            .map(|(at, records)| {
                (name(generation, blob + at), Light { records: records.to_vec() }.encode())
            })
            .collect()
    }
}

/// The number of records that are in the file.
#[derive(Debug, Default)]
pub(crate) struct Saved {
    /// The generation of the scene that they belong to.
    generation: u32,
    records: usize,
    /// The number of the next blob.
    next_blob: usize,
}

impl Saved {
    /// Returns that a new file has none.
    pub fn none(generation: u32) -> Saved {
        Saved { generation, ..Saved::default() }
    }

    /// Reads all records of a generation in a file. Returns a warning for each blob that is
    /// damaged.
    pub fn load(file: &BeamFile, generation: u32) -> (Saved, LightRecords, Vec<String>) {
        let prefix = format!("{BLOBS}{generation}/");
        let mut blobs: Vec<usize> = file
            .blob_names()
            .iter()
            .filter_map(|name| name.strip_prefix(&prefix)?.parse().ok())
            .collect();
        blobs.sort_unstable();
        let (mut records, mut warnings) = (LightRecords::default(), Vec::new());
        for blob in &blobs {
            match read(file, &name(generation, *blob)) {
                Ok(light) => _ = records.merge(None, &light.records),
                Err(error) => warnings
                    .push(format!("records of indirect light are lost, and made again: {error:#}")),
            }
        }
        (
            Saved {
                generation,
                records: records.len(),
                next_blob: blobs.last().map_or(0, |last| last + 1),
            },
            records,
            warnings,
        )
    }

    /// Returns how many records the file has.
    pub fn records(&self) -> usize {
        self.records
    }

    /// Returns what [`write`](Self::write) must write. This is quick, because the records are
    /// locked meanwhile.
    pub fn missing(&self, records: &LightRecords) -> (usize, Vec<(String, Vec<u8>)>) {
        (records.len(), records.blobs(self.generation, self.records, self.next_blob))
    }

    /// Writes what the file does not have. Waits for the disk.
    pub fn write(
        &mut self,
        file: &BeamFile,
        (records, blobs): (usize, Vec<(String, Vec<u8>)>),
    ) -> Result<()> {
        for (name, bytes) in blobs {
            file.put_blob(&name, &bytes)?;
            self.next_blob += 1;
            self.records = records.min(self.records + BLOB_RECORDS);
        }
        Ok(())
    }
}

/// Returns the name of a blob of records.
fn name(generation: u32, blob: usize) -> String {
    format!("{BLOBS}{generation}/{blob}")
}

fn read(file: &BeamFile, name: &str) -> Result<Light> {
    let bytes = file.blob(name)?.with_context(|| format!("blob {name} is missing"))?;
    ensure!(!bytes.is_empty(), "blob {name} is empty");
    Light::decode(&bytes).with_context(|| format!("blob {name}"))
}

#[cfg(test)]
mod tests {
    use holo_beamfile::Options;

    use super::*;

    fn record(id: u64) -> Record {
        Record {
            point: [0.0; 3],
            radius: 1.0,
            normal: [0.0, 1.0, 0.0],
            nearest: 1.0,
            irradiance: [1.0; 3],
            error: 0.0,
            shift: [[0.0; 3]; 3],
            turn: [[0.0; 3]; 3],
            rays: 1,
            flags: 0,
            id,
        }
    }

    #[test]
    fn what_is_written_piece_by_piece_is_read_whole_and_damage_costs_one_piece() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.holo");
        let file = BeamFile::create(&path, Options { cache_bytes: 0, layout: vec![1] }).unwrap();
        let (mut saved, mut light, _) = Saved::load(&file, 0);
        for ids in [0..3, 3..4, 4..BLOB_RECORDS as u64 + 10] {
            light.merge(None, &ids.map(record).collect::<Vec<_>>());
            let missing = saved.missing(&light);
            saved.write(&file, missing).unwrap();
            assert_eq!(saved.records(), light.len());
        }
        let (again, read, warnings) = Saved::load(&file, 0);
        assert_eq!((read.records, warnings), (light.records, vec![]));
        assert_eq!((again.records, again.next_blob), (saved.records, saved.next_blob));
        file.put_blob(&name(0, 1), b"no records at all").unwrap();
        let (_, read, warnings) = Saved::load(&file, 0);
        assert_eq!((read.len(), warnings.len()), (BLOB_RECORDS + 9, 1), "{warnings:?}");
        let (_, read, warnings) = Saved::load(&file, 1);
        assert!(read.is_empty() && warnings.is_empty(), "each generation has its own");
    }

    #[test]
    fn no_more_is_kept_than_there_is_room_for() {
        let mut light = LightRecords::default();
        let many: Vec<_> = (0..MAX_RECORDS as u64 + 5).map(record).collect();
        many.chunks(100_000).for_each(|records| _ = light.merge(None, records));
        assert_eq!(light.len(), MAX_RECORDS);
    }
}
