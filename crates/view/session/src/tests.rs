//! Tests of a session's requests to the server.

use std::{
    collections::BTreeMap,
    net::SocketAddr,
    sync::Arc,
    time::{Duration, Instant},
};

use glam::DVec3;
use holo_display::{Driver, FrameRequest, ObjectMotion, SkyView};
use holo_driver_surfaces::surfaces_driver;
use holo_net::{Message, Outbox, Shutdown, accept};
use holo_picture::ViewSpec;
use holo_proto::{
    LEAST_TRACED_WEIGHT,
    bulk::{BlobChunk, SampleSource, ViewRequest, ViewSamples},
    control::{Control, SceneInfo, Welcome},
    frame::FrameKind,
};
use holo_scene::{Material, Scene};
use holo_section::{BeamKey, NumberRun, Sample, SampleKind, Section, SectionSpec, ViewClass};
use tokio::{net::TcpListener, time::timeout};

use super::{
    Connected, DriverArg, DriverChoice, EyeVelocity, HazeOption, LoadedScene, SceneUse, Session,
};
pub(crate) use server::LIMIT;
use server::welcome;

mod server;

/// A cube of side 5 with a section of side 4 in its middle, and its packed scene.
fn room(tracing: bool) -> (Welcome, Vec<u8>) {
    let corner =
        |n: u32| DVec3::from_array([n & 1, n >> 1 & 1, n >> 2].map(|n| f64::from(n) * 5.0));
    let positions: Vec<DVec3> = (0..8).map(corner).collect();
    let sides =
        [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]];
    let triangles: Vec<[u32; 3]> =
        sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let materials = vec![Material::grey("walls")];
    let made = Scene::from_world(&positions, &triangles, &[0; 12], materials, [0.0; 3]);
    let packed = made.unwrap().0.pack();
    let section = SectionSpec {
        origin: [0.5; 3],
        axes: [[4.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 0.0, 4.0]],
        grid: [12; 3],
        class: ViewClass::Interior,
        obstructions: false,
    };
    let scene = SceneInfo { bytes: packed.len() as u64, hash: Scene::content_hash(&packed) };
    (Welcome { sections: vec![section], scene, tracing, samples: 0, ..welcome() }, packed)
}

/// Requests of a display.
#[derive(Default)]
pub(crate) struct Requests {
    /// Its views, by number.
    views: BTreeMap<u32, ViewRequest>,
    /// The first beam of each part that it loaded, and the number of its last view by then.
    parts: Vec<(u64, u32)>,
    /// How many of them it wanted as the file was when it settled.
    settled_parts: usize,
}

/// Serves a display as [`serve_file`] does, and traces.
pub(crate) async fn serve(listener: TcpListener) -> Requests {
    serve_file(listener, true).await
}

/// Serves a display that finds no samples in the file, which has three parts. Returns the display's
/// requests once it has left.
async fn serve_file(listener: TcpListener, tracing: bool) -> Requests {
    let (room, packed) = room(tracing);
    let (mut inbox, outbox, ..) = accept(listener.accept().await.unwrap().0).await.unwrap();
    holo_net::welcome(&outbox, room).unwrap();
    let mut requests = Requests::default();
    let mut answer = |outbox: &Outbox, message| match message {
        Message::Control(Control::SceneWanted) => {
            let piece = BlobChunk { offset: 0, bytes: packed.clone() };
            outbox.send(FrameKind::BlobChunk, &piece.encode()).unwrap();
        }
        Message::View(view) => {
            outbox.control(&Control::StoredSent { view: view.view }).unwrap();
            requests.views.insert(view.view, view);
        }
        Message::Control(Control::PartWanted { section, first, as_settled, .. }) => {
            requests.settled_parts += usize::from(as_settled);
            let next = (first < 2).then_some(first + 1);
            outbox.control(&Control::PartSent { section, next }).unwrap();
            let last = requests.views.last_key_value().map_or(0, |(&number, _)| number);
            requests.parts.push((first, last));
        }
        Message::Control(Control::Settle { view }) => {
            outbox.control(&Control::Settled { view }).unwrap();
        }
        _ => {}
    };
    while let Ok(message) = timeout(LIMIT, inbox.next()).await.unwrap() {
        answer(&outbox, message);
    }
    requests
}

/// The driver `surfaces`, without a denoiser, and the haze in which it is shown.
struct Surfaces(Option<HazeOption>);

impl DriverChoice for Surfaces {
    fn go_on(&self, _motions: &[ObjectMotion]) {}

    fn forget(&self) {}

    fn scene_use(&self) -> SceneUse {
        SceneUse::Required
    }

    fn make(
        &self,
        sections: &Arc<[Section]>,
        _: SkyView,
        _: f64,
        scene: Option<&LoadedScene>,
    ) -> Driver {
        let raycaster = Arc::clone(&scene.unwrap().raycaster);
        surfaces_driver(Arc::clone(sections), raycaster, None)
    }

    fn haze(&self) -> Option<HazeOption> {
        self.0
    }

    fn choose(&mut self, driver: DriverArg) {
        panic!("{driver:?} is not there");
    }

    fn switch(&mut self, part: &str, _: bool) {
        panic!("there is no part {part}");
    }

    fn to_boxed(&self) -> Box<dyn DriverChoice> {
        Box::new(Surfaces(self.0))
    }
}

/// Connects to this server, with the driver `surfaces`.
pub(crate) async fn connect(address: SocketAddr) -> Connected {
    Connected::new(address, Box::new(Surfaces(None)), false, Shutdown::new()).await.unwrap()
}

/// Does something with a session of this driver, which a server serves that traces. Returns the
/// result and the display's requests.
pub(crate) async fn in_session<T: Send + 'static>(
    act: impl FnOnce(&mut Session) -> T + Send + 'static,
) -> (T, Requests) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let serving = tokio::spawn(serve(listener));
    let connected = connect(address).await;
    let acting = tokio::task::spawn_blocking(move || {
        let mut session = connected.begin(|_| {}).unwrap().unwrap();
        act(&mut session)
    });
    let result = timeout(LIMIT, acting).await.unwrap().unwrap();
    (result, timeout(LIMIT, serving).await.unwrap().unwrap())
}

/// A view that is not parallel to an axis.
fn view() -> ViewSpec {
    let mut spec = ViewSpec::default();
    spec.apply_line("-vp 2.5 2.5 2.5 -vd 1 .2 .1 -vu 0 0 1 -vh 60").unwrap();
    spec
}

/// Shows a view at rest.
fn show(session: &mut Session, spec: &ViewSpec, size: (u32, u32)) {
    let (view, size) = spec.resolve(size).unwrap();
    session.look(FrameRequest { view, size, is_moving: false }).unwrap();
}

#[tokio::test(flavor = "multi_thread")]
async fn a_view_at_another_size_begins_no_view_anew() {
    let (first_request, _) = in_session(|session| {
        for size in [(240, 180), (480, 360)] {
            show(session, &view(), size);
            let frame = session.draw().0.unwrap();
            assert_eq!(frame.picture.size(), size);
            session.wait(Instant::now() + Duration::from_millis(10)).unwrap();
        }
        session.current.as_ref().unwrap().first_request
    })
    .await;
    assert_eq!(first_request, 1, "the second size belongs to the first view");
}

#[tokio::test(flavor = "multi_thread")]
async fn beams_that_end_on_visible_surfaces_are_requested_by_use_and_then_only_the_view_s_own() {
    let ((), requests) = in_session(|session| {
        show(session, &view(), (96, 72));
        assert!(!session.has_stored());
        let end = Instant::now() + LIMIT;
        while !session.has_stored() && Instant::now() < end {
            session.wait(Instant::now() + Duration::from_millis(10)).unwrap();
        }
    })
    .await;
    let views = requests.views;
    let beams = |view: u32| -> BTreeMap<BeamKey, f32> {
        views[&view].beams.iter().map(|beam| (beam.key, beam.weight)).collect()
    };
    let own = beams(1);
    let others = |view| -> BTreeMap<BeamKey, f32> {
        let all = beams(view);
        assert!(own.iter().all(|(key, weight)| all.get(key) == Some(weight)));
        all.into_iter().filter(|(key, _)| !own.contains_key(key)).collect()
    };
    let (quick, thorough) = (others(2), others(3));
    assert!((5000..=20_000).contains(&quick.len()), "{}", quick.len());
    assert!(2 * thorough.len() > 3 * quick.len(), "{}", thorough.len());
    // The thorough search shows how good the quick one was.
    let mean = |beams: &BTreeMap<BeamKey, f32>| {
        let weights = beams.keys().filter_map(|key| thorough.get(key));
        weights.sum::<f32>() / beams.len() as f32
    };
    assert!(mean(&quick) > mean(&thorough), "{} {}", mean(&quick), mean(&thorough));
    let useful = thorough.values().fold((1.0_f32, 0.0_f32), |(a, b), &w| (a.min(w), b.max(w)));
    assert!(1.5 * useful.0 < useful.1, "{useful:?}");
    // Nothing is traced for them.
    assert!(thorough.values().all(|&weight| weight > 0.0 && weight < LEAST_TRACED_WEIGHT));
    assert_eq!(views.keys().copied().collect::<Vec<_>>(), [1, 2, 3, 4]);
    assert_eq!(beams(4), own);
}

#[tokio::test(flavor = "multi_thread")]
async fn an_idle_session_loads_the_whole_file_and_later_views_search_for_nothing() {
    let ((), Requests { views, parts, .. }) = in_session(|session| {
        let end = Instant::now() + LIMIT;
        let wait_until = |session: &mut Session, is_done: fn(&Session) -> bool| {
            while !is_done(session) && Instant::now() < end {
                session.wait(Instant::now() + Duration::from_millis(10)).unwrap();
            }
        };
        show(session, &view(), (96, 72));
        wait_until(session, Session::has_stored);
        wait_until(session, Session::has_whole_file);
        let mut aside = view();
        aside.apply_line("-vd -1 .2 .1").unwrap();
        show(session, &aside, (96, 72));
        session.wait(Instant::now() + Duration::from_millis(10)).unwrap();
        wait_until(session, Session::has_stored);
    })
    .await;
    // Two searches, the view's own beams again, the file, and then another view.
    assert_eq!(parts, [(0, 4), (1, 4), (2, 4)]);
    assert_eq!(views.keys().copied().collect::<Vec<_>>(), [1, 2, 3, 4, 5]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_settling_session_loads_the_file_again_only_if_something_may_have_been_traced() {
    for (tracing, parts) in [(true, 6), (false, 3)] {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let address = listener.local_addr().unwrap();
        let serving = tokio::spawn(serve_file(listener, tracing));
        let connected = connect(address).await;
        let looking = tokio::task::spawn_blocking(move || {
            let mut session = connected.begin(|_| {}).unwrap().unwrap();
            show(&mut session, &view(), (96, 72));
            let end = Instant::now() + LIMIT;
            while !session.has_whole_file() && Instant::now() < end {
                session.wait(Instant::now() + Duration::from_millis(10)).unwrap();
            }
            session.settle(true).unwrap();
        });
        timeout(LIMIT, looking).await.unwrap().unwrap();
        let requests = timeout(LIMIT, serving).await.unwrap().unwrap();
        assert_eq!(requests.parts.len(), parts, "tracing: {tracing}");
        // A file that grows faster than it arrives does not keep the session from settling.
        assert_eq!(requests.settled_parts, if tracing { 3 } else { 0 });
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn frames_and_parts_of_pictures_are_shown_in_the_same_haze() {
    let ((), _) = in_session(|session| {
        show(session, &view(), (48, 36));
        // Three scene units.
        let unit = session.welcome.unit;
        let mut draw = |haze: Option<&str>| {
            session.choice = Box::new(Surfaces(haze.map(|haze| haze.parse().unwrap())));
            let frame = session.draw().0.unwrap();
            let look = session.current.as_ref().unwrap().look;
            let plan = session.plan_parts(&look).unwrap();
            (frame, session.draw_part(&plan, 0..48, 0..36).unwrap())
        };
        let (clear, clear_part) = draw(None);
        let (hazy, hazy_part) = draw(Some(&format!("{},1,2,4", 3.0 * unit)));
        assert_eq!(clear.depth, hazy.depth);
        let mut known = 0;
        for (at, depth) in clear.depth.iter().enumerate().filter(|(_, depth)| **depth > 0.0) {
            let left = (-depth / 3.0).exp();
            for (clear, hazy) in [(&clear.picture, &hazy.picture), (&clear_part, &hazy_part)] {
                for (channel, haze) in [1.0, 2.0, 4.0].into_iter().enumerate() {
                    let expected = clear.pixels[at][channel] * left + haze * (1.0 - left);
                    let shown = hazy.pixels[at][channel];
                    assert!((shown - expected).abs() < 1e-3 * expected, "{shown} {expected}");
                }
            }
            known += 1;
        }
        assert!(known > 1000, "{known}");
    })
    .await;
}

/// Serves a display whose eye moves. A view's samples leave only after the next view was requested,
/// and the message that all stored samples were sent only if `completes`. Returns the number of
/// views.
async fn serve_late(listener: TcpListener, completes: bool) -> u32 {
    let (room, packed) = room(true);
    let (mut inbox, outbox, ..) = accept(listener.accept().await.unwrap().0).await.unwrap();
    holo_net::welcome(&outbox, room).unwrap();
    let mut views = 0;
    while let Ok(message) = timeout(LIMIT, inbox.next()).await.unwrap() {
        match message {
            Message::Control(Control::SceneWanted) => {
                let piece = BlobChunk { offset: 0, bytes: packed.clone() };
                outbox.send(FrameKind::BlobChunk, &piece.encode()).unwrap();
            }
            Message::View(ViewRequest { view, ref beams, .. }) if view > views => {
                if views > 0 {
                    let (key, kind) = (beams[0].key, SampleKind::Uniform);
                    let run = NumberRun { key, kind, first: 21 * view, count: 21, paths: 1 };
                    let samples = vec![Sample::default(); 21];
                    let source = SampleSource::Traced;
                    let late = ViewSamples { view: views, source, runs: vec![run], samples };
                    outbox.send(FrameKind::Samples, &late.encode()).unwrap();
                }
                if completes {
                    outbox.control(&Control::StoredSent { view }).unwrap();
                }
                views = view;
            }
            _ => {}
        }
    }
    views
}

/// Turns the eye until `is_done`, with a server of [`serve_late`]. Returns the number of requested
/// views and the number of samples that have arrived.
async fn turn(completes: bool, is_done: fn(&Session) -> bool) -> (u32, u64) {
    let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
    let address = listener.local_addr().unwrap();
    let serving = tokio::spawn(serve_late(listener, completes));
    let connected = connect(address).await;
    let turning = tokio::task::spawn_blocking(move || {
        let mut session = connected.begin(|_| {}).unwrap().unwrap();
        session.set_motion(Some(EyeVelocity::default()));
        let start = Instant::now();
        while !is_done(&session) && start.elapsed() < LIMIT / 2 {
            let mut turned = view();
            let aside = start.elapsed().as_secs_f64().sin();
            turned.apply_line(&format!("-vd 1 {aside} .1")).unwrap();
            let (view, size) = turned.resolve((96, 72)).unwrap();
            session.look(FrameRequest { view, size, is_moving: true }).unwrap();
            session.wait(Instant::now() + Duration::from_millis(10)).unwrap();
        }
        (start.elapsed(), session.samples_here())
    });
    let (took, arrived) = timeout(LIMIT, turning).await.unwrap().unwrap();
    let views = timeout(LIMIT, serving).await.unwrap().unwrap();
    // The server is asked no more often than this, however slow the machine.
    let least = if completes { Duration::from_millis(150) } else { Duration::from_secs(1) };
    assert!(u128::from(views) <= took.as_millis() / least.as_millis() + 1, "{views} in {took:?}");
    (views, arrived)
}

#[tokio::test(flavor = "multi_thread")]
async fn samples_of_earlier_views_still_count_while_the_eye_moves() {
    let (views, arrived) = turn(true, |session| session.samples_here() > 21).await;
    // Those of the last views may still be under way.
    assert!(arrived > 21 && arrived % 21 == 0 && arrived <= 21 * u64::from(views), "{arrived}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_moving_eye_waits_for_stored_samples_under_way_but_not_for_ever() {
    let (views, _) = turn(false, |session| session.request_number > 2).await;
    assert!(views > 2);
}
