//! Starting the other processes: this same program, with their name as first argument.

use std::{ffi::OsString, net::SocketAddr, process::Stdio, time::Duration};

use anyhow::{Context, Result, bail};
use tokio::{
    io::{AsyncBufReadExt, BufReader},
    process::{Child, ChildStdin, Command},
    task::JoinHandle,
    time::timeout,
};

/// How long a process may take to end once asked: a server writes what it has.
const END_TIME: Duration = Duration::from_secs(30);

/// How much local workers give way, so that a viewer on the same machine stays smooth.
const WORKER_NICE: &str = "5";

/// A process started here. It ends when its standard input does: with this one, however that comes about.
pub struct Process {
    name: &'static str,
    child: Child,
    /// Kept apart, since waiting for a child closes the input that it still holds.
    input: Option<ChildStdin>,
}

impl Process {
    fn start(name: &'static str, arguments: Vec<OsString>, stdout: Stdio) -> Result<Process> {
        let program = std::env::current_exe().context("finding this program")?;
        let mut child = Command::new(program)
            .arg(name)
            .args(arguments)
            .arg("--with-parent")
            .stdin(Stdio::piped())
            .stdout(stdout)
            // Ctrl-C reaches this process alone, which then ends the others in order.
            .process_group(0)
            .spawn()
            .with_context(|| format!("starting {name}"))?;
        let input = child.stdin.take();
        Ok(Process { name, child, input })
    }

    /// Waits for its end; an exit status other than 0 is an error.
    pub async fn wait(&mut self) -> Result<()> {
        let status =
            self.child.wait().await.with_context(|| format!("waiting for {}", self.name))?;
        if !status.success() {
            bail!("{} failed ({status})", self.name);
        }
        Ok(())
    }

    /// Asks it to end, and waits.
    pub async fn end(mut self) -> Result<()> {
        drop(self.input.take());
        if let Ok(ended) = timeout(END_TIME, self.wait()).await {
            return ended;
        }
        self.child.kill().await.with_context(|| format!("ending {}", self.name))?;
        bail!("{} did not end within {} seconds", self.name, END_TIME.as_secs());
    }
}

/// A server started here.
pub struct Server {
    /// The process.
    pub process: Process,
    /// Where it listens.
    pub address: SocketAddr,
    /// The lines that it prints after saying so, once it has ended.
    pub output: JoinHandle<Vec<String>>,
}

impl Server {
    /// Starts a server on any free port and waits until it takes connections.
    ///
    /// # Errors
    /// If it cannot be started or ends at once; it then says why on standard error.
    pub async fn start(mut arguments: Vec<OsString>) -> Result<Server> {
        arguments.extend(["--listen".into(), "127.0.0.1:0".into()]);
        let mut process = Process::start("holoserver", arguments, Stdio::piped())?;
        let output = process.child.stdout.take().context("reading the server's output")?;
        let mut output = BufReader::new(output).lines();
        let first = output.next_line().await?;
        let address = first.as_deref().and_then(|line| line.strip_prefix("listening on "));
        let Some(Ok(address)) = address.map(str::parse) else {
            process.wait().await?;
            bail!("the server did not say where it listens");
        };
        let output = tokio::spawn(async move {
            let mut lines = Vec::new();
            while let Ok(Some(line)) = output.next_line().await {
                lines.push(line);
            }
            lines
        });
        Ok(Server { process, address, output })
    }

    /// Starts a worker for it, on all cores unless `threads` says otherwise.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn worker(&self, threads: Option<u16>, quiet: bool) -> Result<Process> {
        let mut arguments: Vec<OsString> = vec![
            "--connect".into(),
            self.address.to_string().into(),
            "--nice".into(),
            WORKER_NICE.into(),
        ];
        if let Some(threads) = threads {
            arguments.extend(["--threads".into(), threads.to_string().into()]);
        }
        if quiet {
            arguments.push("--quiet".into());
        }
        Process::start("rtworker", arguments, Stdio::null())
    }
}
