//! The mean brightness of indirect light in a scene.

use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};

use holo_light::Store;

use crate::luminance::luminance;

/// Number of records from which the mean counts as known.
const MIN_RECORDS: usize = 16;

/// The mean irradiance of a scene's records, computed again each time their number has doubled.
#[derive(Debug)]
pub(crate) struct MeanIrradiance {
    records: AtomicUsize,
    /// Bits of an `f32`.
    irradiance: AtomicU32,
}

impl MeanIrradiance {
    pub fn new() -> Self {
        Self { records: AtomicUsize::new(0), irradiance: AtomicU32::new(f32::INFINITY.to_bits()) }
    }

    /// Returns the mean luminance of the irradiance of the records. Infinite while there are few
    /// records or all are dark.
    pub fn luminance(&self, store: &Store) -> f32 {
        let count = store.len();
        if count >= MIN_RECORDS.max(2 * self.records.load(Ordering::Relaxed)) {
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
    fn the_mean_is_computed_again_when_the_number_of_records_has_doubled() {
        let store = Store::new(0.01);
        let mean = MeanIrradiance::new();
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
        (0..MIN_RECORDS as u64 - 1).for_each(|id| assert!(store.receive(record(id, 2.0))));
        assert_eq!(mean.luminance(&store), f32::INFINITY);
        let (dark, mean_of_dark) = (Store::new(0.01), MeanIrradiance::new());
        (0..2 * MIN_RECORDS as u64).for_each(|id| assert!(dark.receive(record(id, 0.0))));
        assert_eq!(mean_of_dark.luminance(&dark), f32::INFINITY);
        store.receive(record(100, 2.0));
        near(mean.luminance(&store), 2.0);
        (200..200 + MIN_RECORDS as u64 - 1).for_each(|id| assert!(store.receive(record(id, 4.0))));
        near(mean.luminance(&store), 2.0);
        store.receive(record(300, 4.0));
        near(mean.luminance(&store), 3.0);
    }
}
