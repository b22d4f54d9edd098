//! Lists in pieces that never move. A list that grows by moving leaves holes in the
//! heap: with 36 M samples they were half as large as the samples.

use std::mem::take;

/// Elements in the first piece of a list. Each piece has twice as many as the one before, up to
/// [`MOST`].
const FEWEST: usize = 4;

/// Elements in the longest pieces: 1.5 KiB of samples.
const MOST: usize = 64;

/// The largest share of a store's memory that pieces leave empty, as one part of so many. Lists of
/// hundreds of samples leave less.
pub(crate) const EMPTY_PART: usize = 5;

/// A list that never moves its elements.
#[derive(Debug)]
pub(crate) struct RecordList<T>(Vec<Vec<T>>);

impl<T> Default for RecordList<T> {
    fn default() -> RecordList<T> {
        RecordList(Vec::new())
    }
}

impl<T> RecordList<T> {
    pub fn push(&mut self, record: T) {
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

    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.0.iter().flatten()
    }

    pub fn len(&self) -> usize {
        self.0.iter().map(Vec::len).sum()
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Leaves the elements for which `stays` is true. Returns whether others went.
    pub fn retain(&mut self, mut stays: impl FnMut(&T) -> bool) -> bool {
        let before = self.len();
        let all = take(self).0.into_iter().flatten();
        all.filter(|record| stays(record)).for_each(|record| self.push(record));
        self.len() < before
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_keeps_the_order_and_what_stays() {
        let numbers = |list: &RecordList<u32>| list.iter().copied().collect::<Vec<_>>();
        for count in [0, 1, 4, 5, 12, 124, 125, 1000] {
            let mut list = RecordList::default();
            (0..count).for_each(|number| list.push(number));
            assert_eq!((list.len(), list.is_empty()), (count as usize, count == 0));
            assert_eq!(numbers(&list), (0..count).collect::<Vec<_>>());
            assert!(list.0.iter().all(|piece| piece.capacity() <= MOST));
            assert!(!list.retain(|_| true));
            let has_gone = list.retain(|number| number % 3 == 1);
            assert_eq!(has_gone, count > 0);
            assert_eq!(numbers(&list), (0..count).filter(|n| n % 3 == 1).collect::<Vec<_>>());
        }
    }
}
