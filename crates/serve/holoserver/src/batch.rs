//! Batch order: the beams that get rays while no display wants any (Larson & Simmons 1999, §2.2).
//!
//! The number of rays that a beam should have is proportional to its importance. The file is filled
//! in *sweeps*. A sweep visits all beams of all sections once, in an evenly spread order. It brings
//! every beam up to its share of the sweep's total. The next sweep's total is larger by [`GROWTH`].
//!
//! The totals of sweeps and the orders of beams in them are functions of the sections. So a fill
//! that is interrupted goes on in the sweep in which it was, and ends with the same samples.
//!
//! At any moment, the ratio of traced to wanted rays differs between two beams by no more than that
//! factor and one packet. So it is good to stop at any time. Nothing is kept for single beams.
//!
//! Once the file has enough samples, later sweeps ask for more *paths* in the same samples, level
//! by level ([`crate::better`]). Each level takes four times as long for the same bytes.
//!
//! The caller passes over beams that see nothing. A sweep's total is kept as rays for each unit of
//! importance. So the other beams get the same, whenever such beams become known.

use holo_section::{BeamKey, BeamOrder, ImportanceTable, Section};

use crate::{better, unseen::UnseenBeams};

/// Factor from one sweep's total to the next. A smaller factor fills more evenly; a larger one
/// makes fuller packets.
const GROWTH: f64 = 1.5;

/// Rays that a beam gets at a time while the file is nearly empty. Fewer would spread better, but
/// then a packet and its entry in the file's directory would cost more than its rays.
const MIN_PACKET: f64 = 4.0;

/// Rays that are enough for a beam of mean importance, by default. On a section's default grid that
/// is up to 80 M samples. A view of 400×400 pixels crosses 0.2 % of them: one sample for each
/// pixel. A fifth of them end on what the view sees: a hundred for each pixel.
const ENOUGH_PER_BEAM: f64 = 512.0;

/// Samples that are enough for a file, at least, by default: 500 MB. Pictures need that many rays
/// even of a coarse grid.
const LEAST_ENOUGH: f64 = 50e6;

/// The share of enough samples that counts as enough. Beams that turn out to see nothing make the
/// share of the others larger, so the last of them would take long.
const NEARLY: f64 = 0.99;

/// Most unseen beams whose importance is added up at the start. An even part of more stands for
/// all.
const IMPORTANCES: u64 = 1 << 20;

/// The order of filling a holodeck.
pub struct BatchOrder {
    sections: Vec<SectionOrder>,
    beams: u64,
    order: BeamOrder,
    /// Samples of a beam of importance 1 at the end of this sweep.
    density: f64,
    next: u64,
    /// Samples of such a beam that are enough, by what was known when this sweep began.
    target: f64,
    /// Samples that are enough for the file, if the user has said so.
    enough: Option<u64>,
    /// Paths of a new sample.
    usual_paths: u16,
    /// Number of times that the number of paths was raised; 0 until there are enough samples.
    level: u32,
}

/// What a beam should have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BatchTarget {
    /// So many samples.
    Samples(u64),
    /// At least so many paths in each of its samples.
    Paths(u16),
}

struct SectionOrder {
    section: Section,
    first: u64,
    table: ImportanceTable,
}

impl BatchOrder {
    /// Returns the order for a file that holds `stored` samples, and for which `enough` samples are
    /// enough (`None`: as many as these sections suggest). A new sample has `usual_paths`.
    pub fn new(
        sections: &[Section],
        stored: u64,
        unseen: &UnseenBeams,
        enough: Option<u64>,
        usual_paths: u16,
    ) -> BatchOrder {
        let mut beams = 0;
        let sections: Vec<_> = sections
            .iter()
            .map(|section| {
                let first = beams;
                beams += section.beam_count();
                SectionOrder {
                    section: section.clone(),
                    first,
                    table: ImportanceTable::new(section),
                }
            })
            .collect();
        let order = BeamOrder::new(beams, 0);
        let mut order = BatchOrder {
            sections,
            beams,
            order,
            density: 0.0,
            next: 0,
            target: 0.0,
            enough,
            usual_paths,
            level: 0,
        };
        let seen = beams - unseen.count().min(beams);
        if seen > 0 {
            // There is always one sweep, because samples for views leave a file uneven.
            order.target = order.enough_density(unseen);
            let per_density = order.importance_seen(unseen);
            let first = beams as f64 / order.importance();
            let mut density = first;
            while density < order.target && density * per_density <= stored as f64 * NEARLY {
                density *= GROWTH;
            }
            order.density = density.min(order.target);
            order.order = BeamOrder::new(beams, order.density.to_bits());
        }
        order
    }

    /// Returns the same order from its beginning, for a file that holds `stored` samples by now.
    pub fn again(&self, stored: u64, unseen: &UnseenBeams) -> BatchOrder {
        let sections: Vec<Section> =
            self.sections.iter().map(|section| section.section.clone()).collect();
        BatchOrder::new(&sections, stored, unseen, self.enough, self.usual_paths)
    }

    /// Returns the samples for each unit of importance that are enough.
    fn enough_density(&self, unseen: &UnseenBeams) -> f64 {
        let seen = self.importance_seen(unseen);
        match self.enough {
            Some(samples) => samples as f64 / seen,
            None => {
                (ENOUGH_PER_BEAM * self.beams as f64 / self.importance()).max(LEAST_ENOUGH / seen)
            }
        }
    }

    fn importance(&self) -> f64 {
        self.sections.iter().map(|section| section.table.total()).sum()
    }

    /// Returns the paths that samples are to have; `None` until there are enough samples.
    pub fn better_paths(&self) -> Option<u16> {
        better::paths_of(self.usual_paths, self.level).filter(|_| self.level > 0)
    }

    fn importance_seen(&self, unseen: &UnseenBeams) -> f64 {
        let total = self.importance();
        let every = (unseen.count() / IMPORTANCES + 1) as usize;
        let of = |key: BeamKey| {
            let SectionOrder { section, table, .. } =
                self.sections.get(usize::from(key.section))?;
            Some(table.of(section.cells(key.beam)?))
        };
        let part: f64 = unseen.iter().step_by(every).filter_map(of).sum();
        // Rounding and chance must not leave nothing: the density would have no bounds.
        (total - part * every as f64).max(total / self.beams as f64)
    }

    /// Returns whether the next beam must wait until all results are in.
    ///
    /// This is the case at the end of a sweep if the next one asks for better samples. The number
    /// of beams that see nothing must be known by then, because it determines how many samples are
    /// enough.
    pub fn waits_for_results(&self) -> bool {
        self.next == self.beams && (self.level > 0 || self.density >= self.target * NEARLY)
    }

    /// Returns the next beam and what it should have at the end of this sweep; `None` once every
    /// beam has all it may get.
    pub fn next(&mut self, unseen: &UnseenBeams) -> Option<(BeamKey, BatchTarget)> {
        if self.next == self.beams {
            if self.level == 0 {
                self.target = self.enough_density(unseen);
            }
            if self.level == 0 && self.density < self.target * NEARLY {
                self.density = (self.density * GROWTH).min(self.target);
                self.order = BeamOrder::new(self.beams, self.density.to_bits());
            } else {
                better::paths_of(self.usual_paths, self.level + 1)?;
                self.level += 1;
                self.order = BeamOrder::new(self.beams, u64::from(self.level));
            }
            self.next = 0;
        }
        let index = self.order.at(self.next).0;
        self.next += 1;
        let number = self.sections.partition_point(|section| section.first <= index) - 1;
        let SectionOrder { section, first, table } = &self.sections[number];
        let beam = holo_section::BeamId(index - first);
        let key = BeamKey { section: number as u16, beam };
        if let Some(paths) = self.better_paths() {
            return Some((key, BatchTarget::Paths(paths)));
        }
        let wanted = section.cells(beam).map_or(0.0, |pair| self.density * table.of(pair));
        let samples = round_to_packets(wanted, holo_section::seed(key.section, beam, u32::MAX));
        Some((key, BatchTarget::Samples(samples)))
    }
}

/// Rounds `wanted` to packets of [`MIN_PACKET`], up or down by chance, so that the mean stays.
///
/// The chance depends on the beam alone: a beam that was rounded up stays ahead.
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
        Section::new(SectionSpec {
            origin: [0.0; 3],
            axes,
            grid,
            class: ViewClass::Interior,
            obstructions: true,
        })
        .unwrap()
    }

    /// Returns an order that never has enough.
    fn unlimited(sections: &[Section], stored: u64, unseen: &UnseenBeams) -> BatchOrder {
        BatchOrder::new(sections, stored, unseen, Some(u64::MAX), 1)
    }

    /// Returns the next beam and the samples that it should have.
    fn next(order: &mut BatchOrder, unseen: &UnseenBeams) -> (BeamKey, u64) {
        match order.next(unseen) {
            Some((key, BatchTarget::Samples(wanted))) => (key, wanted),
            other => panic!("{other:?}"),
        }
    }

    /// Fills as the server does. At every power of two it checks the stored share of each decile of
    /// importance. Beams that are unseen by `is_unseen` become known with their first packet.
    fn fill_and_check(is_unseen: impl Fn(BeamKey) -> bool) {
        let sections = [section([4.0, 3.0, 2.0], [4, 3, 2]), section([2.0, 2.0, 2.0], [2, 2, 2])];
        let mut importances: Vec<(BeamKey, f64)> = Vec::new();
        for (number, section) in sections.iter().enumerate() {
            let table = ImportanceTable::new(section);
            importances.extend((0..section.beam_count()).map(|beam| {
                let beam = holo_section::BeamId(beam);
                (BeamKey { section: number as u16, beam }, table.of(section.cells(beam).unwrap()))
            }));
        }
        importances.retain(|(key, _)| !is_unseen(*key));
        let total: f64 = importances.iter().map(|(_, importance)| importance).sum();
        let mut unseen = UnseenBeams::default();
        let mut order = unlimited(&sections, 0, &unseen);
        let mut stored: HashMap<BeamKey, u64> = HashMap::new();
        let (mut samples, mut check) = (0u64, 8 * order.beams);
        while samples < 200 * order.beams {
            let (key, wanted) = next(&mut order, &unseen);
            if unseen.contains(key) {
                continue;
            }
            if is_unseen(key) {
                if wanted > 0 {
                    unseen.insert(key);
                }
                continue;
            }
            let have = stored.entry(key).or_default();
            samples += wanted.saturating_sub(*have);
            *have = (*have).max(wanted);
            if samples < check {
                continue;
            }
            check *= 2;
            let mut deciles: Vec<(f64, f64)> = importances
                .iter()
                .map(|(key, importance)| {
                    (
                        samples as f64 * importance / total,
                        stored.get(key).copied().unwrap_or(0) as f64,
                    )
                })
                .collect();
            deciles.sort_by(|a, b| a.0.total_cmp(&b.0));
            for decile in deciles.chunks(deciles.len() / 10) {
                let (wanted, have) =
                    decile.iter().fold((0.0, 0.0), |sum, x| (sum.0 + x.0, sum.1 + x.1));
                // A sweep's growth either way, and the chance in rounding (4 standard deviations).
                let chance = 4.0 * MIN_PACKET * 0.5 * (decile.len() as f64).sqrt();
                assert!(
                    have <= wanted * GROWTH + chance && have >= wanted / GROWTH - chance,
                    "{samples} samples: {have} where {wanted} were wanted"
                );
            }
        }
    }

    #[test]
    fn the_file_is_filled_in_proportion_to_importance_whenever_it_is_stopped() {
        fill_and_check(|_| false);
    }

    #[test]
    fn beams_that_see_nothing_change_nothing_for_the_others() {
        // All but one in three, found on the way: by number, and the larger section's only.
        fill_and_check(|key| key.beam.0 % 3 != 0);
        fill_and_check(|key| key.section == 0);
    }

    #[test]
    fn a_file_filled_before_goes_on_from_where_it_is_whatever_cannot_be_seen() {
        let sections = [section([1.0; 3], [3, 3, 3])];
        let mut unseen = UnseenBeams::default();
        for beam in (0..sections[0].beam_count()).filter(|beam| beam % 5 != 0) {
            unseen.insert(BeamKey { section: 0, beam: holo_section::BeamId(beam) });
        }
        let mut order = unlimited(&sections, 1_000_000, &unseen);
        let seen = (0..order.beams)
            .map(|_| next(&mut order, &unseen))
            .filter(|(key, _)| !unseen.contains(*key));
        let wanted: u64 = seen.map(|(_, wanted)| wanted).sum();
        assert!((1_000_000..1_600_000).contains(&wanted), "{wanted}");
    }

    #[test]
    fn an_interrupted_fill_ends_with_the_same_samples_as_another() {
        let sections = [section([4.0, 3.0, 2.0], [4, 3, 2]), section([2.0, 2.0, 2.0], [2, 2, 2])];
        let unseen = UnseenBeams::default();
        let fill = |ends: &[u64]| {
            let (mut stored, mut samples) = (HashMap::<BeamKey, u64>::new(), 0);
            for &end in ends {
                let mut order = unlimited(&sections, samples, &unseen);
                while samples < end {
                    let (key, wanted) = next(&mut order, &unseen);
                    let have = stored.entry(key).or_default();
                    // A goal may end a fill within a beam.
                    let more = wanted.saturating_sub(*have).min(end - samples);
                    samples += more;
                    *have += more;
                }
            }
            stored.retain(|_, have| *have > 0);
            stored
        };
        let straight = fill(&[100_000]);
        assert!(fill(&[1000, 1001, 7000, 22_222, 40_000, 99_000, 100_000]) == straight);
        assert!(fill(&(1..=100).map(|part| part * 1000).collect::<Vec<_>>()) == straight);
    }

    #[test]
    fn where_nothing_can_be_seen_nothing_is_wanted() {
        let sections = [section([1.0; 3], [2, 2, 2])];
        let mut unseen = UnseenBeams::default();
        for beam in 0..sections[0].beam_count() {
            unseen.insert(BeamKey { section: 0, beam: holo_section::BeamId(beam) });
        }
        let mut order = unlimited(&sections, 0, &unseen);
        assert!((0..3 * order.beams).all(|_| next(&mut order, &unseen).1 <= MIN_PACKET as u64));
    }

    #[test]
    fn a_file_filled_before_goes_on_from_where_it_is() {
        let sections = [section([1.0; 3], [3, 3, 3])];
        let mut order = unlimited(&sections, 1_000_000, &UnseenBeams::default());
        let wanted: u64 =
            (0..order.beams).map(|_| next(&mut order, &UnseenBeams::default()).1).sum();
        assert!((1_000_000..1_600_000).contains(&wanted), "{wanted}");
    }

    #[test]
    fn huge_grids_cost_no_memory_and_no_time() {
        let mut order = unlimited(&[section([1.0; 3], [64, 64, 64])], 0, &UnseenBeams::default());
        assert_eq!(order.beams, 30 * 64u64.pow(4));
        let wanted: u64 = (0..100_000).map(|_| next(&mut order, &UnseenBeams::default()).1).sum();
        assert!((50_000..200_000).contains(&wanted), "{wanted}");
    }

    #[test]
    fn enough_samples_are_followed_by_more_paths_in_every_beam_level_by_level_to_the_end() {
        let sections = [section([4.0, 3.0, 2.0], [4, 3, 2]), section([2.0, 2.0, 2.0], [2, 2, 2])];
        let mut unseen = UnseenBeams::default();
        for beam in (0..sections[0].beam_count()).filter(|beam| beam % 3 == 0) {
            unseen.insert(BeamKey { section: 0, beam: holo_section::BeamId(beam) });
        }
        const ENOUGH: u64 = 40_000;
        for stored in [0, 1000, ENOUGH - 1, 10 * ENOUGH] {
            let mut order = BatchOrder::new(&sections, stored, &unseen, Some(ENOUGH), 2);
            let mut have: HashMap<BeamKey, u64> = HashMap::new();
            let mut levels: Vec<(u16, HashMap<BeamKey, u32>)> = Vec::new();
            while let Some((key, wanted)) = order.next(&unseen) {
                match wanted {
                    BatchTarget::Samples(wanted) => {
                        assert!(levels.is_empty(), "no more samples once there are enough");
                        if !unseen.contains(key) {
                            let have = have.entry(key).or_default();
                            *have = wanted.max(*have);
                        }
                    }
                    BatchTarget::Paths(paths) => {
                        if levels.last().is_none_or(|last| last.0 != paths) {
                            levels.push((paths, HashMap::new()));
                        }
                        *levels.last_mut().unwrap().1.entry(key).or_default() += 1;
                    }
                }
            }
            // Rounding to packets: 4 standard deviations.
            let chance = 4.0 * MIN_PACKET * 0.5 * (order.beams as f64).sqrt();
            let total: u64 = have.values().sum();
            let enough = ENOUGH as f64;
            assert!(
                (total as f64) > enough * NEARLY - chance && (total as f64) < enough + chance,
                "{stored}: {total}"
            );
            assert_eq!(
                levels.iter().map(|level| level.0).collect::<Vec<_>>(),
                [8, 32, 128, 512, 2048, 8192]
            );
            for (paths, beams) in &levels {
                assert_eq!(beams.len() as u64, order.beams, "every beam at {paths} paths");
                assert!(beams.values().all(|&times| times == 1), "once");
            }
        }
    }

    #[test]
    fn what_is_enough_by_itself_depends_on_the_rays_not_on_the_beams_that_see_nothing() {
        let fine = [section([1.0; 3], [10, 10, 10])];
        let coarse = [section([1.0; 3], [2, 2, 2])];
        let enough = |sections: &[Section], unseen: &UnseenBeams| {
            let order = BatchOrder::new(sections, 0, unseen, None, 1);
            order.enough_density(unseen) * order.importance_seen(unseen)
        };
        let none = UnseenBeams::default();
        assert!((enough(&fine, &none) / (512.0 * 300_000.0) - 1.0).abs() < 1e-9);
        assert!((enough(&coarse, &none) / 50e6 - 1.0).abs() < 1e-9);
        let mut half = UnseenBeams::default();
        for beam in (0..fine[0].beam_count()).step_by(2) {
            half.insert(BeamKey { section: 0, beam: holo_section::BeamId(beam) });
        }
        let share = enough(&fine, &half) / enough(&fine, &none);
        assert!((0.4..0.6).contains(&share), "{share}");
    }

    #[test]
    fn with_enough_of_nothing_no_sample_is_wanted_and_paths_are() {
        let sections = [section([1.0; 3], [3, 3, 3])];
        let unseen = UnseenBeams::default();
        let mut order = BatchOrder::new(&sections, 1_000_000, &unseen, Some(0), 1);
        let first: Vec<_> = (0..order.beams).map(|_| order.next(&unseen).unwrap().1).collect();
        assert!(first.iter().all(|wanted| *wanted == BatchTarget::Samples(0)));
        assert_eq!(order.next(&unseen).unwrap().1, BatchTarget::Paths(4));
        assert_eq!(order.better_paths(), Some(4));
    }
}
