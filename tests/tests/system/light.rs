//! Indirect light that all workers share: sent once to everyone who wants it, stored in the file,
//! and used.

use std::net::SocketAddr;

use holo_net::{Inbox, Message, Outbox};
use holo_proto::{
    bulk::{Light, Record},
    control::Control,
    frame::FrameKind,
    hello::Role,
};
use holo_tests::{LIMIT, Place};
use rustix::process::Signal;

fn records(ids: std::ops::Range<u64>) -> Vec<Record> {
    let record = |id| Record {
        point: [id as f32, 0.0, 0.0],
        radius: 0.1,
        normal: [0.0, 0.0, 1.0],
        nearest: 1.0,
        irradiance: [1.0, 2.0, 3.0],
        error: 0.1,
        shift: [[0.0; 3]; 3],
        turn: [[0.0; 3]; 3],
        rays: 64,
        flags: 0,
        id,
    };
    ids.map(record).collect()
}

struct Client {
    inbox: Inbox,
    outbox: Outbox,
}

impl Client {
    async fn new(address: SocketAddr, role: Role) -> Client {
        let (inbox, outbox, _) = holo_net::connect(address, role, "a visitor").await.unwrap();
        outbox.control(&Control::LightWanted).unwrap();
        Client { inbox, outbox }
    }

    fn tell(&self, ids: std::ops::Range<u64>) {
        self.outbox.send(FrameKind::Light, &Light { records: records(ids) }.encode()).unwrap();
    }

    /// Waits until `count` records have arrived and then until the server has answered. Returns all
    /// records' names in order.
    async fn told(&mut self, count: usize) -> Vec<u64> {
        let mut ids = Vec::new();
        if count == 0 {
            self.outbox.control(&Control::Ping(1)).unwrap();
        }
        loop {
            match tokio::time::timeout(LIMIT, self.inbox.next()).await.unwrap().unwrap() {
                Message::Light(light) => {
                    ids.extend(light.records.iter().map(|record| record.id));
                    assert!(ids.len() <= count, "{} records, {count} are new", ids.len());
                    if ids.len() == count {
                        self.outbox.control(&Control::Ping(1)).unwrap();
                    }
                }
                Message::Control(Control::Pong(1)) => break,
                Message::Control(Control::Ping(number)) => {
                    self.outbox.control(&Control::Pong(number)).unwrap()
                }
                _ => {}
            }
        }
        ids.sort_unstable();
        ids
    }
}

#[test]
fn records_of_one_worker_reach_all_others_once_and_late_workers_receive_all() {
    let place = Place::new();
    place.fill_small_with("a.holo", "21", &["--engine", "cached"]);
    let server = place.server("a.holo", &[]);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let info = |place: &Place| {
        place.run(&["info", "{}/a.holo", "--json"]).ok().whole_json()["light_records"].as_u64()
    };
    let before = info(&place).unwrap();
    let all = runtime.block_on(async {
        let mut first = Client::new(server.address, Role::Worker).await;
        let own = first.told(before as usize).await;
        assert!(!own.is_empty(), "the fill has left some");
        let mut second = Client::new(server.address, Role::Worker).await;
        assert_eq!(second.told(own.len()).await, own);
        first.tell(0..10_000);
        assert_eq!(second.told(10_000).await, Vec::from_iter(0..10_000));
        assert_eq!(first.told(0).await, [0; 0], "nobody is told what he said himself");
        second.tell(9_900..10_003);
        assert_eq!(
            first.told(3).await,
            [10_000, 10_001, 10_002],
            "what is there already is dropped"
        );
        let mut late = Client::new(server.address, Role::Display).await;
        late.told(own.len() + 10_003).await
    });
    server.process.end(Signal::TERM).ok();
    assert_eq!(info(&place), Some(before + 10_003), "all are in the file");
    // A file that is only shown also has them.
    let server = place.server("a.holo", &["--display-only"]);
    let again = runtime
        .block_on(async { Client::new(server.address, Role::Display).await.told(all.len()).await });
    assert_eq!(again, all);
    server.process.end(Signal::TERM).ok();
    place.run(&["verify", "{}/a.holo"]).ok();
}

#[test]
fn a_holodeck_of_another_engine_takes_no_records() {
    let place = Place::new();
    place.fill_small("a.holo", "21");
    let server = place.server("a.holo", &[]);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let mut client = Client::new(server.address, Role::Worker).await;
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
fn a_fill_that_goes_on_uses_the_light_that_is_there() {
    let place = Place::new();
    let records = |file: &str, samples: &str| {
        // Records of this accuracy are so large that they soon cover the box.
        place.fill_small_with(file, samples, &["--engine", "cached", "--accuracy", "0.2"]);
        place.run(&["info", &format!("{{}}/{file}"), "--json"]).ok().whole_json()["light_records"]
            .as_u64()
            .unwrap()
    };
    let from_nothing = records("new.holo", "300k");
    let before = records("a.holo", "3M");
    let more = records("a.holo", "300k") - before;
    assert!(from_nothing > 100, "{from_nothing}");
    // The beams and the box are the same, so new records are only made for places that are not
    // covered yet.
    assert!(more < from_nothing / 2, "{from_nothing} from nothing, {more} after {before}");
}

#[test]
fn the_engine_suits_the_scene_unless_one_is_named() {
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
    assert_eq!(engine("{}/all.holo", &[]), "cached");
    assert_eq!(engine("{}/direct.holo", &["--bounces", "0"]), "path");
    assert_eq!(engine("{}/paths.holo", &["--engine", "path"]), "path");
    // A fill that continues a file uses the file's engine.
    assert_eq!(engine("{}/paths.holo", &[]), "path");
}
