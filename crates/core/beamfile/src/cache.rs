//! The beams that were read last, up to a number of bytes (Larson & Simmons 1999, §2.2).
//!
//! Invariant: the cached beams never take more than the budget. Each is valid only for the version
//! at which it was read, and is never returned for another.

use std::sync::Arc;

use holo_section::{BeamKey, NumberRun};
use lru::LruCache;

use crate::types::BeamSamples;

/// Bytes that a cached beam takes besides its samples: key, links, hash slot, allocations.
const OVERHEAD: u64 = 160;

struct CachedBeam {
    version: u32,
    bytes: u64,
    samples: Arc<BeamSamples>,
}

pub(crate) struct Cache {
    beams: LruCache<BeamKey, CachedBeam>,
    budget: u64,
    pub bytes: u64,
    pub hits: u64,
    pub misses: u64,
}

impl Cache {
    pub fn new(budget: u64) -> Self {
        Self { beams: LruCache::unbounded(), budget, bytes: 0, hits: 0, misses: 0 }
    }

    pub fn get(&mut self, key: BeamKey, version: u32) -> Option<Arc<BeamSamples>> {
        let found = self
            .beams
            .get(&key)
            .filter(|cached| cached.version == version)
            .map(|c| Arc::clone(&c.samples));
        match found {
            Some(_) => self.hits += 1,
            None => self.misses += 1,
        }
        found
    }

    pub fn put(&mut self, key: BeamKey, version: u32, samples: &Arc<BeamSamples>) {
        let bytes = (size_of_val(samples.samples.as_slice())
            + samples.runs.len() * size_of::<NumberRun>()) as u64
            + OVERHEAD;
        if let Some(old) = self.beams.pop(&key) {
            self.bytes -= old.bytes;
        }
        if bytes > self.budget {
            return;
        }
        while self.bytes + bytes > self.budget {
            match self.beams.pop_lru() {
                Some((_, old)) => self.bytes -= old.bytes,
                None => break,
            }
        }
        self.bytes += bytes;
        self.beams.put(key, CachedBeam { version, bytes, samples: Arc::clone(samples) });
    }
}
