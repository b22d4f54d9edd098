//! Records of indirect light are added on a thread of their own, so that samples do not wait
//! behind tens of thousands of them.
//!
//! Invariant: [`Lights::wait`] returns once every record given before is in the store, or when its
//! time is over.

use std::{
    sync::{Arc, Condvar, Mutex, PoisonError, mpsc},
    thread,
    time::Duration,
};

use holo_light::Store;
use holo_proto::bulk::Light;

/// Gives records to the thread that adds them.
#[derive(Clone)]
pub struct Lights {
    /// `None` if the system has no more threads: records are added at once.
    sender: Option<mpsc::Sender<Light>>,
    records: Arc<Store>,
    pending: Arc<Pending>,
}

/// Counts messages whose records are not in the store yet.
#[derive(Default)]
struct Pending {
    count: Mutex<usize>,
    changed: Condvar,
}

impl Pending {
    fn change(&self, by: isize) {
        let mut count = self.count.lock().unwrap_or_else(PoisonError::into_inner);
        *count = count.saturating_add_signed(by);
        self.changed.notify_all();
    }
}

impl Lights {
    /// Starts the thread that adds records to `records`. It ends when nobody gives any more.
    pub fn new(records: Arc<Store>) -> Lights {
        let pending = Arc::<Pending>::default();
        let (sender, lights) = mpsc::channel::<Light>();
        let (store, left) = (Arc::clone(&records), Arc::clone(&pending));
        let add_all = move || {
            for light in lights {
                add(&store, light);
                left.change(-1);
            }
        };
        let started = thread::Builder::new().name("light".into()).spawn(add_all).is_ok();
        Lights { sender: started.then_some(sender), records, pending }
    }

    /// Adds a message's records, soon.
    pub fn give(&self, light: Light) {
        let Some(sender) = &self.sender else { return add(&self.records, light) };
        self.pending.change(1);
        if let Err(mpsc::SendError(light)) = sender.send(light) {
            add(&self.records, light);
            self.pending.change(-1);
        }
    }

    /// Waits until all records given so far are in the store, at most `limit`.
    pub fn wait(&self, limit: Duration) {
        let count = self.pending.count.lock().unwrap_or_else(PoisonError::into_inner);
        // Whether all are in by then or not, the session goes on.
        let _ = self.pending.changed.wait_timeout_while(count, limit, |count| *count > 0);
    }
}

fn add(records: &Store, light: Light) {
    for record in light.records {
        records.receive(record);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use holo_light::Record;

    #[test]
    fn every_record_given_is_in_the_store_after_the_wait() {
        let records = Arc::new(Store::new(0.01));
        let lights = Lights::new(Arc::clone(&records));
        let record = |id: u64| Record {
            point: [id as f32, 0.0, 0.0],
            radius: 0.1,
            normal: [0.0, 0.0, 1.0],
            nearest: 1.0,
            irradiance: [1.0; 3],
            error: 0.0,
            shift: [[0.0; 3]; 3],
            turn: [[0.0; 3]; 3],
            rays: 1,
            flags: 0,
            id,
        };
        for message in 0..20 {
            lights.give(Light { records: (0..100).map(|k| record(message * 100 + k)).collect() });
        }
        lights.wait(Duration::from_secs(20));
        assert_eq!(records.len(), 2000);
    }
}
