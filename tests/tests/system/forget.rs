//! Who made the samples of a file, and a file without what one of them made.

use std::net::SocketAddr;

use holo_net::Message;
use holo_proto::{bulk::CellBatch, control::Control, frame::FrameKind, hello::Role};
use holo_tests::{Place, stored, wait_until};
use rustix::process::Signal;
use serde_json::Value;

fn workers(place: &Place, file: &str) -> Vec<Value> {
    let info = place.run(&["info", file, "--json"]).ok().whole_json();
    info["workers"].as_array().unwrap().clone()
}

#[test]
fn a_file_lists_its_workers_and_forgets_what_one_has_made() {
    let place = Place::new();
    let first = place.fill_small("a.holo", "3k").json()["samples"].clone();
    let file = place.text("a.holo");
    let [worker] = &workers(&place, &file)[..] else { panic!("one machine has filled it") };
    assert!(worker["name"].as_str().unwrap().starts_with("rtworker on "), "{worker}");
    assert!(!worker["name"].as_str().unwrap().contains('#'), "a machine, and no process: {worker}");
    assert_eq!((&worker["id"], &worker["samples"]), (&1.into(), &first));
    assert!(worker["claims"].as_u64() > Some(0), "the box is open on one side: {worker}");

    // Another fill has the same machine as maker, and a merge keeps the makers.
    let all = place.fill_small("a.holo", "1k").json()["samples"].clone();
    place.run(&["merge", "{}/b.holo", "{}/a.holo"]).ok();
    for file in [&file, &place.text("b.holo")] {
        let [worker] = &workers(&place, file)[..] else { panic!("still one machine") };
        assert_eq!((&worker["id"], &worker["samples"]), (&1.into(), &all));
    }

    place.run(&["forget", &file, "--worker", "7"]).failed(1, &["a.holo", "knows no worker 7"]);
    let nobodys = place.run(&["forget", &file, "--worker", "0", "--json"]).ok().json();
    assert_eq!((&nobodys["samples"], &nobodys["left"]), (&0.into(), &all));
    let forgotten = place.run(&["forget", &file, "--worker", "1", "--json"]).ok().json();
    assert_eq!((&forgotten["samples"], &forgotten["left"]), (&all, &0.into()));
    assert!(workers(&place, &file).is_empty());
    assert_eq!(stored(&place.path("a.holo")).count(), 0);
    assert!(!place.path("a.holo.new").exists());

    // All of it is traced again, from the first numbers on.
    place.fill_small("a.holo", "4k");
    stored(&place.path("a.holo")).assert_no_gaps();
    assert_eq!(workers(&place, &file)[0]["id"], 2, "no number is given twice");
    place.run(&["verify", "{}/a.holo"]).ok();
}

#[test]
fn a_file_that_is_being_written_forgets_nothing() {
    let place = Place::new();
    let all = place.fill_small("a.holo", "1k").json()["samples"].clone();
    let _server = place.server("a.holo", &[]);
    place.run(&["forget", "{}/a.holo", "--worker", "1"]).failed(1, &["a.holo", "another process"]);
    assert_eq!(all, stored(&place.path("a.holo")).count());
}

/// Works beside others for as long as it is polled: sends all cells of surface light back, brighter
/// than they are, but not so much that workers leave them out.
async fn lie(server: SocketAddr) {
    let connected = holo_net::connect(server, Role::Worker, "a liar").await;
    let (mut inbox, outbox, _) = connected.unwrap();
    outbox.control(&Control::CellsWanted).unwrap();
    while let Ok(message) = inbox.next().await {
        match message {
            Message::Cells(mut cells) => {
                for cell in &mut cells.cells {
                    cell.light = cell.light.map(|light| 1.25 * light);
                }
                outbox.send(FrameKind::Cells, &CellBatch { cells: cells.cells }.encode()).unwrap();
            }
            Message::Control(Control::Ping(number)) => {
                outbox.control(&Control::Pong(number)).unwrap();
            }
            _ => {}
        }
    }
}

#[test]
fn what_others_made_with_the_light_of_a_liar_is_forgotten_with_it() {
    let place = Place::new();
    let file = place.text("a.holo");
    place.fill_small_with("a.holo", "21", &["--engine", "gather"]);
    let server = place.server("a.holo", &["--fill"]);
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let liar = runtime.spawn(lie(server.address));
    let worker = place.worker(server.address, &[]);
    let number = |worker: &Value| worker["id"].as_u64().unwrap();
    let is_liar = |worker: &Value| worker["name"] == "a liar";
    let has_its_light = |worker: &Value, liar: u64| {
        let light = worker["light_of"].as_array().into_iter().flatten();
        light.into_iter().any(|maker| maker.as_u64() == Some(liar))
    };
    let samples = |workers: &[Value], is_one: &dyn Fn(&Value) -> bool| {
        let theirs = workers.iter().filter(|worker| is_one(worker));
        theirs.map(|worker| worker["samples"].as_u64().unwrap()).sum::<u64>()
    };
    let liars = wait_until("samples with the light of the liar", || {
        let workers = workers(&place, &file);
        let liar = number(workers.iter().find(|worker| is_liar(worker))?);
        (samples(&workers, &|worker| has_its_light(worker, liar)) > 10_000).then_some(liar)
    });
    liar.abort();
    server.process.end(Signal::TERM).ok();
    worker.wait().ok();

    let before = workers(&place, &file);
    let tainted = samples(&before, &|worker| has_its_light(worker, liars));
    let clean = samples(&before, &|worker| !has_its_light(worker, liars));
    assert!(clean > 0, "the worker has compared the light before it used it");
    let forgotten =
        place.run(&["forget", &file, "--worker", &liars.to_string(), "--json"]).ok().json();
    assert_eq!(forgotten["samples_of_others"], tainted);
    assert_eq!((&forgotten["samples"], &forgotten["left"]), (&tainted.into(), &clean.into()));
    assert!(forgotten["cells"].as_u64() > Some(0));
    let after = workers(&place, &file);
    assert!(!after.iter().any(|worker| is_liar(worker) || has_its_light(worker, liars)));

    // All of it is traced again, and no later worker hears of the liar's light.
    place.fill_small_with("a.holo", "200k", &["--engine", "gather"]);
    stored(&place.path("a.holo")).assert_no_gaps();
    assert!(!workers(&place, &file).iter().any(|worker| has_its_light(worker, liars)));
    place.run(&["verify", &file]).ok();
    let view = ["--vp", "2.78,2.73,-2", "--vd", "0,0,1", "--vu", "0,1,0", "--vh", "60"];
    let size = ["--size", "48x48", "-o"];
    let truth = [&["render", "{}/cornell.obj", "--spp", "256", "--quiet"][..], &view, &size];
    place.run(&[&truth.concat()[..], &["{}/truth.pfm"]].concat()).ok();
    let picture = [&["picture", &file, "--denoise", "off"][..], &view, &size];
    place.run(&[&picture.concat()[..], &["{}/a.pfm"]].concat()).ok();
    let found = place.run(&["compare", "{}/a.pfm", "{}/truth.pfm", "--json"]).ok().json();
    let bias = found["bias"].as_f64().unwrap();
    assert!(bias.abs() < 0.02, "{found}");
}
