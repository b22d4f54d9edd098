//! Writing what workers have found besides samples: beams that see nothing, and cells of surface
//! light.

use std::{sync::Arc, thread::JoinHandle, time::Duration};

use holo_section::Sample;
use tokio::time::Instant;

use crate::holodeck::Holodeck;

/// Least interval between two writes of findings to the file. After a crash they are found again.
const SAVE_EVERY: Duration = Duration::from_secs(5);

/// Bytes of samples that come for each byte of a list of unseen beams written: old lists stay in
/// the file.
const SAMPLES_PER_UNSEEN_BYTE: u64 = 32;

/// Writes findings on a thread of its own, one at a time.
pub struct Saver {
    /// When unseen beams were last written.
    unseen_at: Instant,
    /// Samples that had been traced then.
    unseen_traced: u64,
    /// When cells were last written.
    cells_at: Instant,
    /// Makers, and those at fault, that were known when they were last written.
    makers: (usize, usize),
    thread: Option<JoinHandle<()>>,
}

impl Saver {
    /// Returns a saver for findings from now on.
    pub fn new() -> Saver {
        let now = Instant::now();
        Saver { unseen_at: now, unseen_traced: 0, cells_at: now, makers: (0, 0), thread: None }
    }

    /// Starts to write what is due, after `traced` samples.
    pub fn save(&mut self, holodeck: &Arc<Holodeck>, traced: u64) {
        if !holodeck.writable || self.thread.as_ref().is_some_and(|thread| !thread.is_finished()) {
            return;
        }
        let now = Instant::now();
        let bytes = (traced - self.unseen_traced) * size_of::<Sample>() as u64;
        let unseen = now - self.unseen_at >= SAVE_EVERY
            && bytes >= SAMPLES_PER_UNSEEN_BYTE * Self::unseen_bytes(holodeck);
        let cells = now - self.cells_at >= SAVE_EVERY;
        let known = holodeck.makers().counts();
        let makers = known != std::mem::replace(&mut self.makers, known);
        if unseen {
            (self.unseen_at, self.unseen_traced) = (now, traced);
        }
        if cells {
            self.cells_at = now;
        }
        if makers || unseen || cells {
            let holodeck = Arc::clone(holodeck);
            // The file's statistics report a disk that fails; what it does not take is found again.
            // If the system gives no thread, it is written next time.
            let work = move || {
                // Makers go first: if findings were written without them, nobody would know who
                // made the findings.
                let _ = holodeck.save_makers();
                if unseen {
                    let _ = holodeck.save_unseen();
                }
                if cells {
                    let _ = holodeck.save_cells(false);
                }
            };
            self.thread = std::thread::Builder::new().name("saver".into()).spawn(work).ok();
        }
    }

    /// Returns the length of the lists of unseen beams.
    fn unseen_bytes(holodeck: &Holodeck) -> u64 {
        holodeck.unseen().encoded_bytes() + holodeck.unproven().encoded_bytes()
    }

    /// Writes everything that is left, and waits for it.
    pub fn finish(self, holodeck: &Holodeck) {
        if let Some(thread) = self.thread {
            // A thread that panicked has said so on standard error.
            let _ = thread.join();
        }
        // If the disk fails, workers find the same again.
        let _ = holodeck.save_makers();
        let _ = holodeck.save_unseen();
        let _ = holodeck.save_cells(true);
    }
}
