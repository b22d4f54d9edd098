//! Drivers that keep their pixels from view to view. A stored holodeck fills them quickly, and at
//! rest they tend to `render`.

use std::collections::BTreeSet;

use holo_net::Message;
use holo_picture::{Picture, compare};
use holo_proto::{
    bulk::{RaysWanted, RequestedBeam, ViewRequest, WantedRay},
    control::Control,
    frame::FrameKind,
    hello::Role,
};
use holo_section::{RayCoords, SampleKind, Viewpoint};
use holo_tests::{CORNELL_SMALL_SECTION, LIMIT, Place, analytic::join, beam, patiently, stored};
use rustix::process::Signal;

const VIEW: [&str; 8] = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vh", "60", "--size", "64x64"];
const LINE: &str = "-vp 2.78 2.73 -2 -vd 0 0 1 -vh 60";
const STAGES: [&str; 4] =
    ["Project and Tile Sort", "Z-Buffer Tiles", "Depth Cull", "Interpolate / Smooth"];

/// The same view by the tracer, direct light only.
fn truth(place: &Place) -> Picture {
    let render = [
        "render",
        "--config",
        "{}/cornell.toml",
        "--bounces",
        "0",
        "--spp",
        "400",
        "-o",
        "{}/truth.pfm",
    ];
    place.run(&[&render[..], &VIEW].concat()).ok();
    Picture::read(place.path("truth.pfm")).unwrap()
}

fn psnr(place: &Place, name: &str, truth: &Picture) -> f64 {
    compare(&Picture::read(place.path(name)).unwrap(), truth).unwrap().psnr_disp
}

#[test]
fn at_rest_both_tend_to_what_the_tracer_renders() {
    let place = Place::new();
    let truth = truth(&place);
    for driver in ["pointimage", "frameless"] {
        let (reports, [first, last]) = patiently(
            |seconds| rest(&place, &truth, driver, seconds),
            |(_, [_, last])| *last > 26.0,
        );
        let end = &reports[reports.len() - 1];
        assert_eq!(end["driver"], driver);
        assert!(end["traced"].as_u64().unwrap() > 1000, "{end}");
        // The stages run for some picture. Nothing changes between some pictures, and these need
        // none.
        let has_all_stages = |report: &serde_json::Value| {
            let stages = report["stages"].as_array();
            let has = |name| stages.is_some_and(|all| all.iter().any(|one| one["stage"] == name));
            STAGES.into_iter().all(has)
        };
        assert_eq!(reports.iter().any(has_all_stages), driver == "pointimage", "{reports:?}");
        println!("{driver}: {first:.1} dB at once, {last:.1} dB at rest");
        assert!(last > first, "{driver}: {first} dB, then {last}");
        // A wrong pixel in twenty, or a blur of a pixel, would leave less.
        assert!(last > 26.0, "{driver}: {last} dB");
    }
}

/// Turns to a view and rests there for so many seconds. Returns the reports, and how near the first
/// and the last picture are to the truth, in dB.
fn rest(
    place: &Place,
    truth: &Picture,
    driver: &str,
    seconds: u32,
) -> (Vec<serde_json::Value>, [f64; 2]) {
    // Another view comes before: what it leaves behind must not stay.
    let script = format!(
        "0 view -vp 2.5 2.5 -2.5 -vd 0.1 0 1 -vh 60\n0.5 view {LINE}\n0.05 picture {{0}}\n\
         {seconds} picture {{1}}\nquit\n"
    );
    let names = ["first", "last"].map(|when| format!("{driver}-{when}.pfm"));
    let script =
        script.replace("{0}", &place.text(&names[0])).replace("{1}", &place.text(&names[1]));
    let script = place.write("walk.txt", &script);
    let scene = ["view", "--config", "{}/cornell.toml", "--section", CORNELL_SMALL_SECTION];
    let words = ["--bounces", "0", "--headless", "--script", &script, "--size", "64x64", "--json"];
    let ended = place.run(&[&scene[..], &words, &["--driver", driver]].concat()).ok();
    let reports = ended.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    (reports, names.map(|name| psnr(place, &name, truth)))
}

#[test]
fn a_stored_holodeck_warms_an_empty_cache_and_its_parts_can_be_left_out() {
    let place = Place::new();
    let truth = truth(&place);
    place.fill_small_with("a.holo", "400k", &["--bounces", "0"]);
    let show = |name: &str, words: &[&str]| {
        let output = place.text(name);
        let picture = ["picture", "{}/a.holo", "--json", "-o", &output];
        let report = place.run(&[&picture[..], &VIEW, words].concat()).ok().json();
        assert_eq!(report["traced"], 0);
        assert!(
            report["stored"].as_u64().unwrap() > 0 && report["samples"].as_u64().unwrap() > 0,
            "{report}"
        );
        psnr(&place, name, &truth)
    };
    let all = show("all.pfm", &["--driver", "pointimage"]);
    let gaps = [
        "--driver",
        "pointimage",
        "--without",
        "prefilter,interpolation",
        "--empty-pixels",
        "black",
    ];
    let bare = show("bare.pfm", &gaps);
    let guesses = show("guesses.pfm", &["--driver", "frameless"]);
    println!("all stages {all:.1} dB, points alone {bare:.1} dB, frameless {guesses:.1} dB");
    assert!(all > bare, "filling gaps does not help: {all} dB, {bare} dB without");
    let black = |name: &str| {
        let picture = Picture::read(place.path(name)).unwrap();
        picture.pixels.iter().filter(|pixel| **pixel == [0.0; 3]).count()
    };
    assert!(black("bare.pfm") > black("all.pfm"));
    place
        .run(&["picture", "{}/a.holo", "-o", "{}/b.pfm", "--without", "colour"])
        .failed(2, &["--without", "dither"]);
}

#[test]
fn single_rays_are_traced_as_they_were_asked_for_and_stored() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let server = place.server("a.holo", &["--json", "--no-skip-unseen"]);
    let worker = place.worker(server.address, &[]);
    // The rays belong to two beams, more of one than a packet holds, each once.
    let wanted: Vec<(u64, RayCoords)> = (0..100)
        .map(|i: u8| {
            (if i.is_multiple_of(4) { 400 } else { 2000 }, RayCoords([i, 200 - i, 3 * (i / 2), 7]))
        })
        .collect();
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let (mut inbox, outbox, _) = join(server.address, Role::Display).await;
        let beams = [400, 2000]
            .map(|number| RequestedBeam {
                key: beam(number),
                weight: 1.0,
                held: 0,
                has_earlier: false,
            })
            .to_vec();
        let viewpoint = Viewpoint { eye: [2.0, 2.0, -1.0], radius: 0.01 };
        let view = ViewRequest { view: 1, viewpoint, beams }.encode();
        outbox.send(FrameKind::View, &view).unwrap();
        let ray = |&(number, coords): &(u64, RayCoords)| WantedRay { key: beam(number), coords };
        let rays: Vec<WantedRay> = wanted.iter().map(ray).collect();
        // Rays of another view are ignored.
        let other = vec![WantedRay { coords: RayCoords([255; 4]), ..rays[0] }];
        outbox.send(FrameKind::Rays, &RaysWanted { view: 9, rays: other }.encode()).unwrap();
        outbox.send(FrameKind::Rays, &RaysWanted { view: 1, rays }.encode()).unwrap();
        let mut arrived = BTreeSet::new();
        while arrived.len() < wanted.len() {
            match tokio::time::timeout(LIMIT, inbox.next()).await.expect("all rays come").unwrap() {
                Message::Samples(samples) => {
                    for (run, samples) in
                        samples.iter().filter(|(run, _)| run.kind == SampleKind::SingleRay)
                    {
                        arrived
                            .extend(samples.iter().map(|sample| (run.key.beam.0, sample.coords)));
                    }
                }
                Message::Control(Control::Ping(number)) => {
                    outbox.control(&Control::Pong(number)).unwrap()
                }
                _ => {}
            }
        }
        assert_eq!(arrived, wanted.iter().copied().collect());
        // Then nothing is being traced for the view, and everything is on the disk.
        outbox.control(&Control::Settle { view: 1 }).unwrap();
        let settled = async {
            while inbox.next().await.unwrap() != Message::Control(Control::Settled { view: 1 }) {}
        };
        tokio::time::timeout(LIMIT, settled).await.expect("the view settles");
    });
    server.process.end(Signal::TERM).ok();
    worker.wait().ok();
    let stored = stored(&place.path("a.holo"));
    stored.assert_no_gaps();
    let single = stored.beams.iter().filter(|((_, kind), _)| *kind == SampleKind::SingleRay);
    let kept = single.flat_map(|((key, _), samples)| {
        samples.iter().map(|(_, sample)| (key.beam.0, sample.coords))
    });
    assert_eq!(kept.collect::<BTreeSet<_>>(), wanted.iter().copied().collect());
}

#[test]
fn rays_that_the_render_cache_requests_enter_the_holodeck() {
    let place = Place::new();
    let script = place.write("walk.txt", &format!("0 view {LINE}\n3 quit\n"));
    let scene = [
        "view",
        "--config",
        "{}/cornell.toml",
        "--section",
        CORNELL_SMALL_SECTION,
        "--bounces",
        "0",
    ];
    let words =
        ["--headless", "--script", &script, "--size", "64x64", "--keep", "{}/kept.holo", "-q"];
    place.run(&[&scene[..], &words, &["--driver", "pointimage"]].concat()).ok();
    let stored = stored(&place.path("kept.holo"));
    stored.assert_no_gaps();
    let of = |kind: SampleKind| {
        stored.beams.iter().filter(|((_, k), _)| *k == kind).map(|(_, s)| s.len()).sum::<usize>()
    };
    println!(
        "{} single rays, {} near the eye",
        of(SampleKind::SingleRay),
        of(SampleKind::ViewpointLimited)
    );
    // Each request covers 16 pixels, twenty times a second while the driver wishes for any. This is
    // more than a first list.
    assert!(of(SampleKind::SingleRay) > 256);
}
