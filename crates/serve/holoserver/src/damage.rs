//! Names the parts of the file that turn out to be damaged while the server reads it.

use std::path::Path;

use holo_beamfile::{BeamFile, Damage};

/// Damaged parts that are named one by one. Further ones are only counted.
const NAMED: usize = 8;

/// Prints damage once.
#[derive(Debug)]
pub struct DamageReport {
    printed: usize,
}

impl DamageReport {
    /// Prints what opening the file found.
    pub fn of_opening(file: &BeamFile) -> DamageReport {
        let mut report = DamageReport { printed: 0 };
        report.print_new(file);
        report
    }

    /// Prints what was found since the last call.
    ///
    /// It does so even for people who want quiet: a picture may lack these samples.
    pub fn print_new(&mut self, file: &BeamFile) {
        let damage = file.damage();
        let new = damage.get(self.printed..).unwrap_or_default();
        lines(file.path(), new).iter().for_each(|line| eprintln!("{line}"));
        self.printed = damage.len();
    }
}

fn lines(path: &Path, damage: &[Damage]) -> Vec<String> {
    let path = path.display();
    if damage.len() <= NAMED {
        return damage.iter().map(|damage| format!("{path}: {damage}")).collect();
    }
    let samples: u64 = damage.iter().map(Damage::samples).sum();
    vec![format!(
        "{path}: {} parts are damaged, at most {samples} samples are left out; \
         `holodeck verify {path}` lists them",
        damage.len()
    )]
}

#[cfg(test)]
mod tests {
    use holo_beamfile::DamageKind;

    use super::*;

    #[test]
    fn few_damaged_parts_are_named_and_many_are_counted() {
        let damage: Vec<Damage> = (0..9)
            .map(|at| Damage { offset: 4090 * at, bytes: 4090, what: DamageKind::Samples })
            .collect();
        let path = Path::new("a.holo");
        assert_eq!(lines(path, &[]), Vec::<String>::new());
        assert_eq!(
            lines(path, &damage[1..2]),
            ["a.holo: offset 4090: 409 damaged samples are left out"]
        );
        assert_eq!(lines(path, &damage[..8]).len(), 8);
        assert_eq!(
            lines(path, &damage),
            ["a.holo: 9 parts are damaged, at most 3681 samples are left out; \
              `holodeck verify a.holo` lists them"]
        );
    }
}
