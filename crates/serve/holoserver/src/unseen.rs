//! Beams that see nothing: a worker has proved that none of their rays hits anything. They are
//! neither traced nor stored.
//!
//! Invariants:
//! - A beam leaves a server's set only if the worker that added it is found to be wrong.
//! - It takes a bit for each beam, in at most [`MAX_PAGES`] pages. Further beams are not
//!   remembered, which only costs a worker another look.

use anyhow::{Result, ensure};
use holo_section::{BeamId, BeamKey, Section};
use rustc_hash::FxHashMap;

/// Beams in a page.
const PAGE_BEAMS: u64 = 1 << 16;
const PAGE_BYTES: usize = (PAGE_BEAMS / 8) as usize;
/// Bytes of a page in the file: section `u16`, zero `u16`, number `u32`, bits.
const RECORD_BYTES: usize = 8 + PAGE_BYTES;
/// Version of the bytes in the file: all beams were checked.
const FORMAT: u32 = 2;
/// The version of files that do not distinguish checked claims from others. The layout is the same.
const FORMAT_UNCHECKED: u32 = 1;
/// Most pages: 64 MiB, all beams of one section of the finest grid.
pub const MAX_PAGES: usize = 8192;

/// A set of beams.
#[derive(Clone, Debug, Default)]
pub struct UnseenBeams {
    pages: FxHashMap<(u16, u32), Box<[u8]>>,
    counts: Vec<u64>,
    /// Number of changes so far.
    changes: u64,
}

/// Returns the page and the bit of a beam; `None` for a number that no section has.
fn page_and_bit(key: BeamKey) -> Option<((u16, u32), usize)> {
    let page = u32::try_from(key.beam.0 / PAGE_BEAMS).ok()?;
    Some(((key.section, page), (key.beam.0 % PAGE_BEAMS) as usize))
}

impl UnseenBeams {
    /// Returns whether the beam is known to see nothing.
    pub fn contains(&self, key: BeamKey) -> bool {
        page_and_bit(key).is_some_and(|(page, bit)| {
            self.pages.get(&page).is_some_and(|bits| {
                bits.get(bit / 8).is_some_and(|byte| byte >> (bit % 8) & 1 == 1)
            })
        })
    }

    /// Adds a beam. Returns false if it is there already, or there is no room for it.
    pub fn insert(&mut self, key: BeamKey) -> bool {
        let Some((page, bit)) = page_and_bit(key) else { return false };
        if self.pages.len() >= MAX_PAGES && !self.pages.contains_key(&page) {
            return false;
        }
        let bits = self.pages.entry(page).or_insert_with(|| vec![0; PAGE_BYTES].into());
        let mask = 1 << (bit % 8);
        let new = bits[bit / 8] & mask == 0;
        bits[bit / 8] |= mask;
        if new {
            let section = usize::from(key.section);
            self.counts.resize(self.counts.len().max(section + 1), 0);
            self.counts[section] += 1;
            self.changes += 1;
        }
        new
    }

    /// Removes a beam. Returns false if it is not there.
    pub fn remove(&mut self, key: BeamKey) -> bool {
        let Some((page, bit)) = page_and_bit(key) else { return false };
        let Some(bits) = self.pages.get_mut(&page) else { return false };
        let mask = 1 << (bit % 8);
        let had = bits[bit / 8] & mask != 0;
        bits[bit / 8] &= !mask;
        if had {
            self.counts[usize::from(key.section)] -= 1;
            self.changes += 1;
        }
        had
    }

    /// Removes all beams of another set.
    pub fn subtract(&mut self, others: &UnseenBeams) {
        for (name, other) in &others.pages {
            let Some(bits) = self.pages.get_mut(name) else { continue };
            let mut removed = 0;
            for (byte, other) in bits.iter_mut().zip(other.iter()) {
                removed += u64::from((*byte & other).count_ones());
                *byte &= !other;
            }
            if removed > 0 {
                self.counts[usize::from(name.0)] -= removed;
                self.changes += 1;
            }
            if bits.iter().all(|byte| *byte == 0) {
                self.pages.remove(name);
            }
        }
    }

    /// Adds all beams of another set for which there is room.
    pub fn add(&mut self, others: &UnseenBeams) {
        others.iter().for_each(|key| _ = self.insert(key));
    }

    /// Returns the number of pages.
    pub fn pages(&self) -> usize {
        self.pages.len()
    }

    /// Returns whether a beam's page is there.
    pub fn has_page_of(&self, key: BeamKey) -> bool {
        page_and_bit(key).is_some_and(|(page, _)| self.pages.contains_key(&page))
    }

    /// Returns the number of changes so far.
    pub fn changes(&self) -> u64 {
        self.changes
    }

    /// Returns the number of beams in all sections.
    pub fn count(&self) -> u64 {
        self.counts.iter().sum()
    }

    /// Returns the number of beams in one section.
    pub fn count_in(&self, section: usize) -> u64 {
        self.counts.get(section).copied().unwrap_or(0)
    }

    /// Iterates over all beams, in no order.
    pub fn iter(&self) -> impl Iterator<Item = BeamKey> {
        self.pages.iter().flat_map(|(&(section, page), bits)| {
            ones(bits).map(move |bit| BeamKey {
                section,
                beam: BeamId(u64::from(page) * PAGE_BEAMS + u64::from(bit)),
            })
        })
    }

    /// Returns the length of [`encode`](Self::encode)'s bytes.
    pub fn encoded_bytes(&self) -> u64 {
        8 + (self.pages.len() * RECORD_BYTES) as u64
    }

    /// Returns the bytes of the file's blob: version, number of pages, pages by section and number.
    pub fn encode(&self) -> Vec<u8> {
        let mut names: Vec<_> = self.pages.keys().copied().collect();
        names.sort_unstable();
        let mut out = Vec::with_capacity(self.encoded_bytes() as usize);
        out.extend_from_slice(&FORMAT.to_le_bytes());
        out.extend_from_slice(&(names.len() as u32).to_le_bytes());
        for name @ (section, page) in names {
            out.extend_from_slice(&section.to_le_bytes());
            out.extend_from_slice(&[0; 2]);
            out.extend_from_slice(&page.to_le_bytes());
            out.extend_from_slice(&self.pages[&name]);
        }
        out
    }

    /// Parses a blob's bytes. Returns the set, and whether its beams were checked.
    ///
    /// # Errors
    /// If they are no such set, or name beams that the sections do not have.
    pub fn decode(bytes: &[u8], sections: &[Section]) -> Result<(UnseenBeams, bool)> {
        ensure!(bytes.len() >= 8, "{} bytes are no set of beams", bytes.len());
        let (head, rest) = bytes.split_at(8);
        let (format, pages) = (word(&head[..4]), word(&head[4..]) as usize);
        ensure!(
            [FORMAT, FORMAT_UNCHECKED].contains(&format),
            "this program does not know format {format}"
        );
        ensure!(pages <= MAX_PAGES, "{pages} pages are more than {MAX_PAGES}");
        ensure!(
            rest.len() == pages * RECORD_BYTES,
            "{pages} pages do not take {} bytes",
            bytes.len()
        );
        let mut set = UnseenBeams { counts: vec![0; sections.len()], ..UnseenBeams::default() };
        let mut last = None;
        for record in rest.chunks_exact(RECORD_BYTES) {
            let (section, page) = (u16::from_le_bytes([record[0], record[1]]), word(&record[4..8]));
            ensure!(last.is_none_or(|last| last < (section, page)), "pages are not in order");
            last = Some((section, page));
            let beams = sections.get(usize::from(section)).map_or(0, Section::beam_count);
            let first = u64::from(page) * PAGE_BEAMS;
            let bits = &record[8..];
            let known = ones(bits).all(|bit| first + u64::from(bit) < beams);
            ensure!(known && first < beams, "section {section} has only {beams} beams");
            set.counts[usize::from(section)] += ones(bits).count() as u64;
            set.pages.insert((section, page), bits.into());
        }
        Ok((set, format == FORMAT))
    }
}

fn word(bytes: &[u8]) -> u32 {
    bytes.iter().rev().fold(0, |word, &byte| word << 8 | u32::from(byte))
}

/// Iterates over the numbers of the bits that are 1.
fn ones(bytes: &[u8]) -> impl Iterator<Item = u32> {
    (0u32..).step_by(8).zip(bytes).filter(|(_, byte)| **byte != 0).flat_map(|(first, &byte)| {
        (0..8).filter(move |bit| byte >> bit & 1 == 1).map(move |bit| first + bit)
    })
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use holo_section::{SectionSpec, ViewClass};

    use super::*;

    fn section(grid: [u32; 3]) -> Section {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let class = ViewClass::Interior;
        Section::new(SectionSpec { origin: [0.0; 3], axes, grid, class, obstructions: true })
            .unwrap()
    }

    fn key(section: u16, beam: u64) -> BeamKey {
        BeamKey { section, beam: BeamId(beam) }
    }

    #[test]
    fn a_set_holds_what_was_put_in_and_comes_back_from_its_bytes() {
        let sections = [section([8; 3]), section([3, 4, 5]), section([64; 3])];
        let (mut set, mut model) = (UnseenBeams::default(), BTreeSet::new());
        let mut state = 1u64;
        for _ in 0..5000 {
            state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            let number = (state >> 40) as u16 % 3;
            // Half of them are near each other, so that some come twice and pages are shared.
            let range =
                if state >> 63 == 0 { 700 } else { sections[usize::from(number)].beam_count() };
            let key = key(number, (state >> 8) % range);
            assert_eq!(set.insert(key), model.insert(key));
            if (state >> 20).is_multiple_of(7) {
                assert_eq!(set.remove(key), model.remove(&key));
                assert!(!set.remove(key) && !set.contains(key));
            }
        }
        let changes = set.changes();
        assert!(!set.remove(key(2, u64::MAX)) && set.changes() == changes);
        let (decoded, is_checked) = UnseenBeams::decode(&set.encode(), &sections).unwrap();
        assert!(is_checked);
        assert_eq!(set.encode().len() as u64, set.encoded_bytes());
        for set in [&set, &decoded] {
            assert_eq!(set.iter().collect::<BTreeSet<_>>(), model);
            assert_eq!(set.count(), model.len() as u64);
            for number in 0..4u16 {
                let here = model.iter().filter(|key| key.section == number).count() as u64;
                assert_eq!(set.count_in(usize::from(number)), here);
            }
            assert!(model.iter().all(|&key| set.contains(key)));
            let others = (0..20_000).map(|beam| key(0, beam)).filter(|key| !model.contains(key));
            assert!(others.into_iter().all(|key| !set.contains(key)));
        }
    }

    #[test]
    fn damaged_bytes_are_refused_and_never_name_beams_that_do_not_exist() {
        let sections = [section([3, 4, 5]), section([8; 3])];
        let mut set = UnseenBeams::default();
        set.insert(key(0, 7297));
        set.insert(key(1, 70_000));
        let good = set.encode();
        assert!(UnseenBeams::decode(&good, &sections).is_ok());
        assert!(
            UnseenBeams::decode(&good, &sections[..1]).is_err(),
            "a section that does not exist"
        );
        assert!(
            UnseenBeams::decode(&good, &[section([3, 4, 4]), sections[1].clone()]).is_err(),
            "one beam too many"
        );
        for length in [0, 7, 8, good.len() - 1] {
            assert!(UnseenBeams::decode(&good[..length], &sections).is_err(), "{length} bytes");
        }
        assert!(UnseenBeams::decode(&[good.clone(), vec![0]].concat(), &sections).is_err());
        let with = |at: usize, byte: u8| {
            let mut bytes = good.clone();
            bytes[at] = byte;
            UnseenBeams::decode(&bytes, &sections)
        };
        assert!(with(0, 1).is_ok_and(|(_, is_checked)| !is_checked), "an older file");
        assert!(with(0, 3).is_err(), "another format");
        assert!(with(7, 0xff).is_err(), "four billion pages");
        let twice = [&good[..8], &good[8 + RECORD_BYTES..], &good[8 + RECORD_BYTES..]].concat();
        assert!(
            UnseenBeams::decode(&twice, &sections)
                .is_err_and(|error| error.to_string().contains("order"))
        );
        assert!(with(12, 1).is_err(), "a page beyond the section");
    }

    #[test]
    fn memory_is_bounded_whatever_comes() {
        let mut set = UnseenBeams::default();
        let inserted = (0..10_000u64).filter(|page| set.insert(key(9, page * PAGE_BEAMS))).count();
        assert_eq!((inserted, set.pages.len()), (MAX_PAGES, MAX_PAGES));
        assert!(set.insert(key(9, 1)), "in a page that is there");
        assert!(!set.insert(key(9, u64::MAX)) && !set.contains(key(9, u64::MAX)));
    }
}
