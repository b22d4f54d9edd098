//! An array that is owned, or lies in a mapped file.

use std::{fmt, ops::Deref};

use crate::map::FileSlice;

/// Values in memory or in a mapped file. They are read in the same way.
#[derive(Clone)]
pub struct Array<T>(Storage<T>);

#[derive(Clone)]
enum Storage<T> {
    Owned(Vec<T>),
    Mapped(FileSlice<T>),
}

impl<T> Array<T> {
    pub(crate) fn mapped(values: FileSlice<T>) -> Array<T> {
        Array(Storage::Mapped(values))
    }

    /// Returns whether the values lie in a file, and are not in the process's own memory.
    #[must_use]
    pub fn is_mapped(&self) -> bool {
        matches!(self.0, Storage::Mapped(_))
    }
}

impl<T: Clone> Array<T> {
    /// Returns the values for writing. Those of a file are copied first.
    pub fn to_mut(&mut self) -> &mut Vec<T> {
        if let Storage::Mapped(values) = &self.0 {
            self.0 = Storage::Owned(values.to_vec());
        }
        match &mut self.0 {
            Storage::Owned(values) => values,
            Storage::Mapped(_) => unreachable!("it was copied"),
        }
    }
}

impl<T> Deref for Array<T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        match &self.0 {
            Storage::Owned(values) => values,
            Storage::Mapped(values) => values,
        }
    }
}

impl<T> Default for Array<T> {
    fn default() -> Array<T> {
        Array(Storage::Owned(Vec::new()))
    }
}

impl<T> From<Vec<T>> for Array<T> {
    fn from(values: Vec<T>) -> Array<T> {
        Array(Storage::Owned(values))
    }
}

impl<T> FromIterator<T> for Array<T> {
    fn from_iter<I: IntoIterator<Item = T>>(values: I) -> Array<T> {
        Array::from(Vec::from_iter(values))
    }
}

impl<T: Clone> Extend<T> for Array<T> {
    fn extend<I: IntoIterator<Item = T>>(&mut self, values: I) {
        self.to_mut().extend(values);
    }
}

impl<'a, T> IntoIterator for &'a Array<T> {
    type Item = &'a T;
    type IntoIter = std::slice::Iter<'a, T>;

    fn into_iter(self) -> std::slice::Iter<'a, T> {
        self.iter()
    }
}

impl<T: PartialEq> PartialEq for Array<T> {
    fn eq(&self, other: &Array<T>) -> bool {
        self[..] == other[..]
    }
}

impl<T: fmt::Debug> fmt::Debug for Array<T> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self[..].fmt(f)
    }
}

#[cfg(test)]
mod tests {
    use std::{fs, fs::File, sync::Arc};

    use super::*;
    use crate::FileBytes;

    fn mapped(bytes: &[u8]) -> (tempfile::TempDir, Arc<FileBytes>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("numbers");
        fs::write(&path, bytes).unwrap();
        (folder, Arc::new(FileBytes::map(&File::open(path).unwrap()).unwrap()))
    }

    #[test]
    fn an_array_of_a_file_equals_an_owned_one_and_is_copied_before_it_is_written() {
        let numbers: Vec<u32> = (0..100).collect();
        let (_folder, bytes) = mapped(bytemuck::cast_slice(&numbers));
        let in_file = Array::mapped(FileSlice::<u32>::new(&bytes, 0..400).unwrap());
        assert!(in_file.is_mapped() && in_file == Array::from(numbers.clone()));
        let mut copy = in_file.clone();
        assert!(copy.is_mapped());
        copy.to_mut()[7] = 0;
        copy.extend([5]);
        assert!(!copy.is_mapped() && copy.len() == 101 && copy[7] == 0);
        assert_eq!(in_file[..], numbers);
    }

    #[test]
    fn an_array_outlives_the_name_of_its_file_and_is_used_from_any_thread() {
        let (folder, bytes) = mapped(&[7; 4096]);
        let array = Array::mapped(FileSlice::<u8>::new(&bytes, 64..4096).unwrap());
        drop((folder, bytes));
        let sum = std::thread::spawn(move || array.iter().map(|&n| u64::from(n)).sum::<u64>());
        assert_eq!(sum.join().unwrap(), 7 * 4032);
    }

    #[test]
    fn a_slice_that_is_not_aligned_or_ends_beyond_the_file_or_within_a_value_is_none() {
        let (_folder, bytes) = mapped(&[1; 64]);
        let is_some = |range| FileSlice::<u32>::new(&bytes, range).is_some();
        assert!(is_some(0..64) && is_some(4..12) && is_some(8..8));
        assert!(!is_some(1..5) && !is_some(0..6) && !is_some(0..68));
        #[allow(clippy::reversed_empty_ranges)]
        let reversed = 8..4;
        assert!(!is_some(reversed));
    }
}
