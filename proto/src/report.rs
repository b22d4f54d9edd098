//! Reports on a server's state, for administrators.

use serde::{Deserialize, Serialize};

use crate::printable;

/// Most faults in a report. With their texts they fit into a control message.
pub const MAX_FAULTS: usize = 256;

/// The state of a server: its file, its workers and its displays.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct StatusReport {
    /// The server's name and version.
    pub software: String,
    /// The path of the file that the server serves.
    pub file: String,
    /// The file's length, bytes.
    pub file_bytes: u64,
    /// Samples in the file and in memory.
    pub samples: u64,
    /// Samples traced since the server began.
    pub traced: u64,
    /// Samples per second from all workers, over the last few seconds.
    pub samples_per_second: f64,
    /// Beams that are known to see nothing.
    pub unseen_beams: u64,
    /// The reason why samples wait in memory; empty if they do not wait.
    pub disk_error: String,
    /// The workers.
    pub workers: Vec<WorkerReport>,
    /// The displays.
    pub displays: Vec<DisplayReport>,
    /// Machines that returned wrong results: the first [`MAX_FAULTS`].
    pub faults: Vec<FaultReport>,
}

/// One worker.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct WorkerReport {
    /// Its name, for people.
    pub name: String,
    /// The file's number for the worker's machine; 0 if the file has none.
    pub maker: u16,
    /// Threads that trace; 0 while it loads.
    pub threads: u32,
    /// Rays per second that the worker returns while it has work, by the server's clock.
    pub rays_per_second: f64,
    /// Rays that the worker has returned.
    pub rays: u64,
    /// Packets that the worker has now.
    pub packets: u32,
    /// Packets that the worker has not returned in time.
    pub late_packets: u32,
    /// Recent time between sending a packet and receiving its results, seconds.
    pub latency: f64,
    /// Bytes that wait to be sent to the worker.
    pub queued_bytes: u64,
}

/// One display.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct DisplayReport {
    /// Its name, for people.
    pub name: String,
    /// Beams of its view; 0 without a view.
    pub beams: u32,
    /// True if nothing is traced for the display.
    pub is_read_only: bool,
    /// Bytes that wait to be sent to the display.
    pub queued_bytes: u64,
}

/// A machine that returned wrong results, or two of which one does.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct FaultReport {
    /// The name of its worker, for people; of both workers if one of the two is wrong.
    pub name: String,
    /// The file's number for the worker's machine; 0 if the file has none, or for two workers.
    pub maker: u16,
    /// The name of the token with which the worker joined; empty on the server's machine.
    pub token: String,
    /// A description of what is wrong.
    pub reason: String,
    /// True if the worker was dropped, and its machine is refused from now on. False if the server
    /// cannot determine which of two workers is wrong: both stay.
    pub is_dropped: bool,
}

impl StatusReport {
    /// Replaces control characters in texts.
    pub(crate) fn clean(&mut self) {
        let names = self.workers.iter_mut().map(|worker| &mut worker.name);
        let names = names.chain(self.displays.iter_mut().map(|display| &mut display.name));
        let faults = self.faults.iter_mut();
        let faults = faults.flat_map(|f| [&mut f.name, &mut f.token, &mut f.reason]);
        let names = names.chain(faults);
        for text in names.chain([&mut self.software, &mut self.file, &mut self.disk_error]) {
            *text = printable(text);
        }
    }
}
