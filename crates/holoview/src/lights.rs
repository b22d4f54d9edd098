//! Records of indirect light are added on a thread of their own: a session's first samples come behind tens of thousands of them, and
//! the first picture had none of its samples while it waited for them.
//!
//! Invariant: [`Lights::wait`] returns once every record given before is in the store, if that takes no longer than it may.

use std::{
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
        mpsc,
    },
    thread,
    time::{Duration, Instant},
};

use holo_light::Store;
use holo_proto::bulk::Light;

/// How often it is looked whether all are in.
const TICK: Duration = Duration::from_millis(2);

/// Gives records to the thread that adds them.
#[derive(Clone)]
pub struct Lights {
    sender: Option<mpsc::Sender<Light>>,
    /// Messages whose records are not in yet.
    pending: Arc<AtomicUsize>,
}

impl Lights {
    /// Records for this store, which end when nobody gives any more; without a store they are dropped.
    pub fn new(records: Option<Arc<Store>>) -> std::io::Result<Lights> {
        let pending = Arc::new(AtomicUsize::new(0));
        let Some(records) = records else { return Ok(Lights { sender: None, pending }) };
        let (sender, lights) = mpsc::channel::<Light>();
        let left = Arc::clone(&pending);
        thread::Builder::new().name("light".into()).spawn(move || {
            for light in lights {
                light.records.into_iter().for_each(|record| {
                    records.receive(record);
                });
                left.fetch_sub(1, Ordering::Release);
            }
        })?;
        Ok(Lights { sender: Some(sender), pending })
    }

    pub fn give(&self, light: Light) {
        let Some(sender) = &self.sender else { return };
        self.pending.fetch_add(1, Ordering::AcqRel);
        if sender.send(light).is_err() {
            self.pending.fetch_sub(1, Ordering::AcqRel);
        }
    }

    /// Waits until all records given so far are in, `most` at the most.
    pub fn wait(&self, most: Duration) {
        let end = Instant::now() + most;
        while self.pending.load(Ordering::Acquire) > 0 && Instant::now() < end {
            thread::sleep(TICK);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use holo_light::Record;

    #[test]
    fn every_record_given_is_in_the_store_after_the_wait() {
        let records = Arc::new(Store::new(0.01));
        let lights = Lights::new(Some(Arc::clone(&records))).expect("a thread");
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
