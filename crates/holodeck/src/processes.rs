//! Starts the other processes: the program `holodeck`, with their name as first argument.
//!
//! A process reports over the socket that is its standard input (`holo_net::parent`). What it
//! prints on standard error is for people.

use std::{
    collections::VecDeque,
    ffi::OsString,
    net::SocketAddr,
    path::Path,
    process::{ExitStatus, Stdio},
    time::Duration,
};

use anyhow::{Context, Result, bail};
use holo_net::{AGAIN, ChildReports, child_link};
use holo_server::{Outside, ServerReport, Summary};
use serde::de::DeserializeOwned;
use tokio::{
    io::{AsyncBufReadExt, AsyncRead, AsyncWriteExt, BufReader, Lines},
    net::unix::OwnedWriteHalf,
    process::{Child, ChildStderr, Command},
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
    /// This process's end of the child's standard input.
    input: Option<OwnedWriteHalf>,
}

impl Process {
    /// Starts `program` as `name`. Returns also the reports of the process.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn start<T: DeserializeOwned>(
        program: &Path,
        name: &'static str,
        arguments: &[OsString],
        stderr: Stdio,
    ) -> Result<(Process, ChildReports<T>)> {
        let starting = || format!("starting {name}");
        let (input, reports, end) = child_link().with_context(starting)?;
        let child = Command::new(program)
            .arg(name)
            .args(arguments)
            .args(["--with-parent", "--reports"])
            .stdin(input)
            .stdout(Stdio::null())
            .stderr(stderr)
            // Ctrl-C reaches this process alone, which then ends the others in order.
            .process_group(0)
            .spawn()
            .with_context(starting)?;
        Ok((Process { name, child, input: Some(end) }, reports))
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
    /// What the server did. `None` if it has not ended in order.
    pub summary: JoinHandle<Option<Summary>>,
}

impl LocalServer {
    /// Starts a server, and waits until it accepts connections. The arguments state where it
    /// listens.
    ///
    /// # Errors
    /// If it cannot be started or ends at once. It then prints the reason on standard error.
    pub async fn start(program: &Path, arguments: &[OsString]) -> Result<LocalServer> {
        let (mut process, mut reports) =
            Process::start(program, "holoserver", arguments, Stdio::inherit())?;
        let Some(ServerReport::Listening { address, outside }) = reports.next().await? else {
            process.wait().await?;
            bail!("the server did not report where it listens");
        };
        let outside = match outside {
            Some((address, invitation)) => {
                Some(Outside { address, invitation: invitation.parse()? })
            }
            None => None,
        };
        let summary = tokio::spawn(async move {
            let mut summary = None;
            while let Ok(Some(report)) = reports.next().await {
                if let ServerReport::Ended(ended) = report {
                    summary = Some(ended);
                }
            }
            summary
        });
        Ok(LocalServer { process, address, outside, summary })
    }
}
