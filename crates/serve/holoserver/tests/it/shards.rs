//! A fill in shards, each into a file of its own, and their merge.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::{collections::BTreeMap, path::Path};

use crate::common::{self, Place, run};
use holo_section::{BeamKey, SampleKind};
use holo_server::{Holodeck, Merged};

/// Fills a new file's share. Returns how many samples it has.
async fn fill(place: &Place, shard: &str, samples: u64) -> u64 {
    let shard = shard.parse().unwrap();
    let server = place
        .serve(|config| {
            (config.fill, config.shard, config.samples) = (true, Some(shard), Some(samples));
        })
        .await;
    let worker = tokio::spawn(common::work(server.address));
    let summary = server.ended().await;
    worker.await.unwrap();
    summary.samples
}

fn open(path: &Path) -> Holodeck {
    Holodeck::open(path, 1 << 20).unwrap()
}

/// Returns the names of all samples in a file.
fn names(holodeck: &Holodeck) -> BTreeMap<(BeamKey, u8), Vec<u32>> {
    let mut names: BTreeMap<_, Vec<u32>> = BTreeMap::new();
    let mut keys = Vec::new();
    holodeck.file.for_each_beam(&mut |key, _| keys.push(key));
    for key in keys {
        for run in holodeck.file.runs(key) {
            assert_eq!(run.kind, SampleKind::Uniform);
            names
                .entry((key, run.kind as u8))
                .or_default()
                .extend(run.first..run.first + run.count);
        }
    }
    names
}

#[test]
fn shards_fill_different_beams_and_merge_into_one_file_that_a_second_merge_does_not_change() {
    run(async {
        let places = [Place::new(), Place::new(), Place::new()];
        let mut total = 0;
        for (index, place) in places.iter().enumerate() {
            total += fill(place, &format!("{index}/3"), 4000).await;
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("all.holo");
        let all = open(&places[0].file()).without_samples(&path).unwrap();
        let mut expected = BTreeMap::new();
        for place in &places {
            let part = open(&place.file());
            let merged = all.merge(&part).unwrap();
            assert_eq!(merged.added, part.file.stats().samples);
            for (beam, numbers) in names(&part) {
                assert!(expected.insert(beam, numbers).is_none(), "one beam in two shards");
            }
        }
        drop(all);
        let all = open(&path);
        assert_eq!((all.file.stats().samples, names(&all)), (total, expected));
        let bytes = all.file.stats().file_bytes;
        for place in &places {
            let part = open(&place.file());
            let known = part.file.stats().samples;
            assert_eq!(all.merge(&part).unwrap(), Merged { added: 0, better: 0, known });
        }
        assert_eq!(all.file.stats().file_bytes, bytes, "not a byte more");
    });
}

#[test]
fn only_files_of_one_kind_are_merged() {
    run(async {
        let (one, other) = (Place::new(), Place::of_scene(b"another scene"));
        let (one, other) = (open(&one.file()), open(&other.file()));
        let error = one.merge(&other).unwrap_err().to_string();
        assert!(error.contains("different scenes"), "{error}");
    });
}
