//! Who made samples, claims and cells of surface light: machines, which a file knows by numbers.
//!
//! A machine that uses surface light of others has further numbers. Each says whose light is in
//! what is stored under it, so that `forget` finds it.
//!
//! Invariants:
//! - A number means one machine for ever, also after what the machine made was forgotten.
//! - Light that is in what another maker made counts as used by whoever uses that maker's.
//! - There are at most [`MAX_MAKERS`]. Further machines have the number of an unknown maker.
//! - A machine has at most [`MAX_WITH_LIGHT`] further numbers, whatever it says that it uses.
//! - At most [`MAX_MACHINES_OF_TOKEN`] machines join with one token.

use std::collections::BTreeSet;

use anyhow::{Context, Result, ensure};
use holo_beamfile::{BeamFile, Maker};
use serde::{Deserialize, Serialize};

/// Name of the blob that holds the list, as JSON.
const BLOB: &str = "makers";

/// Most machines in a file: a render farm's, with a few replaced every day of a year.
const MAX_MAKERS: usize = 4096;

/// Most numbers of one machine for what it makes with the light of others. A machine that stated
/// ever other sets of makers would otherwise use up all numbers.
const MAX_WITH_LIGHT: usize = 16;

/// Most machines that join with one token: a large render farm's. Without this limit, one who has a
/// token could use up the numbers of a file by a new key for each connection.
const MAX_MACHINES_OF_TOKEN: usize = 512;

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
    /// The machine's own number, if this one says whose surface light is in what it made.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub machine: Option<u16>,
    /// The machines whose surface light is in it, by their own numbers, in order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub light_of: Vec<u16>,
    /// Beams that it found to see nothing.
    #[serde(default)]
    pub claims: u64,
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
        let named = makers.makers.iter().flat_map(|made| made.machine.iter().chain(&made.light_of));
        ensure!({ named }.all(|maker| *maker <= makers.last), "a machine is named that never was");
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
        if let Some(known) = self.known(worker, token.as_deref(), key.as_deref()) {
            return known;
        }
        let name = machine_name(worker).to_owned();
        self.add(MadeBy { name, key, token, ..MadeBy::default() })
    }

    /// Returns the number of a worker's machine, if it has one.
    fn known(&self, worker: &str, token: Option<&str>, key: Option<&str>) -> Option<Maker> {
        let name = machine_name(worker);
        let known = self.machines().find(|machine| match key {
            Some(_) => machine.key.as_deref() == key,
            None => {
                machine.key.is_none() && machine.name == name && machine.token.as_deref() == token
            }
        });
        known.map(|machine| Maker(machine.id))
    }

    /// Returns the machines, each once.
    fn machines(&self) -> impl Iterator<Item = &MadeBy> {
        self.makers.iter().filter(|maker| maker.machine.is_none())
    }

    /// Returns the numbers of all machines that joined with this token the last time.
    pub fn of_token(&self, token: &str) -> Vec<Maker> {
        let joined = self.machines().filter(|machine| machine.token.as_deref() == Some(token));
        joined.map(|machine| Maker(machine.id)).collect()
    }

    /// Returns why a worker that joins with this token may not get a number, if so.
    pub(crate) fn refusal(
        &self,
        worker: &str,
        token: Option<&str>,
        key: Option<&str>,
    ) -> Option<String> {
        let has_number = self.known(worker, token, key).is_some();
        let is_full = !has_number && self.of_token(token?).len() >= MAX_MACHINES_OF_TOKEN;
        is_full.then(|| {
            format!(
                "{MAX_MACHINES_OF_TOKEN} machines have joined with its token, which is the most: \
                 invite it with another token"
            )
        })
    }

    /// Gives a new number to what one makes. [`Maker::UNKNOWN`] if there is none left.
    fn add(&mut self, new: MadeBy) -> Maker {
        let Some(id) = self.last.checked_add(1).filter(|_| self.makers.len() < MAX_MAKERS) else {
            return Maker::UNKNOWN;
        };
        self.last = id;
        self.makers.push(MadeBy { id, ..new });
        Maker(id)
    }

    /// Returns the number for what a machine makes with the light of `used`, in addition to the
    /// light that what it makes under the number `now` has in it.
    ///
    /// It may be a number that names more light than is used, so that there are few numbers.
    ///
    /// # Errors
    /// If `used` is no number that was ever given.
    pub(crate) fn using(&mut self, now: Maker, used: Maker) -> Result<Maker> {
        ensure!(used.0 <= self.last, "it used surface light of a machine that never was");
        let Some(known) = self.get(now).cloned() else { return Ok(now) };
        let machine = known.machine.unwrap_or(known.id);
        let mut light: BTreeSet<u16> = known.light_of.iter().copied().collect();
        match self.get(used) {
            Some(used) => {
                light.insert(used.machine.unwrap_or(used.id));
                light.extend(&used.light_of);
            }
            None => _ = light.insert(used.0),
        }
        // What a machine made goes with it in any case.
        light.remove(&machine);
        if light.iter().eq(&known.light_of) {
            return Ok(now);
        }
        let is_of_machine = |made: &&MadeBy| made.machine == Some(machine);
        let has_all = |made: &&MadeBy| light.iter().all(|maker| made.light_of.contains(maker));
        let with_light = || self.makers.iter().filter(is_of_machine);
        if let Some(enough) = with_light().filter(has_all).min_by_key(|made| made.light_of.len()) {
            return Ok(Maker(enough.id));
        }
        if with_light().count() < MAX_WITH_LIGHT {
            let light_of = light.into_iter().collect();
            let new = MadeBy { machine: Some(machine), light_of, claims: 0, fault: None, ..known };
            return Ok(self.add(new));
        }
        let widest = with_light().max_by_key(|made| made.light_of.len());
        let widest = widest.map_or(now, |made| Maker(made.id));
        self.widen(widest, machine, &light);
        Ok(widest)
    }

    /// Names more light as used by a number of a machine, and by all numbers with that machine's
    /// light: they may go on to use it. Too much may be forgotten then, but not too little.
    fn widen(&mut self, number: Maker, machine: u16, light: &BTreeSet<u16>) {
        let goes_on = |made: &&mut MadeBy| made.id == number.0 || made.light_of.contains(&machine);
        for made in self.makers.iter_mut().filter(goes_on) {
            let own = made.machine.unwrap_or(made.id);
            let all: BTreeSet<u16> = made.light_of.iter().chain(light).copied().collect();
            made.light_of = all.into_iter().filter(|&maker| maker != own).collect();
        }
    }

    /// Returns all numbers that go if these machines are forgotten: their own, and those of others
    /// that used their light.
    pub(crate) fn tainted_by(&self, makers: &[Maker]) -> Vec<Maker> {
        let is_named = |number: u16| makers.contains(&Maker(number));
        let goes = |made: &&MadeBy| {
            is_named(made.id)
                || made.machine.is_some_and(is_named)
                || made.light_of.iter().any(|&maker| is_named(maker))
        };
        let mut all = makers.to_vec();
        all.extend(self.makers.iter().filter(goes).map(|made| Maker(made.id)));
        all.sort_unstable();
        all.dedup();
        all
    }

    /// Returns the numbers that the makers of another file have here.
    pub(crate) fn merge(&mut self, others: &MachineList) -> Vec<(Maker, Maker)> {
        let mut numbers: Vec<(Maker, Maker)> = Vec::new();
        let here = |numbers: &[(Maker, Maker)], there: u16| {
            let known = numbers.iter().find(|(other, _)| other.0 == there);
            known.map_or(Maker::UNKNOWN, |(_, id)| *id)
        };
        let (machines, users): (Vec<&MadeBy>, Vec<&MadeBy>) =
            others.makers.iter().partition(|other| other.machine.is_none());
        for other in machines {
            let id = self.of(&other.name, other.token.clone(), other.key.clone());
            self.change(id, |maker| {
                maker.claims = maker.claims.max(other.claims);
                maker.fault = maker.fault.take().or_else(|| other.fault.clone());
            });
            numbers.push((Maker(other.id), id));
        }
        for other in users {
            let machine = here(&numbers, other.machine.unwrap_or_default());
            let light = other.light_of.iter().map(|&maker| here(&numbers, maker));
            // All of them are numbers of this file.
            let id = light.fold(machine, |now, used| self.using(now, used).unwrap_or(now));
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

/// Returns the part of a worker's name that names its machine.
fn machine_name(worker: &str) -> &str {
    worker.split(PROCESS).next().unwrap_or(worker)
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
    fn what_is_made_with_the_light_of_others_has_numbers_that_say_so() {
        let mut makers = MachineList::default();
        let of =
            |makers: &mut MachineList, name: &str| makers.of(name, None, Some(name.to_owned()));
        let [a, b, c] = ["a", "b", "c"].map(|name| of(&mut makers, name));
        let using = |makers: &mut MachineList, now, used| makers.using(now, used).unwrap();
        assert_eq!(using(&mut makers, a, a), a, "its own light");
        let with_b = using(&mut makers, a, b);
        assert_eq!(makers.get(with_b).unwrap().light_of, [b.0]);
        assert_eq!(using(&mut makers, with_b, b), with_b);
        assert_eq!(using(&mut makers, with_b, a), with_b, "its own, from before");
        assert_eq!(of(&mut makers, "a"), a, "the machine has its own number still");
        // c uses a's light, which has b's in it.
        let of_both = using(&mut makers, c, with_b);
        assert_eq!(makers.get(of_both).unwrap().light_of, [a.0, b.0]);
        assert_eq!(using(&mut makers, c, b), of_both, "a number that says more than is needed");
        assert_eq!(makers.tainted_by(&[b]), [b, with_b, of_both]);
        assert_eq!(makers.tainted_by(&[a]), [a, with_b, of_both]);
        assert_eq!(makers.tainted_by(&[c]), [c, of_both]);

        let mut merged = MachineList::default();
        let numbers = [of(&mut merged, "x"), of(&mut merged, "b")];
        let numbers_of_others: std::collections::HashMap<Maker, Maker> =
            merged.merge(&makers).into_iter().collect();
        assert_eq!(numbers_of_others[&b], numbers[1]);
        let mut gone = [b, with_b, of_both].map(|maker| numbers_of_others[&maker]);
        gone.sort_unstable();
        assert_eq!(merged.tainted_by(&[numbers[1]]), gone);
        let count = merged.iter().count();
        merged.merge(&makers);
        assert_eq!(merged.iter().count(), count, "a repeated merge changes nothing");
    }

    #[test]
    fn a_machine_that_states_ever_other_light_uses_up_no_numbers() {
        let mut makers = MachineList::default();
        let of =
            |makers: &mut MachineList, name: &str| makers.of(name, None, Some(name.to_owned()));
        let liar = of(&mut makers, "liar");
        let others: Vec<Maker> = (0..100).map(|n| of(&mut makers, &n.to_string())).collect();
        let neighbour = makers.using(others[99], liar).unwrap();
        assert!(makers.using(liar, Maker(60_000)).is_err(), "a machine that never was");
        let numbers: Vec<Maker> =
            others.iter().map(|&used| makers.using(liar, used).unwrap()).collect();
        assert_eq!(makers.iter().count(), 102 + MAX_WITH_LIGHT);
        for (&used, number) in others.iter().zip(numbers) {
            assert!(makers.tainted_by(&[used]).contains(&number));
        }
        // What the neighbour goes on to make has this light too.
        assert!(makers.tainted_by(&[others[50]]).contains(&neighbour));
        let bytes = serde_json::to_vec(&makers).unwrap();
        assert_eq!(MachineList::parse(&bytes).unwrap(), makers);
    }

    #[test]
    fn a_token_admits_no_endless_machines() {
        let mut makers = MachineList::default();
        let token = |token: &str| Some(token.to_owned());
        let key = |number: usize| Some(format!("key {number}"));
        let refusal = |makers: &MachineList, token: Option<&str>, number: usize| {
            makers.refusal("rtworker on a", token, key(number).as_deref())
        };
        for number in 0..MAX_MACHINES_OF_TOKEN {
            assert_eq!(refusal(&makers, Some("one"), number), None);
            makers.of("rtworker on a", token("one"), key(number));
        }
        assert_eq!(makers.of_token("one").len(), MAX_MACHINES_OF_TOKEN);
        assert!(refusal(&makers, Some("one"), MAX_MACHINES_OF_TOKEN).is_some(), "a new machine");
        assert_eq!(refusal(&makers, Some("one"), 7), None, "a machine that comes back");
        assert_eq!(refusal(&makers, Some("two"), MAX_MACHINES_OF_TOKEN), None, "another token");
        assert_eq!(refusal(&makers, None, MAX_MACHINES_OF_TOKEN), None, "the server's machine");
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
