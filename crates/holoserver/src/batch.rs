//! Batch order: which beams get rays when nobody looks (Larson & Simmons 1999, §2.2).
//!
//! Wanted rays are proportional to a beam's importance. The file is filled in *sweeps*: each visits all beams of all
//! sections once, in an evenly spread order, and brings every beam up to its share of the sweep's total; the next
//! sweep's total is larger by [`GROWTH`]. So at any moment the ratio of computed to wanted rays differs between any two
//! beams by no more than that factor and one packet, and stopping is good at any time. Nothing is kept per beam.

use holo_section::{BeamOrder, ImportanceTable, Section};

use crate::allotment::BeamKey;

/// How much larger each sweep's total is. Smaller is more even, larger makes fuller packets.
const GROWTH: f64 = 1.5;

/// Rays given to a beam at a time while the file is nearly empty: fewer would spread better, but a packet's set-up and
/// its entry in the file's directory would cost more than its rays.
const MIN_PACKET: f64 = 4.0;

/// The order in which a holodeck is filled.
pub struct BatchOrder {
    sections: Vec<SectionOrder>,
    beams: u64,
    importance: f64,
    order: BeamOrder,
    sweep_total: f64,
    next: u64,
}

struct SectionOrder {
    section: Section,
    first: u64,
    table: ImportanceTable,
}

impl BatchOrder {
    /// The order for a file that holds `stored` samples already.
    pub fn new(sections: &[Section], stored: u64) -> BatchOrder {
        let mut beams = 0;
        let sections: Vec<_> = sections
            .iter()
            .map(|section| {
                let first = beams;
                beams += section.beam_count();
                SectionOrder { section: section.clone(), first, table: ImportanceTable::new(section) }
            })
            .collect();
        let importance = sections.iter().map(|section| section.table.total()).sum();
        // From here the first sweep adds something everywhere, whatever the file holds.
        let sweep_total = (stored as f64 * GROWTH).max(beams as f64);
        BatchOrder { sections, beams, importance, order: BeamOrder::new(beams, 0), sweep_total, next: 0 }
    }

    /// The next beam to look at and how many samples it should have by the end of this sweep.
    pub fn next(&mut self) -> (BeamKey, u64) {
        if self.next == self.beams {
            self.sweep_total *= GROWTH;
            self.next = 0;
            self.order = BeamOrder::new(self.beams, self.sweep_total.to_bits());
        }
        let index = self.order.at(self.next).0;
        self.next += 1;
        let number = self.sections.partition_point(|section| section.first <= index) - 1;
        let SectionOrder { section, first, table } = &self.sections[number];
        let beam = holo_section::BeamId(index - first);
        let key = BeamKey { section: number as u16, beam };
        let Some(pair) = section.cells(beam) else { return (key, 0) };
        let wanted = self.sweep_total * table.of(pair) / self.importance;
        (key, round_to_packets(wanted, holo_section::seed(key.section, beam, u32::MAX)))
    }
}

/// `wanted` in whole packets of [`MIN_PACKET`], rounded up or down by chance so that the mean is kept. The chance
/// depends on the beam alone, so that a beam once rounded up stays ahead and is not asked for the same rays twice.
fn round_to_packets(wanted: f64, hash: u64) -> u64 {
    let chance = (hash >> 11) as f64 / (1u64 << 53) as f64;
    ((wanted / MIN_PACKET + chance).floor() * MIN_PACKET) as u64
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use holo_section::{SectionSpec, ViewClass};

    use super::*;

    fn section(size: [f64; 3], grid: [u32; 3]) -> Section {
        let axes = [[size[0], 0.0, 0.0], [0.0, size[1], 0.0], [0.0, 0.0, size[2]]];
        Section::new(SectionSpec { origin: [0.0; 3], axes, grid, class: ViewClass::Interior, obstructions: true })
            .unwrap()
    }

    /// Fills as the server does, and checks the stored share of each importance decile at every power of two.
    #[test]
    fn the_file_is_filled_in_proportion_to_importance_whenever_it_is_stopped() {
        let sections = [section([4.0, 3.0, 2.0], [4, 3, 2]), section([2.0, 2.0, 2.0], [2, 2, 2])];
        let mut order = BatchOrder::new(&sections, 0);
        let total: f64 = order.importance;
        let mut stored: HashMap<BeamKey, u64> = HashMap::new();
        let (mut samples, mut check) = (0u64, 8 * order.beams);
        while samples < 200 * order.beams {
            let (key, wanted) = order.next();
            let have = stored.entry(key).or_default();
            samples += wanted.saturating_sub(*have);
            *have = (*have).max(wanted);
            if samples < check {
                continue;
            }
            check *= 2;
            let mut deciles: Vec<(f64, f64)> = Vec::new();
            for (number, section) in sections.iter().enumerate() {
                let table = ImportanceTable::new(section);
                for beam in 0..section.beam_count() {
                    let beam = holo_section::BeamId(beam);
                    let key = BeamKey { section: number as u16, beam };
                    let wanted = samples as f64 * table.of(section.cells(beam).unwrap()) / total;
                    deciles.push((wanted, stored.get(&key).copied().unwrap_or(0) as f64));
                }
            }
            deciles.sort_by(|a, b| a.0.total_cmp(&b.0));
            for decile in deciles.chunks(deciles.len() / 10) {
                let (wanted, have) = decile.iter().fold((0.0, 0.0), |sum, x| (sum.0 + x.0, sum.1 + x.1));
                // Within a sweep's growth either way, and the chance of rounding to packets (4 standard deviations).
                let chance = 4.0 * MIN_PACKET * 0.5 * (decile.len() as f64).sqrt();
                assert!(
                    have <= wanted * GROWTH + chance && have >= wanted / GROWTH - chance,
                    "{samples} samples: {have} where {wanted} were wanted"
                );
            }
        }
    }

    #[test]
    fn a_file_filled_before_goes_on_from_where_it_is() {
        let sections = [section([1.0; 3], [3, 3, 3])];
        let mut order = BatchOrder::new(&sections, 1_000_000);
        let wanted: u64 = (0..order.beams).map(|_| order.next().1).sum();
        assert!((1_400_000..1_600_000).contains(&wanted), "{wanted}");
    }

    #[test]
    fn huge_grids_cost_no_memory_and_no_time() {
        let mut order = BatchOrder::new(&[section([1.0; 3], [64, 64, 64])], 0);
        assert_eq!(order.beams, 30 * 64u64.pow(4));
        let wanted: u64 = (0..100_000).map(|_| order.next().1).sum();
        assert!((50_000..200_000).contains(&wanted), "{wanted}");
    }
}
