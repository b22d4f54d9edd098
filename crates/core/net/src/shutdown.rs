//! A request to end that every process receives in the same way.

use std::{io::Read, sync::Arc};

use tokio::sync::watch;

/// Exit status that shells show for an interrupted process.
const INTERRUPTED: i32 = 130;

/// A line of standard input. A parent that is about to start the process again writes this line and
/// then ends the input.
pub const AGAIN: &str = "again\n";

/// A request to end, shared by all parts of a process: once triggered it stays so.
#[derive(Clone, Debug)]
pub struct Shutdown {
    sender: Arc<watch::Sender<Option<Ending>>>,
}

/// Why a process is to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Nobody has said that it is needed again.
    ForGood,
    /// Its parent starts it again.
    ToStartAgain,
}

impl Default for Shutdown {
    fn default() -> Self {
        Self::new()
    }
}

impl Shutdown {
    /// Returns a request that is not triggered yet.
    pub fn new() -> Shutdown {
        Shutdown { sender: Arc::new(watch::Sender::new(None)) }
    }

    /// Asks everyone to end.
    pub fn trigger(&self) {
        self.end(Ending::ForGood);
    }

    fn end(&self, ending: Ending) {
        self.sender.send_replace(Some(ending));
    }

    /// Returns whether it was triggered.
    pub fn is_triggered(&self) -> bool {
        self.sender.borrow().is_some()
    }

    /// Waits until it is triggered.
    pub async fn wait(&self) {
        self.ending().await;
    }

    /// Waits until it is triggered, and returns why.
    pub async fn ending(&self) -> Ending {
        let mut receiver = self.sender.subscribe();
        // The sender lives as long as `self`, so this cannot fail.
        let ending = receiver.wait_for(Option::is_some).await;
        ending.ok().and_then(|ending| *ending).unwrap_or(Ending::ForGood)
    }

    /// Triggers on Ctrl-C and on SIGTERM. With `with_parent`, also triggers when standard input
    /// ends. A child process then ends with its parent, even if the parent was killed. If all of
    /// standard input is [`AGAIN`], it ends to start again.
    ///
    /// A second Ctrl-C or SIGTERM ends the process at once, with status 130, because an orderly end
    /// may wait for a disk that hangs.
    ///
    /// Must be called within a tokio runtime.
    ///
    /// # Errors
    /// The operating system's, if signals cannot be received.
    pub fn on_signals(&self, with_parent: bool) -> std::io::Result<()> {
        use tokio::signal::unix::{SignalKind, signal};
        for kind in [SignalKind::interrupt(), SignalKind::terminate()] {
            let mut signals = signal(kind)?;
            let shutdown = self.clone();
            tokio::spawn(async move {
                signals.recv().await;
                shutdown.trigger();
                signals.recv().await;
                std::process::exit(INTERRUPTED);
            });
        }
        if with_parent {
            let shutdown = self.clone();
            // A thread, not a task: reading standard input cannot be cancelled and must not hold up
            // the runtime's end.
            std::thread::spawn(move || {
                let mut input = std::io::stdin();
                let mut said = Vec::new();
                // An input that cannot be read has ended. A longer one is no such line.
                let _ = input.by_ref().take(AGAIN.len() as u64).read_to_end(&mut said);
                let more = std::io::copy(&mut input, &mut std::io::sink()).unwrap_or(0);
                let is_again = said == AGAIN.as_bytes() && more == 0;
                shutdown.end(if is_again { Ending::ToStartAgain } else { Ending::ForGood });
            });
        }
        Ok(())
    }
}
