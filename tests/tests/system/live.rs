//! Pixels that no section covers: traced for the view alone while workers trace, and never stored.

use std::collections::BTreeSet;

use holo_net::{Inbox, Message, Outbox};
use holo_picture::{Picture, View, ViewSpec};
use holo_proto::{
    bulk::{
        LiveHit, LivePacket, LiveRay, LiveResults, LiveWanted, LiveWork, MAX_LIVE_RAYS,
        MAX_LIVE_RAYS_HELD, RequestedBeam, TracedPacket, ViewRequest,
    },
    control::Control,
    frame::FrameKind,
    hello::Role,
};
use holo_section::{Section, Viewpoint};
use holo_tests::{LIMIT, Place, analytic::join, beam, stored};
use rustix::process::Signal;

/// The left half of the space before the box.
const LEFT: &str = "0.6,0.6,-4 2,0,0 0,4.2,0 0,0,5 2,4,4";

/// The eye is beside the section and looks past it into the box.
const LINE: &str = "-vp 3.4 2.73 -3 -vd 0 0 1 -vu 0 1 0 -vh 60";
const VIEW: [&str; 8] = ["--vp", "3.4,2.73,-3", "--vd", "0,0,1", "--vh", "60", "--size", "64x48"];
const SIZE: (u32, u32) = (64, 48);

fn view() -> View {
    let mut spec = ViewSpec::default();
    spec.apply_line(LINE).unwrap();
    spec.resolve(SIZE).unwrap().0
}

/// Returns for each pixel whether some section of a file covers its middle.
fn covered(place: &Place, file: &str) -> Vec<bool> {
    let holodeck = holo_server::Holodeck::open_read_only(&place.path(file), 0).unwrap();
    let (sections, view): (&[Section], View) = (&holodeck.sections, view());
    let pixels = (0..SIZE.1)
        .flat_map(|row| (0..SIZE.0).map(move |column| View::pixel_centre(SIZE, column, row)));
    let rays = pixels.map(|(x, y)| view.ray(x, y));
    rays.map(|(eye, along)| sections.iter().any(|section| section.line(eye, along).is_some()))
        .collect()
}

fn read(place: &Place, name: &str) -> Picture {
    Picture::read(place.path(name)).unwrap()
}

/// Returns the mean of the squared errors of display values of some pixels: cut at white, square
/// root.
fn error(picture: &Picture, truth: &Picture, of: impl Fn(usize) -> bool) -> f64 {
    let value = |x: f32| f64::from(x.clamp(0.0, 1.0)).sqrt();
    let pixels =
        picture.pixels.iter().zip(&truth.pixels).enumerate().filter(|(pixel, _)| of(*pixel));
    let errors =
        pixels.flat_map(|(_, (a, b))| (0..3).map(move |i| (value(a[i]) - value(b[i])).powi(2)));
    let (sum, count) = errors.fold((0.0, 0.0), |(sum, count), error| (sum + error, count + 1.0));
    sum / count
}

/// Returns whether a pixel differs from one beside it by more than a tenth of the display's range.
fn is_edge(picture: &Picture, pixel: usize) -> bool {
    let (column, row) = (pixel as u32 % SIZE.0, pixel as u32 / SIZE.0);
    let value = |rgb: [f32; 3]| rgb.map(|x| x.clamp(0.0, 1.0).sqrt());
    let own = value(picture.pixels[pixel]);
    let beside = |column: u32, row: u32| picture.get(column, row).map_or(own, value);
    let rows = row.saturating_sub(1)..=row + 1;
    let mut around = rows
        .flat_map(|row| (column.saturating_sub(1)..=column + 1).map(move |column| (column, row)));
    around
        .any(|(column, row)| beside(column, row).iter().zip(own).any(|(a, b)| (a - b).abs() > 0.1))
}

#[test]
fn pixels_that_no_section_covers_are_as_good_as_render_and_no_sample_is_stored_for_them() {
    let place = Place::new();
    let render = |spp: u64, seed: &str, name: &str| {
        let (spp, output) = (spp.to_string(), place.text(name));
        let words = [
            "render",
            "--config",
            "{}/cornell.toml",
            "--bounces",
            "0",
            "--spp",
            &spp,
            "-o",
            &output,
        ];
        place.run(&[&words[..], &["--seed", seed, "-q"], &VIEW].concat()).ok();
        read(&place, name)
    };
    let truth = render(2000, "1", "truth.pfm");
    for driver in ["surfaces", "quadtree"] {
        let file = format!("{{}}/{driver}.holo");
        let scene = [
            "view",
            "--config",
            "{}/cornell.toml",
            "--section",
            LEFT,
            "--bounces",
            "0",
            "--keep",
            &file,
        ];
        let words = [
            "--headless",
            "--time",
            "2.5",
            "-o",
            "{}/live.pfm",
            "--json",
            "--driver",
            driver,
            "--threads",
            "1",
        ];
        let report = place.run(&[&scene[..], &words, &VIEW].concat()).ok().json();
        let file = format!("{driver}.holo");
        let covered = covered(&place, &file);
        let uncovered = covered.iter().filter(|covered| !**covered).count();
        assert!(
            (1500..2500).contains(&uncovered),
            "{uncovered}: the view should be covered in part"
        );
        assert_eq!(report["uncovered_pixels"], uncovered);
        // The file holds what was traced of beams, and nothing else. Samples that are traced while
        // the display changes its request reach it from the file.
        let [traced, stored_before] = ["traced", "stored"].map(|key| report[key].as_u64().unwrap());
        assert!(traced > 1000, "{report}");
        let in_file = traced + stored_before;
        assert_eq!(in_file, stored(&place.path(&file)).count() as u64, "{report}");

        // The picture is as good as that of `render` with so many rays a pixel. There are 1,500
        // pixels, whose effective number is a third, because their errors have heavy tails. At 4.5
        // standard deviations of its logarithm, a mean square is then 1.5 times another.
        let rays = report["live"].as_u64().unwrap() / uncovered as u64;
        assert!(rays >= 4, "{report}");
        let live = read(&place, "live.pfm");
        // The quadtree keeps four depths of a pixel. These are too few at the edges of things seen
        // from the side, whether covered or not.
        let is_compared =
            |pixel: usize| !covered[pixel] && (driver == "surfaces" || !is_edge(&truth, pixel));
        let same = render(rays, "2", "same.pfm");
        let [shown, same] = [&live, &same].map(|picture| error(picture, &truth, is_compared));
        println!(
            "{driver}: {rays} rays a pixel, squared error {shown:.2e}, of `render` {same:.2e}"
        );
        // A step of 1/255 is allowed besides noise. It is invisible; drivers interpolate and keep
        // no more.
        assert!(shown < 1.5 * same + 255.0_f64.powi(-2), "{driver}: {shown:e}, {same:e}");

        // In a replay, covered pixels are the same bit by bit. The others are interpolated over
        // surfaces like theirs, or black without the scene.
        let file = format!("{{}}/{driver}.holo");
        let replay = ["picture", &file, "-o", "{}/replay.pfm", "--json", "--driver", driver];
        let again = place.run(&[&replay[..], &VIEW].concat()).ok().json();
        assert_eq!((&again["live"], &again["stored"]), (&0.into(), &in_file.into()));
        let replayed = read(&place, "replay.pfm");
        let mut black = 0;
        for (pixel, (before, after)) in live.pixels.iter().zip(&replayed.pixels).enumerate() {
            assert!(!covered[pixel] || before == after, "{driver}: pixel {pixel}");
            black += usize::from(!covered[pixel] && *after == [0.0; 3]);
        }
        assert_eq!(black == uncovered, driver == "quadtree", "{driver}: {black} of {uncovered}");
    }
}

#[test]
fn without_workers_a_session_ends_as_it_would_and_shows_nothing_there() {
    let place = Place::new();
    let fill = [
        "fill",
        "--config",
        "{}/cornell.toml",
        "--section",
        LEFT,
        "-o",
        "{}/a.holo",
        "--samples",
        "20k",
    ];
    place.run(&fill).ok();
    let server = place.server("a.holo", &["--json"]);
    let output = place.text("a.pfm");
    let words = ["--time", "1", "-o", &output, "--json", "--driver", "quadtree"];
    let report = place.viewer(server.address, &[&words[..], &VIEW].concat()).wait().ok().json();
    assert_eq!((&report["live"], &report["traced"]), (&0.into(), &0.into()));
    let covered = covered(&place, "a.holo");
    let picture = read(&place, "a.pfm");
    assert!(picture.pixels.iter().zip(&covered).all(|(rgb, covered)| *covered || *rgb == [0.0; 3]));
    assert_eq!(server.process.end(Signal::TERM).ok().json()["added"], 0);
}

/// Runs a future to its end, within the time limit.
fn in_time(what: impl Future<Output = ()>) {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        tokio::time::timeout(2 * LIMIT, what).await.expect("it takes far too long")
    });
}

/// A peer that speaks the protocol.
struct Peer {
    inbox: Inbox,
    outbox: Outbox,
    /// Live rays that arrived while another message was waited for.
    live: Vec<(u32, u64, LiveHit)>,
}

impl Peer {
    async fn join(address: std::net::SocketAddr, role: Role) -> Peer {
        let (inbox, outbox, _) = join(address, role).await;
        Peer { inbox, outbox, live: Vec::new() }
    }

    fn send(&self, kind: FrameKind, payload: Vec<u8>) {
        self.outbox.send(kind, &payload).unwrap();
    }

    /// Looks at one beam, for which some fifty rays are dealt and no more, because workers here do
    /// not trace.
    fn look(&self, view: u32) {
        let beams =
            vec![RequestedBeam { key: beam(400), weight: 0.05, held: 0, has_earlier: false }];
        let viewpoint = Viewpoint { eye: [2.0, 2.0, -1.0], radius: 0.01 };
        self.send(FrameKind::View, ViewRequest { view, viewpoint, beams }.encode());
    }

    fn ask(&self, view: u32, rays: &[LiveRay]) {
        self.send(
            FrameKind::LiveWanted,
            LiveWanted { view, pixels: 50, rays: rays.to_vec() }.encode(),
        );
    }

    async fn next(&mut self) -> Message {
        loop {
            let message =
                tokio::time::timeout(LIMIT, self.inbox.next()).await.expect("in time").unwrap();
            match message {
                Message::Control(Control::Ping(number)) => {
                    self.outbox.control(&Control::Pong(number)).unwrap()
                }
                Message::LiveSamples(samples) => {
                    let numbered = samples
                        .samples
                        .iter()
                        .map(|sample| (samples.view, sample.number, sample.hit));
                    self.live.extend(numbered);
                    return Message::LiveSamples(samples);
                }
                message => return message,
            }
        }
    }

    /// Waits until every stored sample of a view has been sent.
    async fn wait_for_stored(&mut self, view: u32) {
        while self.next().await != Message::Control(Control::StoredSent { view }) {}
    }

    /// Waits until `count` live rays have arrived in total.
    async fn wait_for_live(&mut self, count: usize) {
        while self.live.len() < count {
            self.next().await;
        }
    }

    /// Returns the next `rays` live rays for this worker, and whether packets of beams arrived too.
    async fn live_work(&mut self, rays: usize) -> (Vec<LivePacket>, bool) {
        let (mut packets, mut beams): (Vec<LivePacket>, bool) = (Vec::new(), false);
        while packets.iter().map(|packet| packet.rays.len()).sum::<usize>() < rays {
            match self.next().await {
                Message::LiveWork(LiveWork { packets: more }) => packets.extend(more),
                Message::Work(work) => beams |= !work.packets.is_empty(),
                _ => {}
            }
        }
        (packets, beams)
    }

    fn answer(&self, packets: &[LivePacket]) {
        let mut results = LiveResults::default();
        for packet in packets {
            results.packets.push(TracedPacket {
                id: packet.id,
                count: packet.rays.len() as u32,
                nanoseconds: 50_000,
            });
            results.hits.extend(packet.rays.iter().map(saw));
        }
        self.send(FrameKind::LiveResults, results.encode());
    }
}

fn saw(ray: &LiveRay) -> LiveHit {
    LiveHit { radiance: [ray.number as f32, 0.5, 0.0], distance: 1.0 + ray.number as f32 }
}

/// Rays from places that are farther from the box than the distance of their stated hits.
fn rays(numbers: std::ops::Range<u64>) -> Vec<LiveRay> {
    numbers
        .map(|number| LiveRay {
            origin: [-2.0 * number as f64, 2.0, 3.0],
            direction: [0.0, 0.6, 0.8],
            number,
        })
        .collect()
}

fn numbers(packets: &[LivePacket]) -> Vec<u64> {
    let mut numbers: Vec<u64> =
        packets.iter().flat_map(|packet| &packet.rays).map(|ray| ray.number).collect();
    numbers.sort_unstable();
    numbers
}

#[test]
fn live_rays_survive_their_worker_go_to_who_asked_alone_and_end_with_the_view() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let server = place.server("a.holo", &["--json", "--no-skip-unseen"]);
    in_time(async {
        let mut display = Peer::join(server.address, Role::Display).await;
        let mut other = Peer::join(server.address, Role::Display).await;
        display.look(1);
        other.look(1);
        display.ask(9, &rays(900..950));
        // Another view's rays take their places; if a view is requested again, it keeps them.
        display.ask(1, &rays(0..50));
        display.look(2);
        // The server has dealt with all of the above. Otherwise, the worker could get beams only.
        display.wait_for_stored(2).await;
        other.wait_for_stored(1).await;

        // This worker takes all of them and dies.
        let mut first = Peer::join(server.address, Role::Worker).await;
        first.outbox.control(&Control::Ready { threads: 1 }).unwrap();
        let (packets, beams) = first.live_work(50).await;
        assert_eq!(
            numbers(&packets),
            (0..50).collect::<Vec<u64>>(),
            "of the present view, each once"
        );
        assert!(
            packets.iter().all(|packet| packet.paths == 1 && (1..=21).contains(&packet.rays.len()))
        );
        assert!(beams || matches!(first.next().await, Message::Work(_)), "beams are traced, too");
        drop(first);

        // Another worker gets them again, and the results go to the display that asked. It has
        // enough threads to get more work before it has answered.
        let mut worker = Peer::join(server.address, Role::Worker).await;
        worker.outbox.control(&Control::Ready { threads: 8 }).unwrap();
        let (packets, _) = worker.live_work(50).await;
        assert_eq!(numbers(&packets), (0..50).collect::<Vec<u64>>());
        worker.answer(&packets[..1]);
        let known = packets[0].rays.len();
        display.wait_for_live(known).await;

        // With a new view, the other rays have no use any more.
        display.ask(1, &rays(50..60));
        let (late, _) = worker.live_work(10).await;
        display.look(3);
        display.ask(3, &rays(100..105));
        let (packets_3, _) = worker.live_work(5).await;
        assert_eq!(numbers(&packets_3), (100..105).collect::<Vec<u64>>());
        worker.answer(&packets[1..]);
        worker.answer(&late);
        worker.answer(&packets_3);
        display.wait_for_live(known + 5).await;
        let expected = |view: u32, packet: &LivePacket| {
            packet
                .rays
                .iter()
                .map(|ray| (view, ray.number, saw(ray).distance as u64))
                .collect::<BTreeSet<_>>()
        };
        let came: BTreeSet<_> =
            display.live.iter().map(|(view, n, hit)| (*view, *n, hit.distance as u64)).collect();
        let mut wanted = expected(1, &packets[0]);
        packets_3.iter().for_each(|packet| wanted.extend(expected(3, packet)));
        assert_eq!((display.live.len(), came), (known + 5, wanted));

        // A display that settles waits for no live ray.
        display.ask(3, &rays(200..210));
        worker.live_work(10).await;
        display.outbox.control(&Control::Settle { view: 3 }).unwrap();
        other.outbox.control(&Control::Settle { view: 1 }).unwrap();
        // The packets of beams are lost with the worker.
        drop(worker);
        while !matches!(display.next().await, Message::Control(Control::Settled { view: 3 })) {}
        while !matches!(other.next().await, Message::Control(Control::Settled { view: 1 })) {}
        assert_eq!(other.live, [], "rays that it did not ask for");
    });
    let summary = server.process.end(Signal::TERM).ok().json();
    assert_eq!(summary["added"], 0, "nothing of it is stored");
}

#[test]
fn a_display_that_asks_for_more_than_may_wait_is_dropped() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let server = place.server("a.holo", &[]);
    in_time(async {
        let mut display = Peer::join(server.address, Role::Display).await;
        display.look(1);
        let most = rays(0..MAX_LIVE_RAYS as u64);
        for _ in 0..MAX_LIVE_RAYS_HELD / MAX_LIVE_RAYS {
            display.ask(1, &most);
        }
        // Those of another view take their places.
        for _ in 0..MAX_LIVE_RAYS_HELD / MAX_LIVE_RAYS {
            display.ask(2, &most);
        }
        // The answer comes after the server has dealt with all of the above. The server has dropped
        // no one.
        display.look(2);
        display.wait_for_stored(2).await;
        display.ask(2, &most[..1]);
        let reason = loop {
            if let Message::Control(Control::Bye(farewell)) = display.next().await {
                break farewell.to_string();
            }
        };
        assert!(reason.contains("live rays at a time"), "{reason}");
    });
    server.process.end(Signal::TERM).ok();
}

/// Tests rays through pixels of a view, using only the protocol, against `render` of the same
/// pixels, with their measured variance.
#[test]
fn what_live_rays_see_has_the_mean_that_render_has() {
    const PIXELS: (u32, u32) = (16, 12);
    const RAYS: u64 = 512;
    let place = Place::new();
    let fill = [
        "fill",
        "--config",
        "{}/cornell.toml",
        "--section",
        LEFT,
        "-o",
        "{}/a.holo",
        "--samples",
        "1k",
    ];
    place.run(&fill).ok();
    let render =
        ["render", "--config", "{}/cornell.toml", "--spp", "4096", "-o", "{}/truth.pfm", "-q"];
    place.run(&[&render[..], &VIEW[..6], &["--size", "16x12"]].concat()).ok();
    let truth = read(&place, "truth.pfm");
    let mut spec = ViewSpec::default();
    spec.apply_line(LINE).unwrap();
    let (view, size) = spec.resolve(PIXELS).unwrap();
    assert_eq!(size, PIXELS);
    let count = u64::from(PIXELS.0 * PIXELS.1);
    // Spread over each pixel by the two golden steps.
    let ray = |number: u64| {
        let (round, pixel) = (number / count, number % count);
        let at = |step: f64| (0.5 + step * round as f64 + 0.37 * pixel as f64).fract();
        let (column, row) =
            ((pixel % 16) as f64 + at(0.754_877_666), (pixel / 16) as f64 + at(0.569_840_29));
        let (origin, direction) = view.ray(column / 16.0, 1.0 - row / 12.0);
        LiveRay { origin: origin.to_array(), direction: direction.to_array(), number }
    };
    let mut sums = vec![(0.0, 0.0); count as usize];
    let server = place.server("a.holo", &[]);
    let worker = place.worker(server.address, &[]);
    in_time(async {
        let mut display = Peer::join(server.address, Role::Display).await;
        display.look(1);
        for first in (0..RAYS * count).step_by(MAX_LIVE_RAYS) {
            let last = (first + MAX_LIVE_RAYS as u64).min(RAYS * count);
            display.ask(1, &(first..last).map(ray).collect::<Vec<_>>());
            display.wait_for_live(last as usize).await;
        }
        for (_, number, hit) in &display.live {
            let [r, g, b] = hit.radiance.map(f64::from);
            let luminance = 0.2126 * r + 0.7152 * g + 0.0722 * b;
            let sum = &mut sums[(number % count) as usize];
            *sum = (sum.0 + luminance, sum.1 + luminance * luminance);
        }
        assert_eq!(display.live.len() as u64, RAYS * count);
    });
    server.process.end(Signal::TERM).ok();
    worker.wait().ok();
    // The sum of squares of standardised differences follows chi-squared with as many degrees of
    // freedom as pixels. It may lie below, because stratification makes true variances smaller than
    // assumed. Six standard deviations above its mean: a chance of less than 10⁻⁶.
    let mut chi_squared = 0.0;
    let mut differing = 0.0;
    for (sum, rgb) in sums.iter().zip(&truth.pixels) {
        let mean = sum.0 / RAYS as f64;
        let variance = (sum.1 / RAYS as f64 - mean * mean) * (1.0 / RAYS as f64 + 1.0 / 4096.0);
        let [r, g, b] = rgb.map(f64::from);
        let expected = 0.2126 * r + 0.7152 * g + 0.0722 * b;
        // A lamp's own pixels have no variance except that of rounding.
        if variance > 1e-6 * expected * expected {
            chi_squared += (mean - expected).powi(2) / variance;
            differing += 1.0;
        }
    }
    println!("chi-squared {chi_squared:.1} of {differing} pixels");
    assert!(differing > 150.0 && chi_squared > 0.2 * differing);
    assert!(
        chi_squared < differing + 6.0 * (2.0_f64 * differing).sqrt(),
        "{chi_squared} of {differing}"
    );
}
