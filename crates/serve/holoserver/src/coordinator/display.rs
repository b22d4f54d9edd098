//! A connected display, and what its view needs.

use std::{
    collections::BTreeMap,
    sync::{Arc, atomic::AtomicU32},
};

use holo_beamfile::Mark;
use holo_net::Outbox;
use holo_section::BeamKey;

use crate::{events::ConnectionId, live::LiveQueue, recall::Recall, wishes::Wishes};

/// A connected display.
pub struct ConnectedDisplay {
    pub outbox: Outbox,
    /// Its name, for people.
    pub name: String,
    /// True if nothing is traced for it and it cannot change the holodeck.
    pub is_read_only: bool,
    /// The beams and rays that it wants for its present view; `None` before the first view and once
    /// it has settled.
    pub wishes: Option<Wishes>,
    /// Live rays of its view.
    pub live: LiveQueue,
    /// The number of its newest view, for the thread that recalls an older one.
    pub newest: Arc<AtomicU32>,
    /// True while stored samples of its view are being sent, or wait to be.
    pub recalling: bool,
    /// True while a thread sends stored samples of its view or of an earlier one.
    pub has_recall: bool,
    /// What is sent once that thread has ended.
    pub next_recall: Option<Recall>,
    /// True while a part of the file that no view requested is being sent.
    pub is_sending_part: bool,
    /// The last packet that was given out before it began to settle; `None` if it does not settle.
    /// Later packets do not delay it. While the file is filled, some of the view's beams are always
    /// under way.
    pub settling: Option<u64>,
    /// What the file held when it last settled.
    pub settled_at: Option<Mark>,
}

impl ConnectedDisplay {
    /// Returns a display without a view.
    pub fn new(outbox: Outbox, name: String, is_read_only: bool) -> ConnectedDisplay {
        ConnectedDisplay {
            outbox,
            name,
            is_read_only,
            wishes: None,
            live: LiveQueue::default(),
            newest: Arc::default(),
            recalling: false,
            has_recall: false,
            next_recall: None,
            is_sending_part: false,
            settling: None,
            settled_at: None,
        }
    }

    /// Returns whether its view crosses the beam.
    pub fn looks_at(&self, key: BeamKey) -> bool {
        self.wishes.as_ref().is_some_and(|wishes| wishes.contains(key))
    }
}

/// Returns whether a display may show samples of the beam.
pub fn is_looked_at(displays: &BTreeMap<ConnectionId, ConnectedDisplay>, key: BeamKey) -> bool {
    displays.values().any(|display| display.looks_at(key))
}
