//! A file with enough samples gets better ones, whichever process dies or looks meanwhile.

use std::{
    collections::{BTreeMap, BTreeSet},
    path::Path,
    time::Instant,
};

use holo_beamfile::BeamFile;
use holo_net::Message;
use holo_proto::{
    bulk::{RequestedBeam, ViewRequest},
    control::Control,
    frame::FrameKind,
    hello::Role,
};
use holo_section::{BeamKey, Sample, SampleKind, Section, Viewpoint};
use holo_tests::{CORNELL_SMALL_SECTION, LIMIT, Place, Server, analytic::join, beam, wait_until};
use rustix::process::Signal;

/// Every sample, with the paths in it, by beam, kind and number.
type Samples = BTreeMap<(BeamKey, SampleKind, u32), (u16, Sample)>;

fn samples(path: &Path) -> Samples {
    let file = BeamFile::open_read_only(path, 1 << 20).unwrap();
    let mut keys = Vec::new();
    file.for_each_beam(&mut |key, _| keys.push(key));
    let mut samples = Samples::new();
    for key in keys {
        let beam = file.read(key).unwrap();
        for (run, of_run) in beam.iter() {
            let numbered = (run.first..).zip(of_run);
            samples.extend(
                numbered.map(|(number, sample)| ((key, run.kind, number), (run.paths, *sample))),
            );
        }
    }
    samples
}

/// Returns the number of samples for each number of paths.
fn by_paths(samples: &Samples) -> BTreeMap<u16, usize> {
    let mut counts = BTreeMap::new();
    samples.values().for_each(|(paths, _)| *counts.entry(*paths).or_default() += 1);
    counts
}

/// Waits until so many of a file's samples have more than one path.
#[track_caller]
fn wait_for_better(path: &Path, wanted: usize) {
    wait_until("better samples", || {
        let counts = by_paths(&samples(path));
        (counts.iter().filter(|(paths, _)| **paths > 1).map(|(_, count)| count).sum::<usize>()
            > wanted)
            .then_some(())
    });
}

/// Checks that the later state of a file has every sample of the earlier one: the same ray, made as
/// well or better.
#[track_caller]
fn assert_no_worse(later: &Samples, earlier: &Samples) {
    for (name, (paths, sample)) in earlier {
        let (now, same) = later.get(name).unwrap_or_else(|| panic!("{name:?} is gone"));
        assert!(now >= paths, "{name:?} had {paths} paths, now {now}");
        assert_eq!(same.coords, sample.coords, "{name:?} is of another ray");
        assert!(now > paths || same == sample, "{name:?} has changed, and not for the better");
    }
}

#[test]
fn a_file_with_enough_gets_no_more_samples_but_better_ones() {
    let place = Place::new();
    const ENOUGH: f64 = 60e3;
    let fill = || place.fill_small_with("a.holo", "75k", &["--enough", "60k"]).json();
    let first = fill();
    let added = first["added"].as_u64().unwrap();
    // Shares are rounded by chance to packets of 4, so the total has a standard deviation of at
    // most 2·√(beams). Beams that turn out to see nothing move the others' shares until they are
    // within 1 %.
    assert!((added as f64 - ENOUGH).abs() < 0.01 * ENOUGH + 4.0 * 2.0 * 7680f64.sqrt(), "{first}");
    assert_eq!(first["samples"], first["added"]);
    let better = first["better"].as_u64().unwrap();
    // The last packet may be more than what was left to do.
    assert!((75_000..75_021).contains(&(added + better)), "{first}");
    let mut before = samples(&place.path("a.holo"));
    let counts = by_paths(&before);
    assert_eq!(counts.get(&4).copied(), Some(better as usize), "{counts:?}");
    assert_eq!(before.len() as u64, added);

    // The fill continues with the rest of the level, and then the next level, in every sample.
    let (mut total, mut superseded) = (added, better);
    for _ in 0..2 {
        let summary = fill();
        total += summary["added"].as_u64().unwrap();
        superseded += summary["better"].as_u64().unwrap();
        assert_eq!(summary["samples"].as_u64(), Some(total), "{summary}");
        assert_eq!(summary["superseded_bytes"].as_u64(), Some(10 * superseded), "{summary}");
        assert!(summary["bytes_per_hour"].as_f64().unwrap() > 0.0, "{summary}");
        let after = samples(&place.path("a.holo"));
        assert_no_worse(&after, &before);
        before = after;
    }
    // Later fills may find more beams that see nothing, which moves the others' shares a little,
    // once.
    assert!(total < added + added / 20, "{total} after {added}");
    let counts = by_paths(&before);
    assert!(counts.keys().all(|paths| [4, 16, 64].contains(paths)), "{counts:?}");
    place.run(&["verify", "{}/a.holo"]).ok();

    let info = place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
    assert_eq!(info["superseded_bytes"].as_u64(), Some(10 * superseded));
    let said = info["paths"].as_object().unwrap();
    assert_eq!(said.len(), counts.len());
    for (paths, count) in counts {
        assert_eq!(said[&paths.to_string()], count);
    }
}

#[test]
fn a_fill_ends_before_its_time_when_nothing_is_left_to_trace() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let before = samples(&place.path("a.holo"));
    let config = std::fs::read_to_string(place.cornell()).unwrap();
    place.write("enough.toml", &format!("enough = \"0\"\n{config}"));
    let words = ["fill", "--config", "{}/enough.toml", "--section", CORNELL_SMALL_SECTION];
    // These samples already have enough paths to be final, and no more samples are wanted.
    place
        .run(
            &[&words[..], &["-o", "{}/b.holo", "--paths-per-sample", "8192", "--time", "10m"]]
                .concat(),
        )
        .ok();
    let ended = place.run(
        &[&words[..], &["-o", "{}/b.holo", "--paths-per-sample", "8192", "--samples", "1"]]
            .concat(),
    );
    assert!(ended.ok().stderr.contains("nothing left to trace"));
    assert!(samples(&place.path("b.holo")).is_empty());
    // With enough of nothing, what is there gets better at once.
    let ended = place.fill_small_with("a.holo", "1k", &["--enough", "0"]).json();
    assert_eq!((&ended["added"], &ended["better"]), (&0.into(), &(before.len().into())), "{ended}");
    assert_eq!(by_paths(&samples(&place.path("a.holo"))), BTreeMap::from([(4, before.len())]));
}

#[test]
fn info_says_how_fast_a_file_grows_that_is_being_filled() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let server = place.server("a.holo", &["--fill"]);
    let _worker = place.worker(server.address, &[]);
    let length = || std::fs::metadata(place.path("a.holo")).unwrap().len();
    // `info` watches the file for most of its run. The file grows in steps, so the reported growth
    // may differ from the whole growth by a factor of up to ten. Wrong units would differ more.
    wait_until("info to say how fast the file grows", || {
        let (before, start) = (length(), Instant::now());
        let info = place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
        let said =
            info["bytes_per_hour"].as_f64().unwrap() / 3600.0 * start.elapsed().as_secs_f64();
        let grown = (length() - before) as f64;
        (said > grown / 10.0 && said < grown * 10.0).then_some(())
    });
}

#[test]
fn better_samples_are_of_the_same_light_with_less_noise() {
    let place = Place::new();
    // Rays depend only on the section, and their random numbers on the seed. So samples of one
    // number in two files see the same, with independent errors.
    let fill = |seed: &str, enough: &str, more: &str| {
        let name = format!("{seed}-{enough}.holo");
        let words = ["--seed", seed, "--enough", enough];
        place.fill_small_with(&name, more, &words);
        samples(&place.path(&name))
    };
    let rough = [fill("1", "1G", "20k"), fill("2", "1G", "20k")];
    // Two levels: 4 paths and 16 paths.
    let better = [fill("3", "20k", "60k"), fill("4", "20k", "60k")];
    let values = |sample: &Sample| sample.rgb().map(f64::from).iter().sum::<f64>();
    let is_common = |name: &&(BeamKey, SampleKind, u32)| {
        rough[1].contains_key(name)
            && better.iter().all(|file| file.get(name).is_some_and(|(paths, _)| *paths == 16))
    };
    let common: Vec<_> = rough[0].keys().filter(is_common).collect();
    assert!(common.len() > 15_000, "{}", common.len());

    // Rays are summed in groups, so that the spread of the groups shows how exact the sums are,
    // whatever the distribution of one error.
    const GROUPS: usize = 40;
    let (mut noise, mut brightness) = (vec![[0.0; 2]; GROUPS], vec![0.0; GROUPS]);
    let mut smaller = 0.0;
    let mut differing = 0.0;
    for (index, name) in common.iter().enumerate() {
        let value = |file: &Samples| values(&file[*name].1);
        let a = value(&rough[0]) - value(&rough[1]);
        let b = value(&better[0]) - value(&better[1]);
        noise[index % GROUPS][0] += a * a;
        noise[index % GROUPS][1] += b * b;
        brightness[index % GROUPS] +=
            value(&better[0]) + value(&better[1]) - value(&rough[0]) - value(&rough[1]);
        if a != b {
            differing += 1.0;
            smaller += f64::from(u8::from(b.abs() < a.abs()));
        }
    }
    // The mean of 16 independent paths has a sixteenth of the variance, and stratification lowers
    // it further. Leaving out one group at a time gives the ratio's standard error; normal,
    // one-sided, 99.95 %.
    let sum = |without: usize, which: usize| -> f64 {
        noise
            .iter()
            .enumerate()
            .filter(|(group, _)| *group != without)
            .map(|(_, noise)| noise[which])
            .sum()
    };
    let ratio = sum(GROUPS, 1) / sum(GROUPS, 0);
    let spread: f64 =
        (0..GROUPS).map(|group| (sum(group, 1) / sum(group, 0) - ratio).powi(2)).sum();
    let deviation = (spread * (GROUPS - 1) as f64 / GROUPS as f64).sqrt();
    assert!(
        ratio - 3.29 * deviation < 1.0 / 16.0,
        "{ratio} ± {deviation} of the variance is left, not a sixteenth"
    );
    assert!(
        ratio + 3.29 * deviation < 1.0 / 4.0,
        "{ratio} ± {deviation}: no proof that there is less noise"
    );
    // The sign test compares ray by ray: with equal noise, the better pair would be the closer one
    // half of the time.
    let z = (smaller - 0.5 * differing) / (0.25 * differing).sqrt();
    assert!(z > 5.0, "the better pair is closer {smaller} times of {differing}");
    // The brightness is the same: Student's t with 39 degrees of freedom, 99.9 %.
    let mean = brightness.iter().sum::<f64>() / GROUPS as f64;
    let variance = brightness.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (GROUPS - 1) as f64;
    let deviation = (variance / GROUPS as f64).sqrt();
    assert!(mean.abs() < 3.56 * deviation, "{mean} ± {deviation}");
}

/// A file with nearly enough samples, and its server. Once it has workers, the server first
/// completes the samples and then makes them better.
fn improving(place: &Place, words: &[&str]) -> Server {
    place.fill_small_with("a.holo", "15k", &["--enough", "20k"]);
    place.server("a.holo", &[&["--fill", "--enough", "20k", "--json"], words].concat())
}

#[test]
fn a_server_killed_in_the_middle_of_a_level_loses_nothing_and_goes_on() {
    let place = Place::new();
    let server = improving(&place, &[]);
    let before = samples(&place.path("a.holo"));
    let _worker = place.worker(server.address, &["--retry", "1"]);
    wait_for_better(&place.path("a.holo"), 3000);
    let seen = samples(&place.path("a.holo"));
    assert_eq!(server.process.end(Signal::KILL).signal(), Some(9));
    let after = samples(&place.path("a.holo"));
    assert_no_worse(&after, &seen);
    assert_no_worse(&after, &before);
    let summary = place.fill_small_with("a.holo", "25k", &["--enough", "20k"]).json();
    // Better samples are passed over: less than one level was left of this one.
    let last = samples(&place.path("a.holo"));
    assert_no_worse(&last, &after);
    assert!(last.values().all(|(paths, _)| *paths >= 4), "{:?}", by_paths(&last));
    assert!(summary["better"].as_u64().unwrap() > 0, "{summary}");
    place.run(&["verify", "{}/a.holo"]).ok();
}

#[test]
fn better_packets_of_dead_workers_are_dealt_again() {
    let place = Place::new();
    let server = improving(&place, &["--samples", "70k"]);
    let killed = place.worker(server.address, &[]);
    wait_for_better(&place.path("a.holo"), 1000);
    // So that it leaves packets for others.
    killed.signal(Signal::STOP);
    // This worker takes packets, does nothing with them, and goes.
    let idle = tokio::runtime::Runtime::new().unwrap();
    let (mut inbox, outbox, _) = idle.block_on(join(server.address, Role::Worker));
    // Its first packets are four for each thread. Up to 64 packets check the other worker's
    // reports.
    outbox.control(&Control::Ready { threads: 64 }).unwrap();
    let lost = idle.block_on(async {
        let mut lost = Vec::new();
        // Packets that check reports may have fewer paths.
        while lost.len() < 2 {
            if let Message::Work(work) = inbox.next().await.unwrap() {
                lost.extend(work.packets.into_iter().filter(|packet| packet.paths > 1));
            }
        }
        lost
    });
    assert!(lost.iter().all(|packet| packet.paths >= 4), "{lost:?}");
    drop((inbox, outbox));
    idle.shutdown_background();
    assert_eq!(killed.end(Signal::KILL).signal(), Some(9));
    let _last = place.worker(server.address, &[]);
    let summary = server.process.wait().ok().json();
    let counts = by_paths(&samples(&place.path("a.holo")));
    let most = *counts.keys().last().unwrap();
    assert!(most >= 16, "{counts:?}");
    // A level is completed before the next but one begins, whichever worker was to do it.
    assert!(counts.keys().all(|paths| *paths >= most / 4), "{counts:?}");
    let better = summary["better"].as_u64().unwrap();
    assert_eq!(
        summary["superseded_bytes"].as_u64(),
        Some(10 * better),
        "nothing is stored twice: {summary}"
    );
}

/// The most paths of any sample in even beams, and in odd beams.
fn most_paths_in_even_and_odd_beams(samples: &Samples) -> [u16; 2] {
    [0, 1].map(|odd| {
        let beams = samples.iter().filter(|((key, ..), _)| key.beam.0 % 2 == odd);
        beams.map(|(_, (paths, _))| *paths).max().unwrap_or(0)
    })
}

#[test]
fn what_a_display_looks_at_stays_as_it_is_and_the_rest_gets_better() {
    let place = Place::new();
    let server = improving(&place, &[]);
    let info = place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
    assert_eq!(info["sections"][0]["beams"], 7680, "{CORNELL_SMALL_SECTION}");
    let _worker = place.worker(server.address, &[]);
    wait_for_better(&place.path("a.holo"), 1000);
    // A view of the even beams. Its weights are so small that nothing is traced for it, and filling
    // goes on.
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let mut shown = Samples::new();
    let beams = (0..7680)
        .step_by(2)
        .map(|number| RequestedBeam {
            key: beam(number),
            weight: 1e-5,
            held: 0,
            has_earlier: false,
        })
        .collect();
    let viewpoint = Viewpoint { eye: [2.7, 2.7, -2.0], radius: 1.0 };
    runtime.block_on(async {
        let (mut inbox, outbox, _) = join(server.address, Role::Display).await;
        outbox.send(FrameKind::View, &ViewRequest { view: 1, viewpoint, beams }.encode()).unwrap();
        let mut is_sent = false;
        let odd_are_better = || {
            let [even, odd] = most_paths_in_even_and_odd_beams(&samples(&place.path("a.holo")));
            odd > even
        };
        while !is_sent || !odd_are_better() {
            let message = tokio::time::timeout(LIMIT, inbox.next()).await;
            match message.expect("the server speaks twice a second").unwrap() {
                Message::Control(Control::Ping(number)) => {
                    outbox.control(&Control::Pong(number)).unwrap()
                }
                Message::Control(Control::StoredSent { .. }) => is_sent = true,
                Message::Samples(message) => {
                    let mut rest = message.samples.as_slice();
                    for run in &message.runs {
                        let key = run.key;
                        let (samples, after) = rest.split_at(run.count as usize);
                        rest = after;
                        for (number, sample) in (run.first..).zip(samples) {
                            let known = shown.insert((key, run.kind, number), (run.paths, *sample));
                            assert!(
                                known.is_none_or(|known| known == (run.paths, *sample)),
                                "{key:?} {number}"
                            );
                        }
                    }
                }
                _ => {}
            }
        }
        // The server ends while a display still looks.
        server.process.signal(Signal::TERM);
        while inbox.next().await.is_ok() {}
    });
    server.process.wait().ok();
    let stored = samples(&place.path("a.holo"));
    assert!(shown.len() > 5000, "{}", shown.len());
    let [even, odd] = most_paths_in_even_and_odd_beams(&stored);
    assert!(odd > even, "{even} paths in what was looked at, {odd} in the rest");
    let seen = stored.into_iter().filter(|((key, ..), _)| key.beam.0 % 2 == 0).collect();
    let plain = |samples: &Samples| {
        samples.iter().map(|(name, (_, sample))| (*name, *sample)).collect::<Vec<_>>()
    };
    assert!(
        plain(&seen) == plain(&shown),
        "what was shown is what the file has of the view's beams"
    );
    // All samples are sent with the same number of paths, so that displays weigh them equally.
    assert_eq!(by_paths(&shown).into_keys().collect::<Vec<_>>(), [1]);
}

/// The section's own arithmetic gives the same rays for better samples, not just the same number.
#[test]
fn a_samples_ray_does_not_depend_on_its_paths() {
    let place = Place::new();
    place.fill_small_with("a.holo", "45k", &["--enough", "20k"]);
    let stored = samples(&place.path("a.holo"));
    let file = holo_server::Holodeck::open_read_only(&place.path("a.holo"), 0).unwrap();
    let section: &Section = &file.sections[0];
    let mut beams = BTreeSet::new();
    for ((key, _, number), (paths, sample)) in &stored {
        let BeamKey { section: index, beam } = *key;
        let sampler = section.beam_sampler(index, beam, None).unwrap();
        assert_eq!(sampler.coords(*number), sample.coords, "{key:?} {number} of {paths} paths");
        beams.insert(beam);
    }
    assert!(beams.len() > 1000 && by_paths(&stored).contains_key(&4));
}
