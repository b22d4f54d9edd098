//! Cells as processes exchange them, and whose cells count.
//!
//! A worker receives cells that others made. It cannot know whether they are right, so it compares
//! them with its own estimates in the same places. A maker's light waits until it agrees with them,
//! and is left out for good if it contradicts them. A maker that agreed is compared on; if it
//! contradicts later, all cells are forgotten, because others may have been taught with its light.
//!
//! Invariants:
//! - No received light counts before [`ENOUGH`] cells of its maker agree with own estimates, and
//!   the caller has been told so. Whoever stores samples can note whose light is in them.
//! - The test is of a maker's light as a whole, with room for noise: cells are not chosen one by
//!   one by their light, which would have a bias.
//! - At most [`MAX_WAITING`] cells wait.

use holo_raycast::Raycaster;
use rustc_hash::FxHashMap;

use super::cells::CellMap;
use super::estimates::Estimates;
use super::place::SurfacePlace;
use super::shared_cell::SharedCell;
use crate::luminance::luminance;

/// Cells to compare before a maker's light may count.
const ENOUGH: u32 = 64;

/// Greatest difference of a maker's light from own estimates, as a share of the latter.
const MOST_DIFFERENCE: f64 = 0.5;

/// Standard errors by which light must be within or beyond that difference.
const AGREES: f64 = 2.0;
const CONTRADICTS: f64 = 5.0;

/// Most estimates that a cell counts for in a comparison, so that no single cell decides.
const MOST_WEIGHT: f32 = 64.0;

/// Most waiting cells of all makers.
const MAX_WAITING: usize = 1 << 20;

/// Waiting cells that one review compares.
const REVIEWED: usize = 1 << 13;

/// The result of comparing a maker's light with own estimates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// It may count from now on.
    Agrees,
    /// It is left out for good.
    Contradicts,
}

/// Sums over cells that both a maker and this process have estimated.
#[derive(Clone, Copy, Debug, Default)]
struct Comparison {
    cells: u32,
    own: f64,
    difference: f64,
    squares: f64,
}

impl Comparison {
    fn add(&mut self, cells: &CellMap, raycaster: &Raycaster, shared: &SharedCell) {
        let place = SurfacePlace { raycaster, spot: shared.spot() };
        let Some(own) = cells.known(&place, shared.level) else { return };
        let theirs = shared.estimates();
        let weight = f64::from(own.count.min(theirs.count).min(MOST_WEIGHT));
        let light = |e: &Estimates| f64::from(luminance(e.mean().to_array()));
        let difference = weight * (light(&theirs) - light(&own));
        self.cells += 1;
        self.own += weight * light(&own);
        self.difference += difference;
        self.squares += difference * difference;
    }

    fn verdict(&self) -> Option<Verdict> {
        let (off, error) = (self.difference.abs(), self.squares.sqrt());
        let most = MOST_DIFFERENCE * self.own;
        if self.cells < ENOUGH {
            None
        } else if off + AGREES * error <= most {
            Some(Verdict::Agrees)
        } else if off - CONTRADICTS * error > most {
            Some(Verdict::Contradicts)
        } else {
            None
        }
    }

    /// Lets what was compared before count half.
    fn fade(&mut self) {
        for sum in [&mut self.own, &mut self.difference] {
            *sum *= 0.5;
        }
        self.squares *= 0.25;
        self.cells /= 2;
    }
}

#[derive(Debug)]
enum CellMaker {
    Waiting {
        cells: Vec<SharedCell>,
        compared: usize,
        comparison: Comparison,
    },
    /// It agrees, and waits until it may count.
    Agreed(Vec<SharedCell>),
    Trusted(Comparison),
    Refused,
}

/// What is known of those whose cells were received, by their numbers.
#[derive(Debug, Default)]
pub(super) struct Makers {
    makers: FxHashMap<u16, CellMaker>,
    waiting: usize,
}

impl Makers {
    /// Takes cells of a maker. Returns a verdict if the maker turns out to be wrong.
    pub(super) fn receive(
        &mut self,
        cells: &CellMap,
        raycaster: &Raycaster,
        maker: u16,
        shared: &[SharedCell],
    ) -> Option<Verdict> {
        let new = || CellMaker::Waiting {
            cells: Vec::new(),
            compared: 0,
            comparison: Comparison::default(),
        };
        let known = self.makers.entry(maker).or_insert_with(new);
        let valid = shared.iter().filter(|cell| cell.is_valid());
        match known {
            CellMaker::Refused => None,
            CellMaker::Waiting { cells, .. } | CellMaker::Agreed(cells) => {
                let room = MAX_WAITING - self.waiting;
                let before = cells.len();
                cells.extend(valid.take(room));
                self.waiting += cells.len() - before;
                None
            }
            CellMaker::Trusted(comparison) => {
                valid.clone().for_each(|cell| comparison.add(cells, raycaster, cell));
                if comparison.verdict() == Some(Verdict::Contradicts) {
                    *known = CellMaker::Refused;
                    cells.clear();
                    return Some(Verdict::Contradicts);
                }
                if comparison.cells > 4 * ENOUGH {
                    comparison.fade();
                }
                valid.for_each(|cell| add(cells, raycaster, cell));
                None
            }
        }
    }

    /// Compares some of the waiting cells. Returns the makers about whom that decides.
    pub(super) fn review(&mut self, own: &CellMap, raycaster: &Raycaster) -> Vec<(u16, Verdict)> {
        let mut decided = Vec::new();
        for (&maker, known) in &mut self.makers {
            let CellMaker::Waiting { cells, compared, comparison } = known else { continue };
            if *compared >= cells.len() {
                // From the beginning: there are more own estimates by now.
                (*compared, *comparison) = (0, Comparison::default());
            }
            let end = cells.len().min(*compared + REVIEWED);
            for cell in &cells[*compared..end] {
                comparison.add(own, raycaster, cell);
            }
            *compared = end;
            let Some(verdict) = comparison.verdict() else { continue };
            let cells = std::mem::take(cells);
            decided.push((maker, verdict));
            *known = match verdict {
                Verdict::Agrees => CellMaker::Agreed(cells),
                Verdict::Contradicts => {
                    self.waiting -= cells.len();
                    CellMaker::Refused
                }
            };
        }
        decided
    }

    /// Lets the light of a maker count, if it agrees.
    pub(super) fn trust(&mut self, own: &CellMap, raycaster: &Raycaster, maker: u16) {
        let Some(known) = self.makers.get_mut(&maker) else { return };
        let CellMaker::Agreed(cells) = known else { return };
        cells.iter().for_each(|cell| add(own, raycaster, cell));
        self.waiting -= cells.len();
        *known = CellMaker::Trusted(Comparison::default());
    }

    /// Returns the makers whose light counts.
    pub(super) fn trusted(&self) -> Vec<u16> {
        let trusted =
            self.makers.iter().filter(|(_, known)| matches!(known, CellMaker::Trusted(_)));
        trusted.map(|(&maker, _)| maker).collect()
    }
}

fn add(cells: &CellMap, raycaster: &Raycaster, cell: &SharedCell) {
    let place = SurfacePlace { raycaster, spot: cell.spot() };
    cells.add_received(&place, cell.level, &cell.estimates());
}

#[cfg(test)]
mod tests {
    use super::super::cells::tests::{floor, place};
    use super::super::shared_cell::LEVELS;
    use super::*;
    use crate::sampler::Sampler;
    use glam::Vec3;

    /// Cells that have learned from many noisy estimates of light 1 with seeds from `seed` on.
    fn taught(raycaster: &Raycaster, seed: u64, estimates: u64) -> CellMap {
        let cells = CellMap::new(0.1);
        for number in 0..estimates {
            let mut sampler = Sampler::new(seed, number);
            let place = place(raycaster, sampler.two());
            let found = if sampler.one() < 0.1 { 5.0 } else { 0.0 };
            cells.add(&place, Vec3::splat(found), Vec3::splat(0.5));
        }
        cells
    }

    fn brighter(mut cells: Vec<SharedCell>, factor: f32) -> Vec<SharedCell> {
        cells.iter_mut().for_each(|cell| cell.light = cell.light.map(|light| light * factor));
        cells
    }

    fn mean(cells: &CellMap, raycaster: &Raycaster) -> f32 {
        let known = (0..1000).filter_map(|number| {
            cells.look_up(&place(raycaster, Sampler::new(9, number).two()), f32::INFINITY)
        });
        let known: Vec<f32> = known.map(|light| light.x).collect();
        known.iter().sum::<f32>() / known.len() as f32
    }

    #[test]
    fn honest_light_counts_once_it_agrees_and_no_sooner() {
        let raycaster = floor();
        let theirs = taught(&raycaster, 1, 20_000).take_new(usize::MAX);
        let own = CellMap::new(0.1);
        let mut makers = Makers::default();
        assert_eq!(makers.receive(&own, &raycaster, 5, &theirs), None);
        assert_eq!(makers.review(&own, &raycaster), []);
        assert_eq!(own.count(), 0, "nothing counts before it was compared");
        for number in 0..20_000 {
            let mut sampler = Sampler::new(2, number);
            let place = place(&raycaster, sampler.two());
            own.add(
                &place,
                Vec3::splat(if sampler.one() < 0.1 { 5.0 } else { 0.0 }),
                Vec3::splat(0.5),
            );
        }
        let before: f32 = own.estimates();
        assert_eq!(makers.review(&own, &raycaster), [(5, Verdict::Agrees)]);
        assert_eq!((own.estimates(), makers.trusted()), (before, vec![]), "not before it may");
        makers.trust(&own, &raycaster, 5);
        assert_eq!(makers.trusted(), [5]);
        assert!(own.estimates() > 1.4 * before);
        assert!((mean(&own, &raycaster) - 1.0).abs() < 0.1);
    }

    #[test]
    fn a_liar_changes_nothing_and_one_that_begins_to_lie_is_forgotten_with_all_it_taught() {
        let raycaster = floor();
        let own = taught(&raycaster, 2, 20_000);
        let mut makers = Makers::default();
        let honest = taught(&raycaster, 1, 20_000).take_new(usize::MAX);
        makers.receive(&own, &raycaster, 7, &brighter(honest.clone(), 50.0));
        makers.receive(&own, &raycaster, 8, &honest);
        let mut verdicts = makers.review(&own, &raycaster);
        verdicts.sort_by_key(|(maker, _)| *maker);
        assert_eq!(verdicts, [(7, Verdict::Contradicts), (8, Verdict::Agrees)]);
        [7, 8].iter().for_each(|maker| makers.trust(&own, &raycaster, *maker));
        assert_eq!(makers.trusted(), [8]);
        assert!((mean(&own, &raycaster) - 1.0).abs() < 0.1);
        makers.receive(&own, &raycaster, 7, &brighter(honest.clone(), 50.0));
        assert!((mean(&own, &raycaster) - 1.0).abs() < 0.1);
        let lies = brighter(honest, 50.0);
        assert_eq!(makers.receive(&own, &raycaster, 8, &lies), Some(Verdict::Contradicts));
        assert_eq!(own.count(), 0);
    }

    #[test]
    fn garbage_is_ignored() {
        let raycaster = floor();
        let own = taught(&raycaster, 2, 2000);
        let good = own.take_new(1)[0];
        for change in [
            |cell: &mut SharedCell| cell.level = LEVELS,
            |cell: &mut SharedCell| cell.count = 0,
            |cell: &mut SharedCell| cell.point[1] = f32::NAN,
            |cell: &mut SharedCell| cell.normal = [0.0; 3],
            |cell: &mut SharedCell| cell.light[2] = -1.0,
            |cell: &mut SharedCell| cell.albedo[0] = f32::INFINITY,
        ] {
            let mut bad = good;
            change(&mut bad);
            assert!(good.is_valid() && !bad.is_valid(), "{bad:?}");
        }
    }
}
