//! A temporary folder with a bundled scene, and the program run in it.

use std::{ffi::OsString, net::SocketAddr, path::PathBuf};

use holo_scenes::Bundled;
use tempfile::TempDir;

use crate::{
    process::{Ended, Process},
    program::program,
};

/// The section before the Cornell box on a coarse grid: 7,680 beams, so that a second's samples
/// fill every one of them.
pub const CORNELL_SMALL_SECTION: &str = "0.6,0.6,-4 4.3,0,0 0,4.2,0 0,0,5 4,4,4";

/// A temporary folder of a test.
pub struct Place {
    folder: TempDir,
}

impl Default for Place {
    fn default() -> Place {
        Place::new()
    }
}

impl Place {
    /// Makes a folder with the bundled Cornell box alone. Its configuration selects the unbiased
    /// engine, so that samples are the same in every run.
    pub fn new() -> Place {
        let folder = tempfile::tempdir().expect("a temporary folder can be made");
        holo_scenes::write(Bundled::Cornell, folder.path()).expect("the scene can be written");
        let place = Place { folder };
        let bundled = std::fs::read_to_string(place.cornell()).expect("it was written just now");
        place.write("cornell.toml", &format!("engine = \"path\"\n{bundled}"));
        place
    }

    /// Returns a path in the folder.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Returns a path in the folder, as text for an argument.
    pub fn text(&self, name: &str) -> String {
        self.path(name).to_str().expect("temporary folders have plain names").to_owned()
    }

    /// Writes a file into the folder.
    pub fn write(&self, name: &str, content: &str) -> String {
        std::fs::write(self.path(name), content).expect("files can be written");
        self.text(name)
    }

    /// Returns the path of the bundled scene's configuration.
    pub fn cornell(&self) -> String {
        self.text("cornell.toml")
    }

    /// Starts the program with these arguments. `{}` in an argument stands for this folder.
    pub fn start(&self, words: &[&str]) -> Process {
        self.start_with(words, &[])
    }

    /// Starts the program on the X desktop of this name.
    pub fn start_on(&self, desktop: &str, words: &[&str]) -> Process {
        self.start_with(
            words,
            &[("DISPLAY", desktop), ("WAYLAND_DISPLAY", ""), ("WAYLAND_SOCKET", "")],
        )
    }

    /// Starts the program in a network namespace.
    pub fn start_in(&self, namespace: &str, words: &[&str]) -> Process {
        let program = program().to_str().expect("the program's path is plain");
        let all = [&["netns", "exec", namespace, program][..], words].concat();
        Process::start("ip".into(), &self.arguments(&all), &self.folders())
    }

    /// Returns the arguments with this folder in place of `{}`.
    fn arguments(&self, words: &[&str]) -> Vec<OsString> {
        let folder = self.folder.path().to_str().expect("temporary folders have plain names");
        words.iter().map(|word| word.replace("{}", folder).into()).collect()
    }

    fn start_with(&self, words: &[&str], environment: &[(&str, &str)]) -> Process {
        let words = self.arguments(words);
        let mut all = self.folders().to_vec();
        all.extend(environment.iter().map(|(name, value)| (*name, PathBuf::from(value))));
        Process::start(program().to_owned(), &words, &all)
    }

    /// Returns where programs keep what they keep for their user.
    fn folders(&self) -> [(&'static str, PathBuf); 2] {
        [("XDG_CACHE_HOME", self.path("cache")), ("XDG_CONFIG_HOME", self.path("config"))]
    }

    /// Runs the program with these arguments until it ends.
    #[track_caller]
    pub fn run(&self, words: &[&str]) -> Ended {
        self.start(words).wait()
    }

    /// Makes a holodeck of the bundled box on the coarse grid, or continues it, with about this
    /// many further samples.
    #[track_caller]
    pub fn fill_small(&self, file: &str, samples: &str) -> Ended {
        self.fill_small_with(file, samples, &[])
    }

    /// Does the same as [`fill_small`](Self::fill_small), with more arguments.
    #[track_caller]
    pub fn fill_small_with(&self, file: &str, samples: &str, words: &[&str]) -> Ended {
        let file = self.text(file);
        let fill = [
            "fill",
            "--config",
            "{}/cornell.toml",
            "--section",
            CORNELL_SMALL_SECTION,
            "-o",
            &file,
        ];
        self.run(&[&fill[..], &["--samples", samples, "--json"], words].concat()).ok()
    }

    /// Starts a server on any free port.
    #[track_caller]
    pub fn server(&self, file: &str, words: &[&str]) -> Server {
        let file = self.text(file);
        let mut all = vec!["holoserver", &file, "--listen", "127.0.0.1:0", "--with-parent"];
        all.extend(words);
        let mut process = self.start(&all);
        let address = listen_address(&mut process);
        Server { process, address }
    }

    /// Starts a worker with one thread.
    pub fn worker(&self, address: SocketAddr, words: &[&str]) -> Process {
        let address = address.to_string();
        let mut all = vec!["rtworker", "--connect", &address, "--threads", "1", "--with-parent"];
        all.extend(words);
        self.start(&all)
    }

    /// Starts a headless viewer.
    pub fn viewer(&self, address: SocketAddr, words: &[&str]) -> Process {
        let address = address.to_string();
        let mut all = vec!["holoview", "--connect", &address, "--with-parent"];
        all.extend(words);
        self.start(&all)
    }
}

/// A server that a test has started.
pub struct Server {
    /// The process.
    pub process: Process,
    /// The address where the server listens.
    pub address: SocketAddr,
}

/// Returns the address of a server that was just started.
#[track_caller]
pub fn listen_address(process: &mut Process) -> SocketAddr {
    process.wait_for_line("listening on ").parse().expect("the server prints its address")
}
