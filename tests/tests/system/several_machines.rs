//! A worker and a viewer that join by the server's printed string, as from other machines.

use holo_tests::{Place, listen_address, patiently};
use rustix::process::Signal;

#[test]
fn one_string_is_all_that_a_worker_and_a_viewer_need() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let file = place.text("a.holo");
    let mut server = place.start(&[
        "holoserver",
        &file,
        "--listen",
        "127.0.0.1:0",
        "--secure",
        "--identity",
        "{}/identity",
        "--with-parent",
        "--json",
    ]);
    let join = server.wait_for_line("join with ");
    let local = listen_address(&mut server).to_string();
    // The worker has no file of the scene: it comes over the encrypted connection.
    let worker = place.start(&["rtworker", "--join", &join, "--threads", "1", "--with-parent"]);
    server.wait_for_error("joined");
    let output = place.text("a.pfm");
    let traced = |seconds: u32| {
        let time = seconds.to_string();
        let words = ["view", "--join", &join, "--headless", "--time", &time, "--size", "32x32"];
        let report = place.run(&[&words[..], &["-o", &output, "--json"]].concat()).ok().json();
        report["traced"].as_u64().unwrap()
    };
    assert!(patiently(traced, |traced| *traced > 0) > 0, "no sample is traced");
    // The printed string permits to trace and to look. An administrator has a token of its own.
    place.run(&["status", "--join", &join]).failed(1, &["does not permit that role"]);
    let identity = ["--identity", "{}/identity"];
    let address = join.split('/').nth(2).unwrap();
    let add = ["tokens", "--add", "admin", "--public", address];
    let admin = place.run(&[&add[..], &identity].concat()).ok().stdout;
    let admin = admin.trim().strip_prefix("join with ").unwrap().to_owned();
    for connect in [&admin, &local] {
        let status = place.run(&["status", "--connect", connect, "--json"]).ok().json();
        assert_eq!(status["workers"].as_array().unwrap().len(), 1, "{status}");
        assert!(status["traced"].as_u64().unwrap() > 0, "{status}");
    }
    // A token of another role, and none at all.
    let add = ["tokens", "--add", "worker", "--public", "127.0.0.1:1"];
    let added = place.run(&[&add[..], &identity].concat()).ok().stdout;
    let token = added.trim().rsplit('/').next().unwrap();
    let fingerprint = join.split('/').nth(3).unwrap();
    let workers = format!("holodeck://{address}/{fingerprint}/{token}");
    place.run(&["status", "--join", &workers]).failed(1, &["does not permit that role"]);
    let listed = place.run(&[&["tokens"][..], &identity].concat()).ok().stdout;
    let name = listed.lines().find_map(|line| line.strip_suffix(" worker")).unwrap();
    place.run(&[&["tokens", "--revoke", name][..], &identity].concat()).ok();
    place.run(&["status", "--join", &workers]).failed(1, &["revoked"]);
    // On its own machine, a server is asked by its public address, too, with its user's tokens.
    let own = ["status", "--connect", address, "--identity", "{}/identity", "--json"];
    let status = place.run(&own).ok().json();
    assert_eq!(status["workers"].as_array().unwrap().len(), 1, "{status}");
    let other = ["status", "--connect", address, "--identity", "{}/elsewhere"];
    place.run(&other).failed(1, &["connections here are encrypted", "holodeck://"]);
    server.end(Signal::TERM).ok();
    worker.wait().ok();
    // What all machines made that joined with a token can be removed at once.
    let members = listed.lines().find_map(|line| line.strip_suffix(" member")).unwrap();
    let forget = ["forget", &file, "--token", members, "--json"];
    let forgotten = place.run(&forget).ok().json();
    assert!(forgotten["samples"].as_u64() > Some(0), "{forgotten}");
    place.run(&forget).failed(1, &["no worker of", members]);
    // Names of tokens may begin with a hyphen.
    place.run(&["forget", &file, "--token", "-none"]).failed(1, &["no worker of", "-none"]);
    let revoke = ["tokens", "--revoke", "-none"];
    place.run(&[&revoke[..], &identity].concat()).failed(1, &["no token has the name `-none`"]);
}
