//! A share of a fill: so that several fills without a network make one holodeck.
//!
//! Invariant: of the shards of one number, each beam is in exactly one.

use std::str::FromStr;

use holo_section::BeamKey;

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

    /// Returns how many shards there are.
    pub fn count(self) -> u32 {
        self.count
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

impl std::fmt::Display for Shard {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
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
    fn a_shard_that_does_not_exist_is_refused() {
        assert_eq!("3/8".parse::<Shard>().unwrap().to_string(), "3/8");
        for bad in ["8/8", "0/0", "1", "-1/8", "a/b", ""] {
            assert!(bad.parse::<Shard>().is_err(), "{bad}");
        }
    }
}
