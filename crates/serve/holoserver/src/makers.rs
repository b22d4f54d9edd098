//! Who made samples, claims and records of light: machines, which a file knows by numbers.
//!
//! Invariants:
//! - A number means one machine for ever, also after what the machine made was forgotten.
//! - There are at most [`MAX_MAKERS`]. Further machines have the number of an unknown maker.

use std::collections::BTreeSet;

use anyhow::{Context, Result, ensure};
use holo_beamfile::{BeamFile, Maker};
use serde::{Deserialize, Serialize};

/// Name of the blob that holds the list, as JSON.
const BLOB: &str = "makers";

/// Most machines in a file: a render farm's, with a few replaced every day of a year.
const MAX_MAKERS: usize = 4096;

/// Separates the machine's part of a worker's name from the process.
const PROCESS: &str = " #";

/// Most characters of a fault's description that are kept.
const MAX_FAULT_CHARS: usize = 300;

/// One machine.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MadeBy {
    /// Its number, as in the file's extents.
    pub id: u16,
    /// Its name, as it says.
    pub name: String,
    /// The machine's public key, in base64 for URLs; `None` if the file is older than keys.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
    /// The name of the token with which it joined; `None` on the server's machine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub token: Option<String>,
    /// Beams that it found to see nothing.
    #[serde(default)]
    pub claims: u64,
    /// Records of indirect light that it made.
    #[serde(default)]
    pub light_records: u64,
    /// Why the machine is refused: what it did wrong.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<String>,
}

/// All machines of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MachineList {
    /// The greatest number that was ever given.
    last: u16,
    makers: Vec<MadeBy>,
}

impl MachineList {
    /// Reads the list of a file. If it is damaged, returns an error and an empty list. The numbers
    /// in the file's extents stay taken even then.
    pub(crate) fn load(file: &BeamFile) -> (MachineList, Result<()>) {
        let read = || -> Result<MachineList> {
            let Some(bytes) = file.blob(BLOB)? else { return Ok(MachineList::default()) };
            MachineList::parse(&bytes).context("the list of those who made samples is lost")
        };
        let (mut makers, result) = match read() {
            Ok(makers) => (makers, Ok(())),
            Err(error) => (MachineList::default(), Err(error)),
        };
        // After a crash, the file may hold samples of a machine that was not written down.
        makers.last = makers.last.max(file.last_maker().0);
        (makers, result)
    }

    /// Parses the blob.
    ///
    /// # Errors
    /// If it is not a list of makers of different numbers, from 1 to the last one given.
    fn parse(bytes: &[u8]) -> Result<MachineList> {
        let makers: MachineList = serde_json::from_slice(bytes)?;
        let count = makers.makers.len();
        ensure!(count <= MAX_MAKERS, "{count} makers are more than {MAX_MAKERS}");
        let ids: BTreeSet<u16> = makers.makers.iter().map(|maker| maker.id).collect();
        let is_known = ids.iter().all(|id| (1..=makers.last).contains(id));
        ensure!(ids.len() == count && is_known, "a number is wrong, or there twice");
        Ok(makers)
    }

    /// Returns all of them, by number.
    pub fn iter(&self) -> impl Iterator<Item = &MadeBy> {
        self.makers.iter()
    }

    /// Returns how many makers there are, and how many of them are at fault.
    pub(crate) fn counts(&self) -> (usize, usize) {
        let at_fault = self.makers.iter().filter(|made| made.fault.is_some());
        (self.makers.len(), at_fault.count())
    }

    /// Returns the maker of this number.
    pub fn get(&self, maker: Maker) -> Option<&MadeBy> {
        self.makers.iter().find(|made| made.id == maker.0)
    }

    /// Returns the number of a worker's machine. A machine is known by its key alone: its name is
    /// for people. Without a key, it is known by its name and its token.
    pub(crate) fn of(&mut self, worker: &str, token: Option<String>, key: Option<String>) -> Maker {
        let name = worker.split(PROCESS).next().unwrap_or(worker).to_owned();
        let known = self.makers.iter().find(|maker| match &key {
            Some(_) => maker.key == key,
            None => maker.key.is_none() && maker.name == name && maker.token == token,
        });
        if let Some(known) = known {
            return Maker(known.id);
        }
        let Some(id) = self.last.checked_add(1).filter(|_| self.makers.len() < MAX_MAKERS) else {
            return Maker::UNKNOWN;
        };
        self.last = id;
        let (claims, light_records, fault) = (0, 0, None);
        self.makers.push(MadeBy { id, name, key, token, claims, light_records, fault });
        Maker(id)
    }

    /// Returns the numbers that the makers of another file have here.
    pub(crate) fn merge(&mut self, others: &MachineList) -> Vec<(Maker, Maker)> {
        let mut numbers = Vec::new();
        for other in &others.makers {
            let id = self.of(&other.name, other.token.clone(), other.key.clone());
            self.change(id, |maker| {
                maker.claims = maker.claims.max(other.claims);
                maker.light_records = maker.light_records.max(other.light_records);
                maker.fault = maker.fault.take().or_else(|| other.fault.clone());
            });
            numbers.push((Maker(other.id), id));
        }
        numbers
    }

    /// Changes what is known of a maker.
    pub(crate) fn change(&mut self, maker: Maker, change: impl FnOnce(&mut MadeBy)) {
        if let Some(made) = self.makers.iter_mut().find(|made| made.id == maker.0) {
            change(made);
        }
    }

    /// Records what a machine did wrong. Its first fault stays.
    pub(crate) fn accuse(&mut self, maker: Maker, fault: &str) {
        let fault = || fault.chars().take(MAX_FAULT_CHARS).collect();
        self.change(maker, |made| _ = made.fault.get_or_insert_with(fault));
    }

    /// Writes the list into a file. Waits for the disk.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn store(&self, file: &BeamFile) -> Result<()> {
        Ok(file.put_blob(BLOB, serde_json::to_string_pretty(self)?.as_bytes())?)
    }

    /// Removes makers. Their numbers stay taken.
    pub(crate) fn remove(&mut self, makers: &[Maker]) {
        self.makers.retain(|made| !makers.contains(&Maker(made.id)));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_machine_keeps_its_number_whatever_process_comes_from_it() {
        let mut makers = MachineList::default();
        let first = makers.of("rtworker on a #1", None, None);
        assert_eq!((first, makers.of("rtworker on a #2", None, None)), (Maker(1), Maker(1)));
        let token = Some("GkdS3h6pXzU".to_owned());
        assert_eq!(makers.of("rtworker on a #1", token.clone(), None), Maker(2), "another token");
        assert_eq!(makers.of("rtworker on b", None, None), Maker(3));
        assert_eq!(makers.get(Maker(2)).unwrap().token, token);
        makers.remove(&[Maker(3)]);
        assert_eq!(makers.of("rtworker on b", None, None), Maker(4), "no number is used twice");
        let key = |key: &str| Some(key.to_owned());
        assert_eq!(makers.of("rtworker on a #1", None, key("A")), Maker(5), "no borrowed name");
        assert_eq!(makers.of("rtworker on z", token, key("A")), Maker(5), "nor a new one");
        assert_eq!(makers.of("rtworker on z", None, key("B")), Maker(6));
    }

    #[test]
    fn a_list_comes_back_from_its_bytes_and_a_damaged_one_is_refused_or_sound() {
        let mut makers = MachineList::default();
        makers.of("rtworker on a", None, None);
        makers.of("rtworker on b", Some("GkdS3h6pXzU".into()), Some("key".into()));
        makers.accuse(Maker(2), "its light is wrong");
        makers.remove(&[Maker(1)]);
        let good = serde_json::to_vec(&makers).unwrap();
        assert_eq!(MachineList::parse(&good).unwrap(), makers);
        let text = String::from_utf8(good.clone()).unwrap();
        for (found, wrong) in [("\"id\":2", "\"id\":3"), ("\"id\":2", "\"id\":0"), ("[", "[1,")] {
            assert!(MachineList::parse(text.replace(found, wrong).as_bytes()).is_err(), "{wrong}");
        }
        let twice =
            text.replace("[", &format!("[{},", &text[text.find("[").unwrap() + 1..text.len() - 2]));
        assert!(MachineList::parse(twice.as_bytes()).is_err(), "{twice}");
        let mut state = 1u64;
        for _ in 0..20_000 {
            let mut bytes = good.clone();
            for _ in 0..1 + state % 3 {
                state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
                let at = (state >> 33) as usize % bytes.len();
                bytes[at] = (state >> 20) as u8;
            }
            if let Ok(parsed) = MachineList::parse(&bytes) {
                assert!(parsed.iter().all(|maker| (1..=parsed.last).contains(&maker.id)));
            }
        }
    }

    #[test]
    fn makers_beyond_the_most_are_nobody() {
        let mut makers = MachineList::default();
        for machine in 0..MAX_MAKERS {
            assert_ne!(makers.of(&format!("machine {machine}"), None, None), Maker::UNKNOWN);
        }
        assert_eq!(makers.of("one more", None, None), Maker::UNKNOWN);
        assert_eq!(makers.of("machine 7", None, None), Maker(8));
    }
}
