//! Claims of unseen beams that nobody has checked yet, by the machine that made them.
//!
//! These beams are not traced either, but the file lists them apart. So a server that opens the
//! file has them checked, whoever made them.

use std::collections::BTreeMap;

use anyhow::{Context, Result, ensure};
use holo_beamfile::Maker;
use holo_section::{BeamKey, Section};

use crate::unseen::{MAX_PAGES, UnseenBeams};

/// Version of the bytes in the file.
const FORMAT: u32 = 1;

/// Most machines in a blob: as many as a file has numbers for.
const MAX_MAKERS: usize = 1 << 16;

/// Claims that are not proven.
#[derive(Clone, Debug, Default)]
pub struct UnprovenClaims {
    by_maker: BTreeMap<Maker, UnseenBeams>,
    /// Number of changes so far.
    changes: u64,
}

impl UnprovenClaims {
    /// Returns claims that all come from one machine.
    pub fn of(maker: Maker, claims: UnseenBeams) -> UnprovenClaims {
        UnprovenClaims { by_maker: [(maker, claims)].into(), changes: 1 }
    }

    /// Adds a claim. Returns false if there is no room for it: the beams of all machines together
    /// take at most twice the pages of a set.
    pub fn insert(&mut self, maker: Maker, key: BeamKey) -> bool {
        let pages: usize = self.by_maker.values().map(UnseenBeams::pages).sum();
        let set = self.by_maker.entry(maker).or_default();
        if pages >= 2 * MAX_PAGES && !set.has_page_of(key) {
            return false;
        }
        let is_new = set.insert(key);
        self.changes += u64::from(is_new);
        is_new || set.contains(key)
    }

    /// Removes claims of a machine: they are proven, or wrong.
    pub fn remove(&mut self, maker: Maker, claims: &UnseenBeams) {
        if let Some(set) = self.by_maker.get_mut(&maker) {
            set.subtract(claims);
            if set.count() == 0 {
                self.by_maker.remove(&maker);
            }
            self.changes += 1;
        }
    }

    /// Removes claims of all machines, except those of beams that are in `unseen`.
    pub fn retain(&mut self, unseen: &UnseenBeams) {
        for set in self.by_maker.values_mut() {
            let mut others = set.clone();
            others.subtract(unseen);
            set.subtract(&others);
        }
        self.by_maker.retain(|_, set| set.count() > 0);
        self.changes += 1;
    }

    /// Iterates over all machines with claims.
    pub fn iter(&self) -> impl Iterator<Item = (Maker, &UnseenBeams)> {
        self.by_maker.iter().map(|(&maker, claims)| (maker, claims))
    }

    /// Returns the machine of a claim, if the beam is a claim.
    pub fn maker_of(&self, key: BeamKey) -> Option<Maker> {
        self.iter().find(|(_, claims)| claims.contains(key)).map(|(maker, _)| maker)
    }

    /// Returns how many claims there are.
    pub fn count(&self) -> u64 {
        self.by_maker.values().map(UnseenBeams::count).sum()
    }

    /// Returns the number of changes so far.
    pub fn changes(&self) -> u64 {
        self.changes
    }

    /// Returns those of these beams that are proven.
    pub fn proven(&self, all: &UnseenBeams) -> UnseenBeams {
        let mut proven = all.clone();
        self.by_maker.values().for_each(|claims| proven.subtract(claims));
        proven
    }

    /// Returns the length of [`encode`](Self::encode)'s bytes.
    pub fn encoded_bytes(&self) -> u64 {
        8 + self.by_maker.values().map(|claims| 12 + claims.encoded_bytes()).sum::<u64>()
    }

    /// Returns the bytes of the file's blob: version, number of machines; for each its number, the
    /// length of its set's bytes, and the set.
    pub fn encode(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(self.encoded_bytes() as usize);
        out.extend_from_slice(&FORMAT.to_le_bytes());
        out.extend_from_slice(&(self.by_maker.len() as u32).to_le_bytes());
        for (maker, claims) in self.iter() {
            let set = claims.encode();
            out.extend_from_slice(&u32::from(maker.0).to_le_bytes());
            out.extend_from_slice(&(set.len() as u64).to_le_bytes());
            out.extend_from_slice(&set);
        }
        out
    }

    /// Parses a blob's bytes.
    ///
    /// # Errors
    /// If they are no such claims, or name beams that the sections do not have.
    pub fn decode(bytes: &[u8], sections: &[Section]) -> Result<UnprovenClaims> {
        let mut rest = bytes;
        let format = u32::from_le_bytes(take(&mut rest)?);
        ensure!(format == FORMAT, "this program does not know format {format}");
        let count = u32::from_le_bytes(take(&mut rest)?) as usize;
        ensure!(count <= MAX_MAKERS, "{count} machines are more than {MAX_MAKERS}");
        let (mut claims, mut pages) = (UnprovenClaims::default(), 0);
        for _ in 0..count {
            let maker = u16::try_from(u32::from_le_bytes(take(&mut rest)?)).map(Maker);
            let length = u64::from_le_bytes(take(&mut rest)?);
            let length = usize::try_from(length).ok().filter(|length| *length <= rest.len());
            let (set, after) = rest.split_at(length.context("a set is cut off")?);
            rest = after;
            let (set, _) = UnseenBeams::decode(set, sections)?;
            pages += set.pages();
            ensure!(pages <= 2 * MAX_PAGES, "{pages} pages are more than {}", 2 * MAX_PAGES);
            let known = claims.by_maker.insert(maker.context("no machine's number")?, set);
            ensure!(known.is_none(), "a machine is there twice");
        }
        ensure!(rest.is_empty(), "{} bytes are left over", rest.len());
        Ok(claims)
    }
}

fn take<const N: usize>(bytes: &mut &[u8]) -> Result<[u8; N]> {
    let (first, rest) = bytes.split_first_chunk::<N>().context("the bytes end early")?;
    *bytes = rest;
    Ok(*first)
}

#[cfg(test)]
mod tests {
    use holo_section::{BeamId, SectionSpec, ViewClass};

    use super::*;

    fn section() -> Section {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let class = ViewClass::Interior;
        let grid = [8; 3];
        Section::new(SectionSpec { origin: [0.0; 3], axes, grid, class, obstructions: true })
            .unwrap()
    }

    fn key(beam: u64) -> BeamKey {
        BeamKey { section: 0, beam: BeamId(beam) }
    }

    #[test]
    fn claims_come_back_from_their_bytes_apart_from_what_is_proven() {
        let (mut claims, mut all) = (UnprovenClaims::default(), UnseenBeams::default());
        for beam in 0..300 {
            all.insert(key(beam * 7));
            if beam % 3 > 0 {
                claims.insert(Maker(beam as u16 % 3), key(beam * 7));
            }
        }
        let bytes = claims.encode();
        assert_eq!(bytes.len() as u64, claims.encoded_bytes());
        let mut again = UnprovenClaims::decode(&bytes, &[section()]).unwrap();
        assert_eq!((again.count(), again.proven(&all).count()), (200, 100));
        assert_eq!(again.maker_of(key(7)), Some(Maker(1)));
        assert_eq!(again.maker_of(key(0)), None);
        let of_first = again.iter().next().unwrap().1.clone();
        again.remove(Maker(1), &of_first);
        assert_eq!((again.count(), again.proven(&all).count()), (100, 200));
        let mut few = UnseenBeams::default();
        few.insert(key(14));
        again.retain(&few);
        assert_eq!((again.count(), again.maker_of(key(14))), (1, Some(Maker(2))));
    }

    #[test]
    fn damaged_bytes_are_refused_and_take_no_memory() {
        let mut claims = UnprovenClaims::of(Maker(3), UnseenBeams::default());
        claims.insert(Maker(3), key(9));
        claims.insert(Maker(4), key(9));
        let good = claims.encode();
        for length in 0..good.len().min(40) {
            assert!(UnprovenClaims::decode(&good[..length], &[section()]).is_err(), "{length}");
        }
        assert!(UnprovenClaims::decode(&[good.clone(), vec![0]].concat(), &[section()]).is_err());
        for (at, byte) in [(0, 9), (7, 0xff), (10, 1), (19, 0xff), (20, 9)] {
            let mut bytes = good.clone();
            bytes[at] = byte;
            assert!(UnprovenClaims::decode(&bytes, &[section()]).is_err(), "byte {at}");
        }
        let twice = UnprovenClaims::of(Maker(3), UnseenBeams::default()).encode();
        let twice = [&FORMAT.to_le_bytes()[..], &2u32.to_le_bytes(), &twice[8..], &twice[8..]];
        assert!(UnprovenClaims::decode(&twice.concat(), &[section()]).is_err());
    }
}
