//! How bright indirect light is in a scene as a rule.

use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};

use holo_light::Store;

use crate::lights::luminance;

/// Records that tell it at least.
const FEWEST: usize = 16;

/// The mean over a scene's records, found again whenever there are twice as many.
#[derive(Debug)]
pub(crate) struct Usual {
    records: AtomicUsize,
    irradiance: AtomicU32,
}

impl Usual {
    pub fn new() -> Self {
        Self { records: AtomicUsize::new(0), irradiance: AtomicU32::new(f32::INFINITY.to_bits()) }
    }

    /// Mean luminance of the irradiance of records; infinite as long as they are few, or all dark.
    pub fn irradiance(&self, store: &Store) -> f32 {
        let count = store.len();
        if count >= FEWEST.max(2 * self.records.load(Ordering::Relaxed)) {
            let records = (0..count).filter_map(|index| store.get(index));
            let sum: f32 = records.map(|record| luminance(record.irradiance)).sum();
            let mean = if sum > 0.0 { sum / count as f32 } else { f32::INFINITY };
            self.irradiance.store(mean.to_bits(), Ordering::Relaxed);
            self.records.store(count, Ordering::Relaxed);
        }
        f32::from_bits(self.irradiance.load(Ordering::Relaxed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use bytemuck::Zeroable;
    use holo_light::Record;

    #[test]
    fn the_mean_is_that_of_all_records_once_they_are_twice_as_many() {
        let store = Store::new(0.01);
        let usual = Usual::new();
        let record = |id: u64, light: f32| Record {
            point: [id as f32, 0.0, 0.0],
            radius: 0.1,
            normal: [0.0, 0.0, 1.0],
            irradiance: [light; 3],
            id,
            ..Record::zeroed()
        };
        let near = |found: f32, expected: f32| {
            assert!((found - expected).abs() < 1e-4 * expected, "{found} {expected}")
        };
        (0..FEWEST as u64 - 1).for_each(|id| assert!(store.receive(record(id, 2.0))));
        assert_eq!(usual.irradiance(&store), f32::INFINITY);
        let (dark, of_dark) = (Store::new(0.01), Usual::new());
        (0..2 * FEWEST as u64).for_each(|id| assert!(dark.receive(record(id, 0.0))));
        assert_eq!(of_dark.irradiance(&dark), f32::INFINITY);
        store.receive(record(100, 2.0));
        near(usual.irradiance(&store), 2.0);
        (200..200 + FEWEST as u64 - 1).for_each(|id| assert!(store.receive(record(id, 4.0))));
        near(usual.irradiance(&store), 2.0);
        store.receive(record(300, 4.0));
        near(usual.irradiance(&store), 3.0);
    }
}
