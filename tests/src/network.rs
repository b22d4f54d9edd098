//! Machines of a network. Each is a network namespace of this machine, and a bridge joins them.

use std::{
    fs::File,
    os::fd::AsFd,
    process::Command,
    sync::atomic::{AtomicU32, Ordering},
};

use rustix::thread::{LinkNameSpaceType, move_into_link_name_space};

/// A network whose namespaces are deleted when it is dropped.
pub struct Network {
    prefix: String,
    hosts: usize,
}

impl Network {
    /// Makes a network of `hosts` machines; `None` if this process lacks the right.
    ///
    /// Machine *i* has the address 10.77.0.(*i* + 1).
    pub fn new(hosts: usize) -> Option<Network> {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        // If a later step fails, dropping this value removes the existing parts.
        let network = Network { prefix: format!("holo{}x{number}", std::process::id()), hosts };
        network.make().then_some(network)
    }

    fn make(&self) -> bool {
        let switch = self.switch();
        ip(&["netns", "add", &switch])
            && ip(&["-n", &switch, "link", "add", "bridge", "type", "bridge"])
            && ip(&["-n", &switch, "link", "set", "bridge", "up"])
            && (0..self.hosts).all(|host| self.add(host))
    }

    fn add(&self, host: usize) -> bool {
        let (switch, name, port) = (self.switch(), self.host(host), format!("port{host}"));
        let address = format!("{}/24", self.address(host));
        ip(&["netns", "add", &name])
            && ip(&[
                "link", "add", "wire", "netns", &name, "type", "veth", "peer", "name", &port,
                "netns", &switch,
            ])
            && ip(&["-n", &switch, "link", "set", &port, "master", "bridge", "up"])
            && ip(&["-n", &name, "addr", "add", &address, "dev", "wire"])
            && ip(&["-n", &name, "link", "set", "lo", "up"])
            && ip(&["-n", &name, "link", "set", "wire", "up"])
    }

    /// Returns the name of a machine's namespace.
    pub fn host(&self, host: usize) -> String {
        format!("{}h{host}", self.prefix)
    }

    /// Returns the address of a machine.
    pub fn address(&self, host: usize) -> String {
        format!("10.77.0.{}", host + 1)
    }

    /// Moves the calling thread to a machine. Sockets and processes that it creates later belong to
    /// that machine.
    #[track_caller]
    pub fn enter(&self, host: usize) {
        let namespace = File::open(format!("/run/netns/{}", self.host(host)));
        let namespace = namespace.expect("the machine is there");
        let kind = Some(LinkNameSpaceType::Network);
        move_into_link_name_space(namespace.as_fd(), kind).expect("one may enter it");
    }

    /// Cuts or restores a machine's wire.
    pub fn set_wire(&self, host: usize, is_up: bool) {
        let state = if is_up { "up" } else { "down" };
        let port = format!("port{host}");
        assert!(ip(&["-n", &self.switch(), "link", "set", &port, state]), "{port} {state}");
    }

    /// Makes a machine's wire slow and lossy. Data that it sends is delayed by `milliseconds`, and
    /// `lost` percent never arrives. Returns false if the system does not support this.
    pub fn set_quality(&self, host: usize, milliseconds: u32, lost: u32) -> bool {
        let (delay, loss) = (format!("{milliseconds}ms"), format!("{lost}%"));
        let name = self.host(host);
        let words = ["-n", &name, "qdisc", "add", "dev", "wire", "root", "netem"];
        runs("tc", &[&words[..], &["delay", &delay, "loss", &loss]].concat())
    }

    fn switch(&self) -> String {
        format!("{}s", self.prefix)
    }
}

impl Drop for Network {
    fn drop(&mut self) {
        for host in 0..self.hosts {
            ip(&["netns", "del", &self.host(host)]);
        }
        ip(&["netns", "del", &self.switch()]);
    }
}

fn ip(words: &[&str]) -> bool {
    runs("ip", words)
}

/// Returns true if a program exists and succeeds.
fn runs(program: &str, words: &[&str]) -> bool {
    Command::new(program).args(words).output().is_ok_and(|output| output.status.success())
}
