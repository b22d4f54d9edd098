//! The beams that a fill traces: a shard of all beams, or of those in a list. Several fills without
//! a network make one holodeck, each with its own shard.
//!
//! Invariant: of the shards of one number, each beam is in exactly one.

use std::{collections::HashSet, fmt, fs, path::Path, str::FromStr};

use anyhow::{Context, Result};
use holo_section::{BeamId, BeamKey};

/// Makes the choice of a shard differ from the other uses of a beam's seed.
const SALT: u32 = 0x5aad;

/// One of several shares of all beams.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    index: u32,
    count: u32,
}

impl Default for Shard {
    /// Returns the only one.
    fn default() -> Shard {
        Shard { index: 0, count: 1 }
    }
}

impl Shard {
    /// Returns whether a beam is in this shard. Beams are spread evenly over all places.
    pub fn has(self, key: BeamKey) -> bool {
        let number = holo_section::seed(key.section, key.beam, SALT);
        number % u64::from(self.count) == u64::from(self.index)
    }
}

/// The beams that a fill is for.
#[derive(Clone, Debug, Default)]
pub struct Share {
    /// The shard that has them.
    pub shard: Shard,
    /// A list that has them, too, if there is one.
    pub beams: Option<BeamList>,
}

impl Share {
    /// Estimates the samples of all shards, if this one's file has so many.
    pub fn all_shards(&self, stored: u64) -> u64 {
        stored * u64::from(self.shard.count)
    }

    /// Returns whether a beam is to be filled.
    pub fn has(&self, key: BeamKey) -> bool {
        self.shard.has(key) && self.beams.as_ref().is_none_or(|list| list.0.contains(&key))
    }
}

/// A list of beams. Its text has a line for each: the numbers of its section and of the beam.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BeamList(HashSet<BeamKey>);

impl FromIterator<BeamKey> for BeamList {
    fn from_iter<I: IntoIterator<Item = BeamKey>>(beams: I) -> BeamList {
        BeamList(beams.into_iter().collect())
    }
}

impl BeamList {
    /// Reads a list from a file.
    ///
    /// # Errors
    /// If it cannot be read, or a line is damaged.
    pub fn read(path: &Path) -> Result<BeamList> {
        let text =
            fs::read_to_string(path).with_context(|| format!("reading {}", path.display()))?;
        let beam = |line: &str| {
            let (section, beam) = line.split_once(' ')?;
            Some(BeamKey { section: section.parse().ok()?, beam: BeamId(beam.parse().ok()?) })
        };
        let beams = text.lines().map(|line| {
            beam(line).with_context(|| format!("{}: `{line}` names no beam", path.display()))
        });
        beams.collect()
    }

    /// Returns the number of beams.
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Returns whether there is none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl fmt::Display for BeamList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|key| writeln!(f, "{} {}", key.section, key.beam.0))
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        let parts = text.split_once('/').and_then(|(index, count)| {
            Some(Shard { index: index.parse().ok()?, count: count.parse().ok()? })
        });
        parts
            .filter(|shard| shard.index < shard.count)
            .ok_or_else(|| format!("`{text}` is no shard; of 8, the first is 0/8, the last 7/8"))
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.count)
    }
}

#[cfg(test)]
mod tests {
    use holo_section::BeamId;

    use super::*;

    #[test]
    fn each_beam_is_in_one_shard_and_shards_are_of_one_size() {
        let shards: Vec<Shard> =
            (0..7).map(|index| format!("{index}/7").parse().unwrap()).collect();
        let mut counts = [0; 7];
        for beam in 0..70_000 {
            let key = BeamKey { section: (beam % 3) as u16, beam: BeamId(beam) };
            let owners: Vec<usize> = (0..7).filter(|&index| shards[index].has(key)).collect();
            assert_eq!(owners.len(), 1);
            counts[owners[0]] += 1;
            assert!(Shard::default().has(key));
        }
        // Six standard deviations.
        assert!(counts.iter().all(|count: &i32| count.abs_diff(10_000) < 560), "{counts:?}");
    }

    #[test]
    fn a_listed_beam_is_filled_by_its_shard_and_no_other_beam_is() {
        let key = |beam| BeamKey { section: 2, beam: BeamId(beam) };
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("beams");
        let list: BeamList = (0..500).map(|beam| key(3 * beam)).collect();
        fs::write(&file, list.to_string()).unwrap();
        assert_eq!(BeamList::read(&file).unwrap(), list);
        let shares: Vec<Share> = ["0/2", "1/2"]
            .iter()
            .map(|shard| Share { shard: shard.parse().unwrap(), beams: Some(list.clone()) })
            .collect();
        for beam in 0..1600 {
            let owners = shares.iter().filter(|share| share.has(key(beam))).count();
            assert_eq!(owners, usize::from(beam % 3 == 0 && beam < 1500), "{beam}");
        }
        fs::write(&file, "2 7\n2\n").unwrap();
        let error = BeamList::read(&file).unwrap_err().to_string();
        assert!(error.contains("`2` names no beam"), "{error}");
    }

    #[test]
    fn a_shard_that_does_not_exist_is_refused() {
        assert_eq!("3/8".parse::<Shard>().unwrap().to_string(), "3/8");
        for bad in ["8/8", "0/0", "1", "-1/8", "a/b", ""] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}
