//! Lists of samples in pieces that never move. A list that grows by moving leaves holes in the
//! heap: with 36 M samples they were half as large as the samples.

use std::mem::take;

use crate::store::StoredLight;

/// Samples in the first piece of a list. Each piece has twice as many as the one before, up to
/// [`MOST`].
const FEWEST: usize = 4;

/// Samples in the longest pieces: 1.5 KiB.
const MOST: usize = 64;

/// The largest share of a store's memory that pieces leave empty, as one part of so many. Lists of
/// hundreds of samples leave less.
pub(crate) const EMPTY_PART: usize = 5;

/// Samples in the order in which they came.
#[derive(Debug, Default)]
pub(crate) struct RecordList(Vec<Vec<StoredLight>>);

impl RecordList {
    pub fn push(&mut self, record: StoredLight) {
        let last = self.0.last_mut();
        let size = last.as_ref().map_or(FEWEST, |piece| (2 * piece.capacity()).min(MOST));
        match last.filter(|piece| piece.len() < piece.capacity()) {
            Some(piece) => piece.push(record),
            None => {
                let mut piece = Vec::with_capacity(size);
                piece.push(record);
                self.0.push(piece);
            }
        }
    }

    pub fn iter(&self) -> impl Iterator<Item = &StoredLight> {
        self.0.iter().flatten()
    }

    pub fn len(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Leaves the samples for which `stays` is true. Returns whether others went.
    pub fn retain(&mut self, mut stays: impl FnMut(&StoredLight) -> bool) -> bool {
        let before = self.len();
        let all = take(self).0.into_iter().flatten();
        all.filter(|record| stays(record)).for_each(|record| self.push(record));
        self.len() < before
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cell::{Key, SampleLight};

    fn record(number: usize) -> StoredLight {
        let light = SampleLight { rgb: [number as f32; 3], paths: 1 };
        StoredLight { key: Key(0), light }
    }

    #[test]
    fn a_list_keeps_the_order_and_what_stays() {
        let numbers = |list: &RecordList| {
            list.iter().map(|record| record.light.rgb[0] as usize).collect::<Vec<_>>()
        };
        for count in [0, 1, 4, 5, 12, 124, 125, 1000] {
            let mut list = RecordList::default();
            (0..count).for_each(|number| list.push(record(number)));
            assert_eq!((list.len(), list.is_empty()), (count, count == 0));
            assert_eq!(numbers(&list), (0..count).collect::<Vec<_>>());
            assert!(list.0.iter().all(|piece| piece.capacity() <= MOST));
            assert!(!list.retain(|_| true));
            let has_gone = list.retain(|record| record.light.rgb[0] as usize % 3 == 1);
            assert_eq!(has_gone, count > 0);
            assert_eq!(numbers(&list), (0..count).filter(|n| n % 3 == 1).collect::<Vec<_>>());
        }
    }
}
