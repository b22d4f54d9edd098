//! The worker of a fill or a session, which is restarted whenever it dies.

use std::{
    collections::VecDeque,
    ffi::OsString,
    future,
    net::SocketAddr,
    path::{Path, PathBuf},
    process::{ExitStatus, Stdio},
    time::{Duration, Instant},
};

use anyhow::{Error, Result, anyhow};
use holo_net::ChildReports;
use holo_progress::{Meter, said_once};
use holo_rtworker::WorkerProgress;
use tokio::{sync::watch, task::JoinHandle, time::sleep};

use crate::processes::{Process, relay};

/// Priority that local workers yield to other programs (`nice`).
pub const NICE: u8 = 5;

/// Priority that local workers yield to a display: drawing and encoding get nine tenths of a core
/// for which both compete. With more, workers would starve beside a busy program.
pub const NICE_BESIDE_DISPLAY: u8 = 10;

/// Time of tracing below which a death counts as quick, because the next life may be as short. A
/// worker that has traced for longer is healthy, and something else has killed it.
const QUICK: Duration = Duration::from_secs(2);

/// Number of quick deaths in a row after which the worker is not restarted.
const MAX_QUICK_DEATHS: u32 = 5;

/// The pause after the first death. It doubles with every quick death.
const FIRST_PAUSE: Duration = Duration::from_millis(500);

/// A worker process that is restarted when it dies.
pub struct KeptWorker {
    program: PathBuf,
    arguments: Vec<OsString>,
    life: Option<WorkerProcess>,
    deaths: Deaths,
    ready: watch::Sender<bool>,
    meter: Meter,
    /// False once the worker was ended on purpose.
    is_wanted: bool,
}

/// A running worker process.
struct WorkerProcess {
    process: Process,
    reports: ChildReports<WorkerProgress>,
    last_words: JoinHandle<VecDeque<String>>,
    ready: Option<Instant>,
}

impl KeptWorker {
    /// Starts `program` as a worker, on all cores unless `threads` states a number. It shows its
    /// progress of loading unless `quiet`.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn start(
        program: &Path,
        server: SocketAddr,
        threads: Option<u16>,
        nice: u8,
        quiet: bool,
    ) -> Result<KeptWorker> {
        let nice = nice.to_string().into();
        let mut arguments: Vec<OsString> =
            vec!["--connect".into(), server.to_string().into(), "--nice".into(), nice];
        if let Some(threads) = threads {
            arguments.extend(["--threads".into(), threads.to_string().into()]);
        }
        let life = Some(WorkerProcess::begin(program, &arguments)?);
        let (ready, _) = watch::channel(false);
        Ok(KeptWorker {
            program: program.to_owned(),
            arguments,
            life,
            deaths: Deaths::default(),
            ready,
            meter: Meter::new(quiet),
            is_wanted: true,
        })
    }

    /// Returns a future that ends once a worker is ready to trace.
    pub fn ready(&self) -> impl Future<Output = ()> + use<> {
        let mut ready = self.ready.subscribe();
        async move {
            if ready.wait_for(|ready| *ready).await.is_err() {
                // The worker was given up, and `keep` reports the reason.
                future::pending().await
            }
        }
    }

    /// Keeps the worker alive. Returns the reason when it is given up.
    ///
    /// A worker ends in order only with its server, which the caller watches. Every end therefore
    /// counts as a death here.
    pub async fn keep(&mut self) -> Error {
        if !self.is_wanted {
            return future::pending().await;
        }
        loop {
            let life = match &mut self.life {
                Some(life) => life,
                None => match WorkerProcess::begin(&self.program, &self.arguments) {
                    Ok(life) => self.life.insert(life),
                    Err(error) => return error,
                },
            };
            let status = match life.watch(&mut self.meter, &self.ready).await {
                Ok(status) => status,
                Err(error) => return error,
            };
            let Some(pause) = self.deaths.pause_after(life.traced()) else {
                return self.last_death(status).await;
            };
            self.life = None;
            if !status.success() {
                let seconds = pause.as_secs_f64();
                eprintln!("the worker died ({status}); it is started again in {seconds} s");
            }
            sleep(pause).await;
        }
    }

    /// Ends the worker at once, and starts no other one.
    ///
    /// # Errors
    /// If the system does not end it.
    pub async fn kill(&mut self) -> Result<()> {
        self.is_wanted = false;
        match self.life.take() {
            Some(mut life) => life.process.kill().await,
            None => Ok(()),
        }
    }

    /// Ends the worker if it runs, and lets [`keep`](Self::keep) start another one.
    ///
    /// # Errors
    /// If the system does not end it.
    pub async fn restart(&mut self) -> Result<()> {
        self.kill().await?;
        (self.is_wanted, self.deaths) = (true, Deaths::default());
        Ok(())
    }

    /// Returns the error for a worker that was given up.
    async fn last_death(&mut self, status: ExitStatus) -> Error {
        let words = match self.life.take() {
            Some(life) => life.last_words.await.unwrap_or_default(),
            None => VecDeque::new(),
        };
        let words = Vec::from(words).join(" / ");
        let said = if words.is_empty() { "said nothing".into() } else { format!("said: {words}") };
        anyhow!(
            "the rtworker died {MAX_QUICK_DEATHS} times in a row, each time soon after its start; \
             the last one ended with {status} and {said}"
        )
    }

    /// Requests the worker to end, and waits. Its samples are already stored, so failures are only
    /// printed.
    pub async fn end(self) {
        if let Some(mut life) = self.life
            && let Err(error) = life.process.end().await
        {
            eprintln!("{}", said_once(error.as_ref()));
        }
    }
}

impl WorkerProcess {
    fn begin(program: &Path, arguments: &[OsString]) -> Result<WorkerProcess> {
        let (mut process, reports) =
            Process::start(program, "rtworker", arguments, Stdio::piped())?;
        let errors = process.errors();
        let last_words = tokio::spawn(async move {
            match errors {
                Some(errors) => relay(errors).await,
                None => VecDeque::new(),
            }
        });
        Ok(WorkerProcess { process, reports, last_words, ready: None })
    }

    /// Follows the worker's reports until it ends.
    async fn watch(
        &mut self,
        meter: &mut Meter,
        ready: &watch::Sender<bool>,
    ) -> Result<ExitStatus> {
        while let Ok(Some(report)) = self.reports.next().await {
            match report {
                // Later lives load while the server shows its own progress.
                WorkerProgress::Loading { share, text } if !*ready.borrow() => {
                    meter.show(share, &text);
                }
                WorkerProgress::Loading { .. } => {}
                WorkerProgress::Ready => {
                    meter.finish();
                    self.ready = Some(Instant::now());
                    ready.send_replace(true);
                }
            }
        }
        // The reports have ended, so the process has ended or is about to.
        self.process.ended().await
    }

    /// Returns the time since the worker was ready to trace.
    fn traced(&self) -> Duration {
        self.ready.map_or(Duration::ZERO, |ready| ready.elapsed())
    }
}

/// Counts quick deaths in a row.
#[derive(Default)]
struct Deaths {
    quick: u32,
}

impl Deaths {
    /// Returns the pause before the next start, after a life that traced for this time. `None`
    /// after too many quick deaths in a row.
    fn pause_after(&mut self, traced: Duration) -> Option<Duration> {
        self.quick = if traced < QUICK { self.quick + 1 } else { 0 };
        let doublings = self.quick.saturating_sub(1);
        (self.quick < MAX_QUICK_DEATHS).then(|| FIRST_PAUSE * 2_u32.pow(doublings))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn five_quick_deaths_in_a_row_are_enough_and_pauses_grow_before() {
        let mut deaths = Deaths::default();
        let mut pause = |traced| deaths.pause_after(Duration::from_secs(traced));
        let seconds = |pause: Option<Duration>| pause.map(|pause| pause.as_secs_f64());
        assert_eq!(
            [0, 0, 1].map(|traced| seconds(pause(traced))),
            [Some(0.5), Some(1.0), Some(2.0)]
        );
        // Even many deaths in a night are no reason to give up if the worker traces between them.
        for traced in [2, 600].repeat(500) {
            assert_eq!(seconds(pause(traced)), Some(0.5));
        }
        let last = [0; 5].map(|traced| seconds(pause(traced)));
        assert_eq!(last, [Some(0.5), Some(1.0), Some(2.0), Some(4.0), None]);
    }
}
