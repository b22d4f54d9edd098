//! Starts the other processes: this same program, with their name as first argument.

use std::{
    collections::VecDeque,
    ffi::OsString,
    net::SocketAddr,
    process::{ExitStatus, Stdio},
    time::Duration,
};

use anyhow::{Context, Result, bail};
use holo_net::AGAIN;
use holo_server::Outside;
use tokio::{
    io::{AsyncBufReadExt, AsyncRead, AsyncWriteExt, BufReader, Lines},
    process::{Child, ChildStderr, ChildStdin, ChildStdout, Command},
    task::JoinHandle,
    time::timeout,
};

/// Longest time for a process to end after a request. A server must write its data.
const END_TIME: Duration = Duration::from_secs(30);

/// Number of lines of standard error that are reported if a process fails.
const LAST_LINES: usize = 3;

/// A process started here. It ends when its standard input ends, and so with this process, even if
/// this one is killed.
pub struct Process {
    name: &'static str,
    child: Child,
    /// Held separately, because waiting for a child closes the input that it still holds.
    input: Option<ChildStdin>,
}

impl Process {
    /// Starts this program as `name`. Its standard output is piped to this process.
    pub fn start(name: &'static str, arguments: &[OsString], stderr: Stdio) -> Result<Process> {
        let program = std::env::current_exe().context("finding this program")?;
        let mut child = Command::new(program)
            .arg(name)
            .args(arguments)
            .arg("--with-parent")
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(stderr)
            // Ctrl-C reaches this process alone, which then ends the others in order.
            .process_group(0)
            .spawn()
            .with_context(|| format!("starting {name}"))?;
        let input = child.stdin.take();
        Ok(Process { name, child, input })
    }

    /// Returns the lines of the process's standard output.
    pub fn output(&mut self) -> Result<Lines<BufReader<ChildStdout>>> {
        let output = self.child.stdout.take();
        Ok(lines(output.with_context(|| format!("reading the output of {}", self.name))?))
    }

    /// Returns the lines of the process's standard error, if that is piped.
    pub fn errors(&mut self) -> Option<Lines<BufReader<ChildStderr>>> {
        self.child.stderr.take().map(lines)
    }

    /// Waits for the process to end. A call that is dropped half-way loses nothing.
    pub async fn ended(&mut self) -> Result<ExitStatus> {
        self.child.wait().await.with_context(|| format!("waiting for {}", self.name))
    }

    /// Waits for the process to end.
    ///
    /// # Errors
    /// If its exit status is not 0.
    pub async fn wait(&mut self) -> Result<()> {
        let status = self.ended().await?;
        if !status.success() {
            bail!("{} failed ({status})", self.name);
        }
        Ok(())
    }

    /// Requests the process to end, and waits.
    ///
    /// # Errors
    /// If its exit status is not 0, or it had to be killed.
    pub async fn end(&mut self) -> Result<()> {
        self.end_after("").await
    }

    /// Requests the process to end because it is started again, and waits.
    ///
    /// # Errors
    /// As [`end`](Self::end).
    pub async fn end_to_start_again(&mut self) -> Result<()> {
        self.end_after(AGAIN).await
    }

    /// Writes the last words of standard input, ends it, and waits for the process.
    async fn end_after(&mut self, words: &str) -> Result<()> {
        if let Some(mut input) = self.input.take() {
            // A process that no longer reads has ended, or is killed below.
            let _ = input.write_all(words.as_bytes()).await;
        }
        if let Ok(ended) = timeout(END_TIME, self.wait()).await {
            return ended;
        }
        self.kill().await?;
        bail!("{} did not end within {} seconds", self.name, END_TIME.as_secs());
    }

    /// Ends the process at once.
    ///
    /// # Errors
    /// If the system does not end it.
    pub async fn kill(&mut self) -> Result<()> {
        self.child.kill().await.with_context(|| format!("ending {}", self.name))
    }
}

fn lines<T: AsyncRead>(stream: T) -> Lines<BufReader<T>> {
    BufReader::new(stream).lines()
}

/// Copies lines to standard error until they end. Returns the last of them.
pub async fn relay(mut lines: Lines<BufReader<ChildStderr>>) -> VecDeque<String> {
    let mut last = VecDeque::new();
    while let Ok(Some(line)) = lines.next_line().await {
        eprintln!("{line}");
        if last.len() == LAST_LINES {
            last.pop_front();
        }
        last.push_back(line);
    }
    last
}

/// A server started here.
pub struct LocalServer {
    /// The process.
    pub process: Process,
    /// The address where the server listens on this machine.
    pub address: SocketAddr,
    /// Where others join, if they may.
    pub outside: Option<Outside>,
    /// The lines that the server prints later, available once it has ended.
    pub output: JoinHandle<Vec<String>>,
}

impl LocalServer {
    /// Starts a server, and waits until it accepts connections. The arguments state where it
    /// listens.
    ///
    /// # Errors
    /// If it cannot be started or ends at once. It then reports the reason on standard error.
    pub async fn start(arguments: Vec<OsString>) -> Result<LocalServer> {
        let mut process = Process::start("holoserver", &arguments, Stdio::inherit())?;
        let mut output = process.output()?;
        let (mut invitation, mut elsewhere) = (None, None);
        let address = loop {
            let line = output.next_line().await?;
            let line = line.as_deref().unwrap_or_default();
            if let Some(join) = line.strip_prefix("join with ") {
                invitation = Some(join.parse()?);
            } else if let Some(address) = line.strip_prefix("listening for other machines on ") {
                elsewhere = Some(address.parse()?);
            } else if let Some(address) = line.strip_prefix("listening on ") {
                break address.parse()?;
            } else {
                process.wait().await?;
                bail!("the server did not say where it listens");
            }
        };
        let outside = invitation.zip(elsewhere);
        let outside = outside.map(|(invitation, address)| Outside { address, invitation });
        let output = tokio::spawn(async move {
            let mut lines = Vec::new();
            while let Ok(Some(line)) = output.next_line().await {
                lines.push(line);
            }
            lines
        });
        Ok(LocalServer { process, address, outside, output })
    }

    /// Prints the string to join with and the address, if other machines may join.
    pub fn invite(&self) {
        if let Some(Outside { address, invitation }) = &self.outside {
            holo_progress::print_line!("join with {invitation}");
            holo_progress::print_line!("listening for other machines on {address}");
        }
    }
}
