//! Records of indirect light, of all workers together: kept in the file, and handed to whoever wants them.
//!
//! What always holds:
//! - a record is there once, by whatever way and however often it came;
//! - records are only added, so that a number of records is enough to know what somebody has been given;
//! - there are at most [`MAX_RECORDS`].

use anyhow::{Context, Result, ensure};
use holo_beamfile::BeamFile;
use holo_light::{MAX_RECORDS, Record};
use holo_proto::bulk::Light;
use rustc_hash::FxHashSet;

use crate::listen::ConnectionId;

/// Blobs of records are named by this, the settings and the generation of the samples, and a number. (One name for all would
/// have to be written anew with every record that is added.) Records by the names `light/0/0/` to `light-3/0/0/` hold light that
/// samples now bring themselves, lack light that they do not, or err more: they are passed over.
const BLOBS: &str = "light-4/0/0/";

/// Records in one blob at the most: half of what a message may hold.
const BLOB_RECORDS: usize = 1 << 16;

/// All records of a holodeck.
#[derive(Debug, Default)]
pub struct LightRecords {
    records: Vec<Record>,
    /// Who made each; the file's own come from nobody.
    makers: Vec<Option<ConnectionId>>,
    ids: FxHashSet<u64>,
}

impl LightRecords {
    /// How many there are.
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.records.is_empty()
    }

    /// Rays that were traced for all of them.
    pub fn rays(&self) -> u64 {
        self.records.iter().map(|record| u64::from(record.rays)).sum()
    }

    /// Adds those that are new, as far as there is room.
    pub(crate) fn merge(&mut self, maker: Option<ConnectionId>, records: &[Record]) {
        for record in records {
            if self.len() < MAX_RECORDS && self.ids.insert(record.id) {
                self.records.push(*record);
                self.makers.push(maker);
            }
        }
    }

    /// At most `most` of the records from number `from` on without those that `to` has made, and the number to go on from.
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

    /// Those from number `from` on, as blobs: names and bytes.
    fn blobs(&self, from: usize, part: usize) -> Vec<(String, Vec<u8>)> {
        let chunks = self.records[from..].chunks(BLOB_RECORDS).enumerate();
        chunks
            .map(|(at, records)| {
                (format!("{BLOBS}{}", part + at), Light { records: records.to_vec() }.encode())
            })
            .collect()
    }
}

/// What of the records is in the file.
#[derive(Debug, Default)]
pub(crate) struct Saved {
    records: usize,
    /// Number of the next blob.
    part: usize,
}

impl Saved {
    /// Reads all records in a file; what is damaged is left out and said.
    pub fn load(file: &BeamFile) -> (Saved, LightRecords, Vec<String>) {
        let mut parts: Vec<usize> = file
            .blob_names()
            .iter()
            .filter_map(|name| name.strip_prefix(BLOBS)?.parse().ok())
            .collect();
        parts.sort_unstable();
        let (mut records, mut warnings) = (LightRecords::default(), Vec::new());
        for part in &parts {
            match read(file, *part) {
                Ok(light) => records.merge(None, &light.records),
                Err(error) => warnings
                    .push(format!("records of indirect light are lost and made anew: {error:#}")),
            }
        }
        (
            Saved { records: records.len(), part: parts.last().map_or(0, |last| last + 1) },
            records,
            warnings,
        )
    }

    /// How many records the file has.
    pub fn records(&self) -> usize {
        self.records
    }

    /// What [`write`](Self::write) has to write. Quick, for the records are locked meanwhile.
    pub fn missing(&self, records: &LightRecords) -> (usize, Vec<(String, Vec<u8>)>) {
        (records.len(), records.blobs(self.records, self.part))
    }

    /// Writes what the file has not. Waits for the disk.
    pub fn write(
        &mut self,
        file: &BeamFile,
        (records, blobs): (usize, Vec<(String, Vec<u8>)>),
    ) -> Result<()> {
        for (name, bytes) in blobs {
            file.put_blob_once(&name, &bytes)?;
            self.part += 1;
            self.records = records.min(self.records + BLOB_RECORDS);
        }
        Ok(())
    }
}

fn read(file: &BeamFile, part: usize) -> Result<Light> {
    let name = format!("{BLOBS}{part}");
    let bytes = file.blob(&name)?.with_context(|| format!("blob {name} is not there"))?;
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
        let (mut saved, mut light, _) = Saved::load(&file);
        for ids in [0..3, 3..4, 4..BLOB_RECORDS as u64 + 10] {
            light.merge(None, &ids.map(record).collect::<Vec<_>>());
            let missing = saved.missing(&light);
            saved.write(&file, missing).unwrap();
            assert_eq!(saved.records(), light.len());
        }
        let (again, read, warnings) = Saved::load(&file);
        assert_eq!((read.records, warnings), (light.records, vec![]));
        assert_eq!((again.records, again.part), (saved.records, saved.part));
        file.put_blob(&format!("{BLOBS}1"), b"no records at all").unwrap();
        let (_, read, warnings) = Saved::load(&file);
        assert_eq!((read.len(), warnings.len()), (BLOB_RECORDS + 9, 1), "{warnings:?}");
    }

    #[test]
    fn no_more_is_kept_than_there_is_room_for() {
        let mut light = LightRecords::default();
        let many: Vec<_> = (0..MAX_RECORDS as u64 + 5).map(record).collect();
        many.chunks(100_000).for_each(|records| light.merge(None, records));
        assert_eq!(light.len(), MAX_RECORDS);
    }
}
