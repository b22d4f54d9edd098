//! Behaviour that callers rely on: cache, readers beside the writer, superseding, order, errors.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use crate::common::{key, kind, options, run, sample, samples};
use holo_beamfile::{BeamFile, BeamSamples, Caching, Copied, Error, Maker, NextNumbers, Options};
use holo_section::{BeamKey, NumberRun, SampleKind};

fn fresh() -> (tempfile::TempDir, std::path::PathBuf, BeamFile) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    let file = BeamFile::create(&path, options()).unwrap();
    (folder, path, file)
}

#[test]
fn a_file_can_be_shared_between_threads() {
    fn shared<T: Send + Sync>() {}
    shared::<BeamFile>();
}

#[test]
fn samples_reach_the_disk_without_a_flush() {
    let (_folder, path, file) = fresh();
    let reader = BeamFile::open_read_only(&path, 0).unwrap();
    let run = run(key(0, 4), 0);
    file.append(run, Maker::UNKNOWN, &samples(&run, 21, 0)).unwrap();
    // The delay is a constant of the writer. A busy machine only makes the test longer.
    while reader.count(run.key) == 0 {
        std::thread::sleep(Duration::from_millis(10));
        reader.refresh().unwrap();
    }
    assert_eq!(reader.read(run.key).unwrap().samples, samples(&run, 21, 0));
}

#[test]
fn packets_that_continue_each_other_become_one_extent() {
    let (_folder, _, file) = fresh();
    for packet in 0..50 {
        for beam in 0..4 {
            let run = run(key(0, beam), packet * 21);
            file.append(run, Maker::UNKNOWN, &samples(&run, 21, 0)).unwrap();
        }
    }
    file.flush().unwrap();
    assert_eq!(file.stats().extents, 4);
    assert_eq!(file.read(key(0, 2)).unwrap().runs.len(), 1);
}

#[test]
fn superseding_samples_replace_only_their_numbers_and_a_late_copy_changes_nothing() {
    let (_folder, path, file) = fresh();
    let rough = run(key(0, 7), 0);
    let better = NumberRun { first: 10, paths: 16, ..rough };
    let other_kind = NumberRun { first: 0, kind: SampleKind::SingleRay, ..rough };
    file.append(rough, Maker::UNKNOWN, &samples(&rough, 40, 1)).unwrap();
    file.append(other_kind, Maker::UNKNOWN, &samples(&other_kind, 3, 1)).unwrap();
    file.supersede(better, Maker::UNKNOWN, &samples(&better, 20, 2)).unwrap();
    // The same packet traced a second time, as after a worker's death.
    file.append(rough, Maker::UNKNOWN, &samples(&rough, 40, 3)).unwrap();
    let check = |file: &BeamFile| {
        let read = file.read(rough.key).unwrap();
        let runs: Vec<_> = read
            .iter()
            .map(|(m, s)| (m.kind as u8, m.first, m.count, m.paths, s.to_vec()))
            .collect();
        let expect = |run: &NumberRun, first, count, tag| {
            let run = NumberRun { first, ..*run };
            (run.kind as u8, first, count, run.paths, samples(&run, count, tag))
        };
        let uniform =
            [expect(&rough, 0, 10, 1), expect(&better, 10, 20, 2), expect(&rough, 30, 10, 1)];
        assert_eq!(runs[..3], uniform);
        assert_eq!(runs[3..], [expect(&other_kind, 0, 3, 1)]);
        assert_eq!(file.count(rough.key), 43);
        assert_eq!(file.counts(rough.key), NextNumbers { uniform: 40, limited: 0, single: 3 });
    };
    check(&file);
    file.flush().unwrap();
    check(&file);
    drop(file);
    check(&BeamFile::open(&path, options()).unwrap());
}

#[test]
fn the_cache_stays_within_its_budget_and_keeps_recently_used_beams() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("test.holo");
    let budget = 50_000;
    let file =
        BeamFile::create(&path, Options { cache_bytes: budget, layout: vec![1000] }).unwrap();
    for beam in 0..200 {
        let run = run(key(0, beam), 0);
        file.append(run, Maker::UNKNOWN, &samples(&run, 100 + beam as u32, 0)).unwrap();
    }
    file.flush().unwrap();
    for i in 0..2000u64 {
        file.read(key(0, i * 7919 % 200)).unwrap();
        file.read(key(0, 3)).unwrap();
        assert!(file.stats().cache_bytes <= budget);
    }
    let stats = file.stats();
    assert!(stats.cache_bytes > budget / 2, "it is used");
    assert_eq!(stats.cache_hits + stats.cache_misses, 4000);
    assert!(stats.cache_hits >= 1999, "a beam read all the time stays: {} hits", stats.cache_hits);
    let run = run(key(0, 3), 5000);
    file.append(run, Maker::UNKNOWN, &samples(&run, 5, 9)).unwrap();
    assert_eq!(file.read(key(0, 3)).unwrap().samples.len(), 108, "new samples are seen at once");

    let huge = self::run(key(0, 999), 0);
    file.append(huge, Maker::UNKNOWN, &samples(&huge, 6000, 0)).unwrap();
    assert_eq!(
        file.read(huge.key).unwrap().samples.len(),
        6000,
        "larger than the cache, and read all the same"
    );
    assert!(file.stats().cache_bytes <= budget);
}

#[test]
fn read_many_gives_cached_beams_first_then_file_order_and_stops_when_told() {
    let (_folder, _, file) = fresh();
    // Each beam in a block of its own, so that file order is not beam order.
    let order = [9, 2, 30, 4, 11, 0];
    for beam in order {
        let run = run(key(0, beam), 0);
        file.append(run, Maker::UNKNOWN, &samples(&run, 21, 0)).unwrap();
        file.flush().unwrap();
    }
    file.read(key(0, 11)).unwrap();
    let keys: Vec<_> =
        (0..40).map(|beam| key(0, beam)).filter(|k| order.contains(&k.beam.0)).collect();
    let mut got = Vec::new();
    let mut collect = |beam: BeamKey, samples: Arc<BeamSamples>| {
        assert_eq!(samples.samples.len(), 21);
        got.push(beam.beam.0);
        ControlFlow::Continue(())
    };
    file.read_many(&keys, Caching::Fill, &mut collect).unwrap();
    assert_eq!(got, [11, 9, 2, 30, 4, 0]);

    let mut calls = 0;
    file.read_many(&keys, Caching::Fill, &mut |_, _| {
        calls += 1;
        if calls == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    })
    .unwrap();
    assert_eq!(calls, 2);
}

#[test]
fn beams_that_are_read_once_leave_the_cache_as_it_is() {
    let (_folder, _, file) = fresh();
    for beam in 0..3 {
        let run = run(key(0, beam), 0);
        file.append(run, Maker::UNKNOWN, &samples(&run, 21, 0)).unwrap();
    }
    file.flush().unwrap();
    file.read(key(0, 1)).unwrap();
    let before = file.stats();
    let keys: Vec<_> = (0..3).map(|beam| key(0, beam)).collect();
    let read = |caching| {
        let mut count = 0;
        file.read_many(&keys, caching, &mut |_, samples| {
            count += samples.samples.len();
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(count, 63);
        file.stats()
    };
    let bypassed = read(Caching::Bypass);
    assert_eq!(bypassed.cache_bytes, before.cache_bytes);
    assert_eq!(bypassed.cache_hits, before.cache_hits + 1, "a cached beam is used");
    assert_eq!(read(Caching::Fill).cache_bytes, 3 * before.cache_bytes);
}

#[test]
fn readers_beside_the_writer_see_whole_blocks_and_never_a_wrong_sample() {
    let (_folder, path, file) = fresh();
    let file = Arc::new(file);
    let done = AtomicBool::new(false);
    std::thread::scope(|scope| {
        let other_process_like = scope.spawn(|| {
            let reader = BeamFile::open_read_only(&path, 10_000).unwrap();
            let mut last = 0;
            while !done.load(Ordering::SeqCst) {
                reader.refresh().unwrap();
                last = check_prefixes(&reader, last);
            }
            reader.refresh().unwrap();
            assert!(reader.damage().is_empty(), "{:?}", reader.damage());
            check_prefixes(&reader, last)
        });
        let same_handle = scope.spawn(|| {
            let mut last = 0;
            while !done.load(Ordering::SeqCst) {
                last = check_prefixes(&file, last);
            }
        });
        for packet in 0..3000 {
            for beam in 0..6 {
                let run = NumberRun { kind: kind(1), ..run(key(0, beam), packet * 21) };
                file.append(run, Maker::UNKNOWN, &samples(&run, 21, 0)).unwrap();
            }
            if packet % 150 == 0 {
                file.flush().unwrap();
            }
        }
        file.flush().unwrap();
        done.store(true, Ordering::SeqCst);
        assert_eq!(other_process_like.join().unwrap(), 3000 * 21);
        same_handle.join().unwrap();
    });
}

/// Every beam holds a prefix of its sequence, no shorter than before.
fn check_prefixes(file: &BeamFile, at_least: usize) -> usize {
    let mut shortest = usize::MAX;
    for beam in 0..6 {
        let key = key(0, beam);
        let read = file.read(key).unwrap();
        assert!(read.samples.len() >= at_least);
        shortest = shortest.min(read.samples.len());
        for (number, found) in (0..).zip(&read.samples).step_by(97) {
            assert_eq!(*found, sample(key, kind(1), number, 0));
        }
    }
    shortest
}

#[test]
fn wrong_use_is_refused_and_changes_nothing() {
    let (_folder, path, file) = fresh();
    let good = run(key(0, 0), 0);
    let one = samples(&good, 1, 0);
    assert!(matches!(
        file.append(run(key(0, 40), 0), Maker::UNKNOWN, &one),
        Err(Error::NoSuchBeam { .. })
    ));
    assert!(matches!(
        file.append(run(key(2, 0), 0), Maker::UNKNOWN, &one),
        Err(Error::NoSuchBeam { .. })
    ));
    assert!(matches!(file.read(key(1, 12)), Err(Error::NoSuchBeam { .. })));
    assert!(matches!(
        file.append(run(key(0, 0), u32::MAX), Maker::UNKNOWN, &one),
        Err(Error::SampleNumbers { .. })
    ));
    file.append(good, Maker::UNKNOWN, &[]).unwrap();
    assert!(matches!(file.put_blob("", &[]), Err(Error::BlobName(0))));
    assert!(matches!(file.put_blob(&"x".repeat(256), &[]), Err(Error::BlobName(256))));
    assert_eq!(file.blob("none").unwrap(), None);
    file.flush().unwrap();
    assert_eq!(file.stats().samples, 0);
    drop(file);

    let other = Options { cache_bytes: 0, layout: vec![40, 13] };
    assert!(matches!(BeamFile::open(&path, other), Err(Error::Layout { .. })));
    let reader = BeamFile::open_read_only(&path, 0).unwrap();
    assert!(matches!(reader.append(good, Maker::UNKNOWN, &one), Err(Error::ReadOnly { .. })));
    assert!(matches!(reader.put_blob("scene", &[]), Err(Error::ReadOnly { .. })));
    let folder = tempfile::tempdir().unwrap();
    let none = Options { cache_bytes: 0, layout: vec![] };
    assert!(matches!(
        BeamFile::create(folder.path().join("none.holo"), none),
        Err(Error::SectionCount(0))
    ));
}

#[test]
fn a_long_append_and_the_last_sample_number_are_kept() {
    let (_folder, path, file) = fresh();
    let long = run(key(0, 1), 0);
    let many = samples(&long, (1 << 20) + 12_345, 0);
    file.append(long, Maker::UNKNOWN, &many).unwrap();
    let last = run(key(0, 2), u32::MAX - 1);
    file.append(last, Maker::UNKNOWN, &many[..1]).unwrap();
    file.close().unwrap();
    let file = BeamFile::open(&path, options()).unwrap();
    assert_eq!(file.read(long.key).unwrap().samples, many);
    assert_eq!(file.read(last.key).unwrap().runs[0].first, u32::MAX - 1);
    assert_eq!(file.counts(last.key).uniform, u32::MAX);
}

/// Writes samples of two makers. Maker 1 made samples 0 to 20 of a beam and all of another beam.
/// Maker 2 made better samples 5 to 9 of the first beam.
fn by_two_makers(file: &BeamFile) -> [NumberRun; 3] {
    let rough = NumberRun { count: 21, ..run(key(0, 3), 0) };
    let better = NumberRun { first: 5, count: 5, paths: 16, ..rough };
    let other = NumberRun { count: 500, ..run(key(1, 2), 0) };
    file.append(rough, Maker(1), &samples(&rough, rough.count, 0)).unwrap();
    file.supersede(better, Maker(2), &samples(&better, better.count, 1)).unwrap();
    file.append(other, Maker(1), &samples(&other, other.count, 0)).unwrap();
    file.flush().unwrap();
    [rough, better, other]
}

#[test]
fn a_sample_keeps_its_maker_through_memory_disk_and_opening() {
    let (_folder, path, file) = fresh();
    let [rough, better, other] = by_two_makers(&file);
    let expected = [
        (NumberRun { count: 5, ..rough }, Maker(1)),
        (better, Maker(2)),
        (NumberRun { first: 10, count: 11, ..rough }, Maker(1)),
    ];
    let waiting = NumberRun { count: 21, ..run(key(0, 4), 0) };
    file.append(waiting, Maker(3), &samples(&waiting, 21, 0)).unwrap();
    assert_eq!(file.makers(waiting.key), [(waiting, Maker(3))]);
    assert_eq!(file.makers(rough.key), expected);
    file.close().unwrap();
    let again = BeamFile::open(&path, options()).unwrap();
    assert_eq!(again.makers(rough.key), expected);
    assert_eq!(again.makers(other.key), [(other, Maker(1))]);
    assert_eq!((again.last_maker(), again.makers(key(0, 9))), (Maker(3), Vec::new()));
}

#[test]
fn packets_of_two_makers_are_two_extents_and_one_run() {
    let (_folder, _, file) = fresh();
    for (packet, maker) in [(0, 1), (1, 1), (2, 2)] {
        let run = run(key(0, 1), packet * 21);
        file.append(run, Maker(maker), &samples(&run, 21, 0)).unwrap();
    }
    file.flush().unwrap();
    assert_eq!(file.stats().extents, 2);
    assert_eq!(file.read(key(0, 1)).unwrap().runs.len(), 1);
}

#[test]
fn a_copy_without_a_maker_restores_the_samples_that_the_maker_superseded() {
    let (folder, _, file) = fresh();
    let [rough, better, other] = by_two_makers(&file);
    let copy = |name: &str, without: u16| {
        let to = BeamFile::create(folder.path().join(name), options()).unwrap();
        let copied = file.copy_samples(&to, &|maker, _| maker != Maker(without)).unwrap();
        to.flush().unwrap();
        (to, copied)
    };
    let (all, copied) = copy("all", 9);
    assert_eq!(copied, Copied { samples: 526, left_out: 0 });
    for key in [rough.key, other.key] {
        assert_eq!(*all.read(key).unwrap(), *file.read(key).unwrap());
        assert_eq!(all.makers(key), file.makers(key));
    }
    let (first, copied) = copy("first", 2);
    assert_eq!(copied, Copied { samples: 521, left_out: 5 });
    assert_eq!(first.read(rough.key).unwrap().samples, samples(&rough, 21, 0));
    let (second, copied) = copy("second", 1);
    assert_eq!(copied, Copied { samples: 5, left_out: 521 });
    assert_eq!(second.read(rough.key).unwrap().samples, samples(&better, 5, 1));
    assert_eq!(second.count(other.key), 0);
}

/// Returns the samples that a beam shows of an earlier generation.
fn earlier(file: &BeamFile, beam: BeamKey) -> Vec<holo_section::Sample> {
    let mut found = Vec::new();
    file.read_earlier(&[beam], &mut |_, samples| {
        found.extend_from_slice(&samples.samples);
        ControlFlow::Continue(())
    })
    .unwrap();
    found
}

#[test]
fn a_new_generation_numbers_its_samples_anew_and_the_earlier_ones_stay() {
    let (folder, path, file) = fresh();
    let (one, two) = (run(key(0, 4), 0), run(key(0, 5), 0));
    for run in [one, two] {
        file.append(run, Maker(1), &samples(&run, 30, 1)).unwrap();
    }
    // It is in the cache.
    assert_eq!(file.read(one.key).unwrap().samples.len(), 30);
    let reader = BeamFile::open_read_only(&path, 1 << 20).unwrap();
    file.begin_generation(1).unwrap();
    assert_eq!((file.generation(), file.stats().samples, file.stats().earlier), (1, 0, 60));
    assert!(file.read(one.key).unwrap().samples.is_empty() && file.runs(one.key).is_empty());
    assert_eq!((file.counts(one.key), file.count(one.key)), (NextNumbers::default(), 0));
    assert_eq!(earlier(&file, one.key), samples(&one, 30, 1));
    for packet in [0, 10] {
        let run = NumberRun { first: packet, ..one };
        file.append(run, Maker(2), &samples(&run, 10, 2)).unwrap();
    }
    file.flush().unwrap();
    reader.refresh().unwrap();
    let copy = BeamFile::create(folder.path().join("copy"), options()).unwrap();
    file.copy_samples(&copy, &|_, _| true).unwrap();
    let check = |file: &BeamFile| {
        assert_eq!(file.read(one.key).unwrap().samples, samples(&one, 20, 2));
        assert_eq!(earlier(file, one.key), samples(&one, 30, 1));
        assert_eq!(earlier(file, two.key), samples(&two, 30, 1));
        assert_eq!((file.generation(), file.count(one.key), file.count(two.key)), (1, 20, 0));
        assert_eq!((file.count_earlier(one.key), file.stats().samples), (30, 20));
    };
    [&file, &reader, &copy].into_iter().for_each(check);
    drop(file);
    let file = BeamFile::open(&path, options()).unwrap();
    check(&file);
    // Of two earlier generations, each beam shows the newer one that it has.
    file.begin_generation(2).unwrap();
    assert_eq!(earlier(&file, one.key), samples(&one, 20, 2));
    assert_eq!(earlier(&file, two.key), samples(&two, 30, 1));
    file.begin_generation(1).unwrap();
    assert_eq!(file.generation(), 2);
}
