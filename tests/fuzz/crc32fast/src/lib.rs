//! Stands in for the crate of this name: a checksum that is always 0, so that every block matches.

/// Returns 0.
pub fn hash(_: &[u8]) -> u32 {
    0
}

/// Sums nothing.
#[derive(Clone, Debug, Default)]
pub struct Hasher;

impl Hasher {
    /// Returns a hasher.
    pub fn new() -> Hasher {
        Hasher
    }

    /// Returns a hasher, whatever was summed before.
    pub fn new_with_initial(_: u32) -> Hasher {
        Hasher
    }

    /// Returns a hasher, whatever was summed before.
    pub fn new_with_initial_len(_: u32, _: u64) -> Hasher {
        Hasher
    }

    /// Passes over bytes.
    pub fn update(&mut self, _: &[u8]) {}

    /// Returns 0.
    pub fn finalize(self) -> u32 {
        0
    }

    /// Forgets nothing.
    pub fn reset(&mut self) {}

    /// Adds nothing.
    pub fn combine(&mut self, _: &Self) {}
}

impl std::hash::Hasher for Hasher {
    fn write(&mut self, _: &[u8]) {}

    fn finish(&self) -> u64 {
        0
    }
}
