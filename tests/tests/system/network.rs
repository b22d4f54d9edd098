//! Machines of a network, whose wires are slow, lose packets, are cut and mended.

use holo_tests::{Chromium, Network, Place, Process, listen_address, stored, wait_until};
use rustix::process::Signal;

/// Machine 0 serves, the next ones trace, and the last ones look.
const WORKERS: usize = 8;
const DISPLAYS: usize = 3;

/// Returns the server's status, as reported to a process on its machine.
fn status(place: &Place, network: &Network, local: &str) -> serde_json::Value {
    place.start_in(&network.host(0), &["status", "--connect", local, "--json"]).wait().ok().json()
}

#[test]
fn a_fill_and_its_viewers_outlive_slow_lossy_and_cut_wires() {
    let Some(network) = Network::new(1 + WORKERS + DISPLAYS) else {
        eprintln!("not tested: this system lets the test make no network namespaces");
        return;
    };
    let is_slow = (0..=WORKERS + DISPLAYS).all(|host| network.set_quality(host, 25, 1));
    if !is_slow {
        eprintln!("tested on fast wires: this system has no netem");
    }
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let (file, listen) = (place.text("a.holo"), format!("{}:7070", network.address(0)));
    let server = ["holoserver", &file, "--listen", &listen, "--identity", "{}/identity", "--fill"];
    let mut server =
        place.start_in(&network.host(0), &[&server[..], &["--with-parent", "--json"]].concat());
    let join = server.wait_for_line("join with ");
    assert!(join.starts_with(&format!("holodeck://{listen}/")), "{join}");
    let local = listen_address(&mut server).to_string();
    let worker = |host: usize| {
        let words = ["rtworker", "--join", &join, "--threads", "1", "--retry", "120"];
        place.start_in(&network.host(host), &[&words[..], &["--with-parent"]].concat())
    };
    let mut workers: Vec<Process> = (1..=WORKERS).map(worker).collect();
    let wait_for_workers = |count: usize| {
        wait_until("workers that trace", || {
            let report = status(&place, &network, &local);
            let workers = report["workers"].as_array().unwrap();
            let busy = |worker: &&serde_json::Value| worker["rays"].as_u64() > Some(0);
            (workers.len() == count && workers.iter().filter(busy).count() == count)
                .then(|| report["traced"].as_u64().unwrap())
        })
    };
    wait_for_workers(WORKERS);

    // Three wires are cut until both sides have given each other up. A worker dies meanwhile.
    (1..=3).for_each(|host| network.set_wire(host, false));
    workers.remove(3).end(Signal::KILL);
    let looking: Vec<Process> =
        (0..DISPLAYS).map(|display| viewer(&place, &network, &join, display)).collect();
    let before = wait_for_workers(WORKERS - 4);
    for worker in &workers[..3] {
        worker.wait_for_error("trying to reach it again");
    }
    (1..=3).for_each(|host| network.set_wire(host, true));
    let after = wait_for_workers(WORKERS - 1);
    assert!(after > before, "the others went on");

    for viewer in looking {
        let report = viewer.wait().ok().json();
        let seen = report["stored"].as_u64().unwrap() + report["traced"].as_u64().unwrap();
        assert!(seen > 0, "{report}");
    }
    let summary = server.end(Signal::TERM).ok().json();
    let stored = stored(&place.path("a.holo"));
    assert_eq!(summary["samples"], stored.count());
    workers.into_iter().for_each(|worker| _ = worker.wait().ok());
    place.run(&["verify", "{}/a.holo"]).ok();
}

fn viewer(place: &Place, network: &Network, join: &str, display: usize) -> Process {
    let words = ["view", "--join", join, "--headless", "--time", "5", "--size", "64x64", "--json"];
    let output = format!("{{}}/{display}.pfm");
    place.start_in(&network.host(1 + WORKERS + display), &[&words[..], &["-o", &output]].concat())
}

#[test]
fn a_session_on_another_machine_is_walked_in_a_browser() {
    let Some(network) = Network::new(3) else {
        eprintln!("not tested: this system lets the test make no network namespaces");
        return;
    };
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let (file, listen) = (place.text("a.holo"), format!("{}:7070", network.address(0)));
    let words = ["holoserver", &file, "--listen", &listen, "--identity", "{}/identity"];
    let mut server = place.start_in(&network.host(0), &[&words[..], &["--with-parent"]].concat());
    let join = server.wait_for_line("join with ");
    let words = ["rtworker", "--join", &join, "--threads", "1", "--with-parent"];
    let worker = place.start_in(&network.host(1), &words);
    let words = ["view", "--join", &join, "--no-open"];
    let mut viewer = place.start_in(&network.host(2), &words);
    let address = format!("http:{}", viewer.wait_for_line("http:"));

    // The page is served to the viewer's machine alone, and so is its browser.
    network.enter(2);
    let browser = &mut Chromium::open(&address);
    let options = "document.body.dataset.options";
    browser.wait("state && state.workers === 1 && state.view_samples > 5000");
    // Samples come before the first frame.
    browser.wait(&format!("{options} !== undefined"));
    let home = browser.value(options);
    browser.key("KeyS", "s", true);
    browser.wait(&format!("{options} !== {home}"));
    browser.key("KeyS", "s", false);
    // How far a key goes depends on the machine: the way back leads to where samples are.
    browser.press("KeyH", "h");
    browser.wait(&format!(
        "document.body.dataset.rest === 'true' && {options} === {home} && state.view_samples > 1000"
    ));
    let lit = "(() => { const p = document.getElementById('picture'); \
        const d = p.getContext('2d').getImageData(0, 0, p.width, p.height).data; \
        return d.some((channel, at) => at % 4 < 3 && channel > 100); })()";
    browser.wait(lit);
    browser.value("command('quit')");
    viewer.wait().ok();
    server.end(Signal::TERM).ok();
    worker.wait().ok();
}

#[test]
fn a_page_is_walked_in_a_browser_on_another_machine() {
    let Some(network) = Network::new(2) else {
        eprintln!("not tested: this system lets the test make no network namespaces");
        return;
    };
    let place = Place::new();
    place.fill_small_with("a.holo", "20k", &["--bounces", "0"]);
    let listen = format!("{}:0", network.address(0));
    let words = ["replay", "{}/a.holo", "--http", &listen, "--no-open"];
    let mut session = place.start_in(&network.host(0), &words);
    let address = format!("https:{}", session.wait_for_line("https:"));
    let (site, token) = address.split_once("?token=").expect("the address has a token");

    network.enter(1);
    let flags = ["--ignore-certificate-errors".to_owned()];
    let browser = &mut Chromium::open_with("about:blank", &flags);
    let refused = "document.body.innerText.includes('with its token')";
    browser.go_to(site, refused);
    browser.go_to(&format!("{site}?token={}", token.replace(char::is_numeric, "x")), refused);
    browser.go_to(&address, "state && state.view_samples > 1000");
    assert_eq!(browser.value("location.href"), site, "the token has left the address");
    let options = browser.value("document.body.dataset.options");
    browser.key("KeyS", "s", true);
    browser.wait(&format!("document.body.dataset.options !== {options}"));
    browser.key("KeyS", "s", false);
    browser.value("command('quit')");
    session.wait().ok();
}
