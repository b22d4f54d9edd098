//! The three programs started by hand, as on several machines.

use std::net::TcpListener;

use holo_picture::Picture;
use holo_tests::{Place, stored};
use rustix::process::Signal;

#[test]
fn server_worker_and_viewer_started_by_hand_make_pictures() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let before = stored(&place.path("a.holo"));
    let server = place.server("a.holo", &["--json"]);
    let _worker = place.worker(server.address, &[]);
    let script = "0 view -vp 2.78 2.73 -2 -vd 0 0 1 -vu 0 1 0 -vh 60\n1 picture {}/one.pfm\n\
                  0 view -vp 4.4 3.6 -1 -vd -.35 -.25 .9\n3 picture {}/two.pfm\n3 quit\n";
    let script = place.write("walk.txt", &script.replace("{}", &place.text("")));
    let viewer = place.viewer(server.address, &["--script", &script, "--size", "64x48", "--json"]);
    let ended = viewer.wait().ok();
    let reports: Vec<serde_json::Value> =
        ended.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    assert_eq!(reports.len(), 2, "{}", ended.stdout);
    for (report, name) in reports.iter().zip(["one.pfm", "two.pfm"]) {
        assert!(report["traced"].as_u64().unwrap() > 100, "{report}");
        assert!(report["picture"].as_str().unwrap().ends_with(name), "{report}");
        let picture = Picture::read(place.path(name)).unwrap();
        assert_eq!(picture.size(), (64, 48));
        let lit = picture.pixels.iter().filter(|rgb| rgb[0] > 0.0).count();
        assert!(lit > 64 * 48 / 2, "{name}: {lit} pixels are lit");
    }
    assert_ne!(
        std::fs::read(place.path("one.pfm")).unwrap(),
        std::fs::read(place.path("two.pfm")).unwrap()
    );
    let summary = server.process.end(Signal::TERM).ok().json();
    let after = stored(&place.path("a.holo"));
    assert_eq!(summary["samples"], after.count());
    assert_eq!(summary["added"], after.count() - before.count());
    after.assert_contains(&before);
}

#[test]
fn a_worker_started_before_its_server_waits_for_it() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = nobody.local_addr().unwrap();
    let worker = place.worker(address, &["--retry", "120"]);
    // The worker has tried once, and was rejected. Another program could take the port now, but
    // hardly within this moment.
    drop(nobody.accept().unwrap());
    drop(nobody);
    let address = address.to_string();
    let file = place.text("a.holo");
    let words = [
        "holoserver",
        &file,
        "--listen",
        &address,
        "--with-parent",
        "--fill",
        "--samples",
        "20k",
        "--json",
    ];
    let added = place.run(&words).ok().json()["added"].as_u64().unwrap();
    assert!(added >= 20_000, "{added}");
    // The server has said goodbye.
    worker.wait().ok();
}

#[test]
fn a_worker_without_a_server_says_so() {
    let place = Place::new();
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let port = address.to_string();
    place
        .worker(address, &["--retry", "0.3"])
        .wait()
        .failed(1, &["no holoserver answers", &port, "is it running?"]);
    place.viewer(address, &[]).wait().failed(1, &["connecting to the holoserver", &port]);
}
