//! Cells of surface light that all workers share: sent to everyone who wants them, stored in the
//! file, and used. Files of an engine that is no more.

use std::{collections::BTreeMap, net::SocketAddr};

use holo_beamfile::{BeamFile, Options};
use holo_net::{Inbox, Message, Outbox};
use holo_proto::{
    bulk::{CellBatch, WireCell},
    control::Control,
    frame::FrameKind,
    hello::Role,
};
use holo_tests::{LIMIT, Place};
use rustix::process::Signal;

/// Returns a cell with four estimates for each of these places.
fn cells(places: std::ops::Range<u32>) -> CellBatch {
    let cell = |place| WireCell {
        point: [place as f32, 0.0, 0.0],
        normal: [0.0, 0.0, 1.0],
        material: 0,
        bounces: u32::MAX,
        level: 1,
        maker: 0,
        count: 4,
        light: [1.0, 2.0, 3.0],
        albedo: [2.0; 3],
    };
    CellBatch { cells: places.map(cell).collect() }
}

struct Client {
    inbox: Inbox,
    outbox: Outbox,
}

impl Client {
    async fn new(address: SocketAddr) -> Client {
        let connected = holo_net::connect(address, Role::Worker, "a visitor").await;
        let (inbox, outbox, _) = connected.unwrap();
        outbox.control(&Control::CellsWanted).unwrap();
        Client { inbox, outbox }
    }

    fn tell(&self, places: std::ops::Range<u32>) {
        self.outbox.send(FrameKind::Cells, &cells(places).encode()).unwrap();
    }

    /// Waits until the server has answered a ping. Returns the estimates that have arrived by then,
    /// by place.
    async fn told(&mut self) -> BTreeMap<u32, u32> {
        let mut estimates = BTreeMap::new();
        self.outbox.control(&Control::Ping(1)).unwrap();
        loop {
            match tokio::time::timeout(LIMIT, self.inbox.next()).await.unwrap().unwrap() {
                Message::Cells(cells) => {
                    for cell in cells.cells {
                        *estimates.entry(cell.point[0] as u32).or_default() += cell.count;
                    }
                }
                Message::Control(Control::Pong(1)) => return estimates,
                Message::Control(Control::Ping(number)) => {
                    self.outbox.control(&Control::Pong(number)).unwrap()
                }
                _ => {}
            }
        }
    }
}

fn estimates(places: std::ops::Range<u32>, count: u32) -> BTreeMap<u32, u32> {
    places.map(|place| (place, count)).collect()
}

#[test]
fn estimates_of_one_worker_reach_all_others_once_and_late_workers_receive_all() {
    let place = Place::new();
    place.fill_small_with("a.holo", "21", &["--engine", "gather", "--bounces", "0"]);
    let server = place.server("a.holo", &[]);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let info = |place: &Place| {
        place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json()["cells"].as_u64().unwrap()
    };
    let before = info(&place);
    let all = runtime.block_on(async {
        let mut first = Client::new(server.address).await;
        let own = first.told().await;
        let mut second = Client::new(server.address).await;
        assert_eq!(second.told().await, own, "those of the file");
        first.tell(1000..11_000);
        assert!(first.told().await.is_empty(), "nobody is told what it said itself");
        assert_eq!(second.told().await, estimates(1000..11_000, 4));
        second.tell(10_900..11_003);
        assert!(second.told().await.is_empty());
        assert_eq!(first.told().await, estimates(10_900..11_003, 4));
        let mut late = Client::new(server.address).await;
        let mut all = own;
        all.extend(estimates(1000..11_003, 4));
        all.extend(estimates(10_900..11_000, 8));
        assert_eq!(late.told().await, all);
        all
    });
    server.process.end(Signal::TERM).ok();
    // The estimates of two makers are never added.
    assert_eq!(info(&place), before + 10_000 + 103, "all are in the file");
    let server = place.server("a.holo", &[]);
    let again = runtime.block_on(async { Client::new(server.address).await.told().await });
    assert_eq!(again, all);
    server.process.end(Signal::TERM).ok();
    place.run(&["verify", "{}/a.holo"]).ok();
}

#[test]
fn a_holodeck_of_another_engine_takes_no_cells() {
    let place = Place::new();
    place.fill_small("a.holo", "21");
    let server = place.server("a.holo", &[]);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let mut client = Client::new(server.address).await;
        client.tell(0..1);
        let reason = loop {
            match tokio::time::timeout(LIMIT, client.inbox.next()).await.unwrap() {
                Ok(Message::Control(Control::Bye(farewell))) => break farewell.to_string(),
                Ok(_) => {}
                Err(error) => panic!("{error}"),
            }
        };
        assert!(reason.contains("does not use"), "{reason}");
    });
    server.process.end(Signal::TERM).ok();
}

#[test]
fn the_engine_is_gather_unless_light_is_direct_or_another_is_named() {
    let place = Place::new();
    // Without the configuration, whose engine is named.
    let engine = |file: &str, words: &[&str]| {
        let fill = [
            "fill",
            "{}/cornell.obj",
            "--section",
            holo_tests::CORNELL_SMALL_SECTION,
            "--samples",
            "1k",
            "-o",
        ];
        place.run(&[&fill[..], &[file], words].concat()).ok();
        let info = place.run(&["info", file, "--json"]).ok().whole_json();
        info["settings"]["engine"].as_str().unwrap().to_owned()
    };
    assert_eq!(engine("{}/all.holo", &[]), "gather");
    assert_eq!(engine("{}/direct.holo", &["--bounces", "0"]), "path");
    assert_eq!(engine("{}/paths.holo", &["--engine", "path"]), "path");
    // A fill that continues a file uses the file's engine.
    assert_eq!(engine("{}/paths.holo", &[]), "path");
}

/// Makes a file as if the engine `cached` of earlier versions had filled it.
fn file_of_the_engine_cached(place: &Place, file: &str, samples: &str) {
    place.fill_small_with(file, samples, &["--engine", "gather"]);
    let options = Options { cache_bytes: 0, layout: Vec::new() };
    let file = BeamFile::open(place.path(file), options).unwrap();
    let about = file.blob("holodeck").unwrap().unwrap();
    let mut about: serde_json::Value = serde_json::from_slice(&about).unwrap();
    about["settings"]["engine"] = "cached".into();
    about["settings"]["accuracy"] = 0.03.into();
    file.put_blob("holodeck", about.to_string().as_bytes()).unwrap();
    file.put_blob("light-4/0/0/0", &[1, 0, 0, 0, 136, 0, 0, 0, 9]).unwrap();
    file.flush().unwrap();
}

#[test]
fn a_file_of_the_engine_cached_is_shown_and_goes_on_with_gather() {
    let place = Place::new();
    file_of_the_engine_cached(&place, "a.holo", "30k");
    let info = || place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json();
    let before = info();
    assert_eq!(before["settings"]["engine"], "gather");
    assert_eq!(before["earlier_engine"], "cached");
    let text = place.run(&["info", "{}/a.holo"]).ok().stdout;
    assert!(text.contains("engine: gather (first samples: cached)"), "{text}");
    let view = ["--vp", "2.78,2.73,-2", "--size", "32x32", "-o", "{}/a.pfm"];
    place.run(&[&["picture", "{}/a.holo"][..], &view].concat()).ok();

    let more = place.fill_small_with("a.holo", "10k", &["--engine", "gather"]);
    assert!(more.stderr.contains("`cached`, which is no more; new ones are of `gather`"));
    assert!(info()["samples"].as_u64() > before["samples"].as_u64());
    assert_eq!(info()["earlier_engine"], "cached", "the first samples are still there");
    place.run(&["verify", "{}/a.holo"]).ok();
    // The configuration names `path`.
    let fill =
        ["fill", "--config", "{}/cornell.toml", "--section", holo_tests::CORNELL_SMALL_SECTION];
    place
        .run(&[&fill[..], &["-o", "{}/a.holo"]].concat())
        .failed(1, &["--engine is gather in the file, and path now"]);

    // A merge takes the samples of both engines.
    place.run(&["merge", "{}/b.holo", "{}/a.holo"]).ok();
    let merged = place.run(&["info", "{}/b.holo", "--json"]).ok().whole_json();
    assert_eq!(merged["samples"], info()["samples"]);
    assert_eq!(merged["earlier_engine"], "cached");
}
