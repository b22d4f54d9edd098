//! Writing what displays wait for: named views, and everything that a settled view needs.
//!
//! Invariants:
//! - At most one thread writes, whatever displays send. What they send meanwhile is written
//!   together, by the next thread.
//! - The newest options of a view's name count. At most [`MAX_CHANGES`] names wait.
//! - The list of views stays in the file each time that it is written. So it is written only after
//!   a pause that is the longer, the longer the list.

use std::{
    collections::{BTreeMap, btree_map::Entry},
    sync::Arc,
    thread::{self, JoinHandle},
    time::Duration,
};

use holo_progress::said_once;
use tokio::{sync::mpsc::UnboundedSender, time::Instant};

use crate::{
    events::{ConnectionId, ServerEvent},
    holodeck::Holodeck,
};

/// Most names of views that wait to be written.
const MAX_CHANGES: usize = 64;

/// Least interval between two writes of the list of views.
const LEAST_PAUSE: Duration = Duration::from_millis(500);

/// Bytes of lists of views that the file grows by in a second, at most.
const VIEW_BYTES_PER_SECOND: f64 = 16384.0;

/// Changes of views, and displays that settle, since the last thread was started.
#[derive(Default)]
pub struct ViewWriter {
    changes: BTreeMap<String, Change>,
    /// Displays whose views settle, and the numbers of these views.
    settling: BTreeMap<ConnectionId, u32>,
    /// When the list of views may be written again.
    views_due: Option<Instant>,
    thread: Option<JoinHandle<()>>,
}

/// A change of one view.
struct Change {
    /// The view's new options; empty if it is removed.
    options: String,
    /// The displays that asked for it.
    askers: Vec<ConnectionId>,
}

impl ViewWriter {
    /// Takes a change of a view. Returns why it is refused, if it is.
    pub fn keep_view(
        &mut self,
        id: ConnectionId,
        name: String,
        options: String,
    ) -> Result<(), String> {
        let room = self.changes.len() < MAX_CHANGES;
        match self.changes.entry(name) {
            Entry::Occupied(mut change) => {
                let change = change.get_mut();
                change.options = options;
                if !change.askers.contains(&id) {
                    change.askers.push(id);
                }
                Ok(())
            }
            Entry::Vacant(place) if room => {
                place.insert(Change { options, askers: vec![id] });
                Ok(())
            }
            Entry::Vacant(_) => {
                Err(format!("{MAX_CHANGES} other views wait to be kept: try again later"))
            }
        }
    }

    /// Takes a display whose view settles.
    pub fn settle(&mut self, id: ConnectionId, view: u32) {
        self.settling.insert(id, view);
    }

    /// Starts to write what is due. If the system gives no thread, tries again next time.
    pub fn write(&mut self, holodeck: &Arc<Holodeck>, events: &UnboundedSender<ServerEvent>) {
        if self.thread.as_ref().is_some_and(|thread| !thread.is_finished()) {
            return;
        }
        let now = Instant::now();
        let are_views_due = !self.changes.is_empty() && self.views_due.is_none_or(|due| now >= due);
        if self.settling.is_empty() && !are_views_due {
            return;
        }
        let changes: Vec<(String, String)> = match are_views_due {
            true => {
                self.changes.iter().map(|(name, c)| (name.clone(), c.options.clone())).collect()
            }
            false => Vec::new(),
        };
        let askers: Vec<_> = self.changes.values().map(|change| change.askers.clone()).collect();
        let settling = self.settling.clone();
        let (holodeck, events) = (Arc::clone(holodeck), events.clone());
        let bytes =
            holodeck.view_bytes() + changes.iter().map(|(n, o)| n.len() + o.len()).sum::<usize>();
        let work = move || {
            if !settling.is_empty() {
                // The file's statistics report a disk that fails, and the end of the server does.
                let _ = holodeck.save_unseen();
                let _ = holodeck.writable.then(|| holodeck.file.flush());
            }
            let mark = holodeck.file.mark();
            // A server that has ended needs to know nothing.
            for (id, view) in settling {
                let _ = events.send(ServerEvent::Flushed { id, view, mark });
            }
            if !changes.is_empty() {
                let (views, results) = holodeck.keep_views(&changes);
                let refused = |(askers, result): (Vec<ConnectionId>, anyhow::Result<()>)| {
                    let reason = said_once(result.err()?.as_ref());
                    Some(askers.into_iter().map(move |id| (id, reason.clone())))
                };
                let refused = askers.into_iter().zip(results).filter_map(refused);
                let refused = refused.flatten().collect();
                let _ = events.send(ServerEvent::ViewsKept { views, refused });
            }
        };
        let Ok(thread) = thread::Builder::new().name("writer".into()).spawn(work) else { return };
        self.thread = Some(thread);
        self.settling.clear();
        if are_views_due {
            self.changes.clear();
            let pause = Duration::from_secs_f64(bytes as f64 / VIEW_BYTES_PER_SECOND);
            self.views_due = Some(now + pause.max(LEAST_PAUSE));
        }
    }

    /// Writes the views that are left, and waits for it.
    pub fn finish(self, holodeck: &Holodeck) {
        if let Some(thread) = self.thread {
            // A thread that panicked has said so on standard error.
            let _ = thread.join();
        }
        let changes: Vec<(String, String)> =
            self.changes.into_iter().map(|(name, change)| (name, change.options)).collect();
        // Those who asked have no time left to hear of a failure.
        let _ = holodeck.keep_views(&changes);
    }
}

#[cfg(test)]
mod tests {
    use holo_proto::control::RenderSettings;
    use holo_section::{SectionSpec, ViewClass};
    use tokio::sync::mpsc::unbounded_channel;

    use super::*;
    use crate::about::HolodeckDescription;

    #[test]
    fn a_flood_of_views_is_one_write_and_every_asker_hears_of_it() {
        let folder = tempfile::tempdir().unwrap();
        let spec = SectionSpec {
            origin: [0.0; 3],
            axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
            grid: [2; 3],
            class: ViewClass::Interior,
            obstructions: true,
        };
        let about =
            HolodeckDescription::new(vec![spec], RenderSettings::default(), b"s", "a test".into());
        let path = folder.path().join("a.holo");
        let holodeck = Arc::new(Holodeck::create(&path, about, b"s", 0).unwrap());
        let before = holodeck.file.stats().file_bytes;
        let (events, mut received) = unbounded_channel();
        let (a, b) = (ConnectionId::next(), ConnectionId::next());
        let mut writer = ViewWriter::default();
        for number in 0..100_000 {
            writer.keep_view(a, format!("view {}", number % 3), format!("-vf {number}")).unwrap();
        }
        writer.keep_view(b, "none".into(), String::new()).unwrap();
        let many = (0..1000).filter(|n| writer.keep_view(b, format!("{n}"), "-".into()).is_ok());
        assert_eq!(many.count(), MAX_CHANGES - 4);
        writer.settle(a, 1);
        writer.settle(a, 2);
        writer.write(&holodeck, &events);
        // What comes while it writes waits for the next time.
        writer.keep_view(a, "view 0".into(), String::new()).unwrap();
        writer.write(&holodeck, &events);
        writer.finish(&holodeck);
        let Some(ServerEvent::Flushed { view: 2, .. }) = received.blocking_recv() else { panic!() };
        let Some(ServerEvent::ViewsKept { views, refused }) = received.blocking_recv() else {
            panic!()
        };
        assert_eq!(views.len(), MAX_CHANGES - 1);
        let options = |name: &str| {
            views.iter().find(|(known, _)| known == name).map(|(_, options)| options.clone())
        };
        assert_eq!(options("view 2").unwrap(), "-vf 99998");
        let [(asker, reason)] = &refused[..] else { panic!("{refused:?}") };
        assert!(*asker == b && reason.contains("no view named `none`"), "{reason}");
        let kept = holodeck.welcome().views;
        assert!(kept.len() == MAX_CHANGES - 2 && !kept.iter().any(|(name, _)| name == "view 0"));
        assert!(holodeck.file.stats().file_bytes < before + (1 << 16));
    }
}
