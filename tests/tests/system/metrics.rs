//! What Prometheus reads, over HTTP.

use std::{
    io::{Read, Write},
    net::TcpStream,
};

use holo_tests::Place;
use rustix::process::Signal;

/// Asks for a page, and returns the whole answer.
fn get(address: &str, path: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}

#[test]
fn prometheus_reads_how_a_server_fares_and_hears_when_it_is_gone() {
    let place = Place::new();
    place.fill_small("a.holo", "1k");
    let server = place.server("a.holo", &[]);
    let connect = server.address.to_string();
    let status = ["status", "--connect", &connect, "--serve"];
    place.run(&[&status[..], &["192.0.2.1:9100"]].concat()).failed(1, &["192.0.2.1:9100"]);
    let mut status = place.start(&[&status[..], &["127.0.0.1:0"]].concat());
    let url = status.wait_for_line("metrics at http://");
    let (address, path) = url.split_once('/').unwrap();
    let answer = get(address, &format!("/{path}"));
    assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
    assert!(answer.contains("\nholodeck_samples ") && answer.contains("# EOF"), "{answer}");
    assert!(get(address, "/").starts_with("HTTP/1.1 404"), "and nothing else");
    server.process.end(Signal::TERM).ok();
    let answer = get(address, &format!("/{path}"));
    assert!(answer.starts_with("HTTP/1.1 502") && answer.contains(&connect), "{answer}");
    status.end(Signal::TERM).ok();
}
