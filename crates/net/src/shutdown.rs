//! A request to end that every process receives in the same way.

use std::sync::Arc;

use tokio::sync::watch;

/// Exit status that shells show for an interrupted process.
const INTERRUPTED: i32 = 130;

/// A request to end, shared by all parts of a process: once triggered it stays so.
#[derive(Clone, Debug)]
pub struct Shutdown {
    sender: Arc<watch::Sender<bool>>,
}

impl Default for Shutdown {
    fn default() -> Self {
        Self::new()
    }
}

impl Shutdown {
    /// Returns a request that is not triggered yet.
    pub fn new() -> Shutdown {
        Shutdown { sender: Arc::new(watch::Sender::new(false)) }
    }

    /// Asks everyone to end.
    pub fn trigger(&self) {
        self.sender.send_replace(true);
    }

    /// Returns whether it was triggered.
    pub fn is_triggered(&self) -> bool {
        *self.sender.borrow()
    }

    /// Waits until it is triggered.
    pub async fn wait(&self) {
        // The sender lives as long as `self`, so this cannot fail.
        let _ = self.sender.subscribe().wait_for(|&triggered| triggered).await;
    }

    /// Triggers on Ctrl-C and on SIGTERM. With `with_parent`, also triggers when standard input
    /// ends. A child process then ends with its parent, even if the parent was killed.
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
                let _ = std::io::copy(&mut std::io::stdin(), &mut std::io::sink());
                shutdown.trigger();
            });
        }
        Ok(())
    }
}
