//! A process that cannot outlive its test.

use std::{
    ffi::OsStr,
    io::{BufRead, BufReader, Read, Write},
    os::unix::process::ExitStatusExt,
    path::PathBuf,
    process::{Child, Command, ExitStatus, Stdio},
    sync::{Arc, Mutex},
    thread::JoinHandle,
    time::{Duration, Instant},
};

use rustix::process::{Pid, Signal, kill_process};

use crate::{LIMIT, wait_until};

/// The exit status and the output of a process.
#[derive(Clone, Debug)]
pub struct Ended {
    /// Exit status or signal.
    pub status: ExitStatus,
    /// Everything on standard output.
    pub stdout: String,
    /// Everything on standard error.
    pub stderr: String,
}

impl Ended {
    /// Returns the exit status; `None` if a signal ended the process.
    pub fn code(&self) -> Option<i32> {
        self.status.code()
    }

    /// Returns the signal that ended the process.
    pub fn signal(&self) -> Option<i32> {
        self.status.signal()
    }

    /// Checks that the process ended with status 0.
    #[track_caller]
    pub fn ok(self) -> Ended {
        assert!(self.status.success(), "{:?}\n{}\n{}", self.status, self.stdout, self.stderr);
        self
    }

    /// Checks that the process failed in order, with this status and these words on standard error.
    #[track_caller]
    pub fn failed(self, code: i32, words: &[&str]) -> Ended {
        assert_eq!(self.code(), Some(code), "{}\n{}", self.stdout, self.stderr);
        for word in words {
            assert!(self.stderr.contains(word), "`{word}` is not in: {}", self.stderr);
        }
        assert!(!self.stderr.contains("panicked"), "{}", self.stderr);
        self
    }

    /// Returns the last line of standard output, as JSON.
    #[track_caller]
    pub fn json(&self) -> serde_json::Value {
        let last = self.stdout.lines().last().unwrap_or_default();
        serde_json::from_str(last)
            .unwrap_or_else(|error| panic!("{error}: {}\n{}", self.stdout, self.stderr))
    }

    /// Returns all of standard output, as one JSON value.
    #[track_caller]
    pub fn whole_json(&self) -> serde_json::Value {
        serde_json::from_str(&self.stdout)
            .unwrap_or_else(|error| panic!("{error}: {}", self.stdout))
    }
}

type Text = Arc<Mutex<String>>;

/// A running process. Dropping it kills it and waits for its end.
pub struct Process {
    child: Child,
    what: String,
    stdout: Text,
    stderr: Text,
    readers: Vec<JoinHandle<()>>,
}

impl Process {
    /// Starts `program`. Standard input stays open, so that processes with `--with-parent` end with
    /// the test.
    pub fn start(
        program: PathBuf,
        arguments: &[impl AsRef<OsStr>],
        environment: &[(&str, PathBuf)],
    ) -> Process {
        let what = arguments
            .iter()
            .map(|word| word.as_ref().to_string_lossy())
            .collect::<Vec<_>>()
            .join(" ");
        let mut command = Command::new(program);
        command.args(arguments).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // A denoiser among the packages of this machine's Python would change pictures.
        let home = std::env::temp_dir().join("holodeck-tests");
        std::fs::create_dir_all(&home).expect("the folder for temporary files can be written");
        command.env("PATH", "/usr/bin:/bin").env("HOME", home);
        for name in ["PYENV_ROOT", "VIRTUAL_ENV", "CONDA_PREFIX"] {
            command.env_remove(name);
        }
        command.envs(environment.iter().map(|(name, value)| (name, value)));
        let mut child = command.spawn().unwrap_or_else(|error| panic!("starting {what}: {error}"));
        let (stdout, stderr) = (Text::default(), Text::default());
        let readers = vec![
            collect(child.stdout.take().expect("it is piped"), Arc::clone(&stdout)),
            collect(child.stderr.take().expect("it is piped"), Arc::clone(&stderr)),
        ];
        Process { child, what, stdout, stderr, readers }
    }

    /// Writes a line to the process's standard input.
    ///
    /// # Panics
    /// If the process does not read it.
    #[track_caller]
    pub fn write_line(&mut self, line: &str) {
        let input = self.child.stdin.as_mut().expect("it is piped");
        writeln!(input, "{line}").expect("the process reads its input");
    }

    /// Returns the process's id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Returns the output so far on standard output.
    pub fn stdout(&self) -> String {
        self.stdout.lock().unwrap().clone()
    }

    /// Returns the output so far on standard error.
    pub fn stderr(&self) -> String {
        self.stderr.lock().unwrap().clone()
    }

    /// Waits until standard output has a line with this beginning. Returns the rest of the line.
    #[track_caller]
    pub fn wait_for_line(&mut self, beginning: &str) -> String {
        let start = Instant::now();
        loop {
            let ended = self.child.try_wait().expect("a child can be asked").is_some();
            let text = self.stdout();
            // Only whole lines count, because the last one may be half-written.
            let whole = &text[..text.rfind('\n').map_or(0, |at| at + 1)];
            if let Some(rest) = whole.lines().find_map(|line| line.strip_prefix(beginning)) {
                return rest.to_owned();
            }
            let stderr = self.stderr();
            assert!(
                !ended,
                "`{}` ended before it said `{beginning}`:\n{text}\n{stderr}",
                self.what
            );
            assert!(
                start.elapsed() < LIMIT,
                "`{}` does not say `{beginning}`:\n{text}\n{stderr}",
                self.what
            );
            std::thread::sleep(Duration::from_millis(10));
        }
    }

    /// Waits until standard error contains `words`.
    #[track_caller]
    pub fn wait_for_error(&self, words: &str) {
        wait_until(
            &format!("`{}` to say `{words}` (it says: {})", self.what, self.stderr()),
            || self.stderr().contains(words).then_some(()),
        );
    }

    /// Returns true if the process runs.
    pub fn is_running(&mut self) -> bool {
        self.child.try_wait().expect("a child can be asked").is_none()
    }

    /// Sends a signal to the process.
    pub fn signal(&self, signal: Signal) {
        let id = Pid::from_child(&self.child);
        kill_process(id, signal)
            .unwrap_or_else(|error| panic!("signalling `{}`: {error}", self.what));
    }

    /// Waits for the process to end.
    ///
    /// # Panics
    /// If it runs longer than [`LIMIT`].
    #[track_caller]
    pub fn wait(mut self) -> Ended {
        let start = Instant::now();
        let status = loop {
            if let Some(status) = self.child.try_wait().expect("a child can be asked") {
                break status;
            }
            let said = || format!("{}\n{}", self.stdout(), self.stderr());
            assert!(start.elapsed() < LIMIT, "`{}` does not end:\n{}", self.what, said());
            std::thread::sleep(Duration::from_millis(5));
        };
        for reader in self.readers.drain(..) {
            reader.join().expect("reading does not panic");
        }
        Ended { status, stdout: self.stdout(), stderr: self.stderr() }
    }

    /// Sends `signal` to the process, and waits for its end.
    #[track_caller]
    pub fn end(self, signal: Signal) -> Ended {
        self.signal(signal);
        self.wait()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // If the process has ended already, both calls fail harmlessly. SIGKILL also ends a stopped
        // process.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn collect(stream: impl Read + Send + 'static, text: Text) -> JoinHandle<()> {
    std::thread::spawn(move || {
        let mut stream = BufReader::new(stream);
        let mut line = Vec::new();
        while stream.read_until(b'\n', &mut line).is_ok_and(|read| read > 0) {
            text.lock().unwrap().push_str(&String::from_utf8_lossy(&line));
            line.clear();
        }
    })
}
