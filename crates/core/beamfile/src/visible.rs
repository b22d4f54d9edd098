//! The rule that decides which of several samples with the same number counts.
//!
//! Extents count in the order of their appends. An extent that supersedes replaces older samples,
//! and any other extent fills only free numbers. Work that was done twice therefore changes
//! nothing, and damage in a better sample uncovers the older one.

use std::collections::BTreeMap;

/// Sample numbers that one append offers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Offer {
    pub kind: u8,
    pub supersedes: bool,
    pub first: u32,
    pub count: u32,
}

/// A run of numbers, and the index of the offer whose samples count for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Visible {
    pub offer: usize,
    pub first: u32,
    pub count: u32,
}

/// Returns the runs of `offers` that count, in the order (kind, number), every number once. The
/// oldest offer comes first.
pub(crate) fn visible(offers: &[Offer]) -> Vec<Visible> {
    let mut order: Vec<usize> = (0..offers.len()).collect();
    order.sort_by_key(|&i| (offers[i].kind, offers[i].first));
    let whole = |i: usize| Visible { offer: i, first: offers[i].first, count: offers[i].count };
    let disjoint = order.windows(2).all(|pair| {
        let (a, b) = (&offers[pair[0]], &offers[pair[1]]);
        a.kind != b.kind || a.first + a.count <= b.first
    });
    if disjoint {
        return order.into_iter().map(whole).collect();
    }
    let mut painted = VisibleRuns::default();
    for (i, offer) in offers.iter().enumerate() {
        let (begin, end) = (offer.first, offer.first + offer.count);
        if offer.supersedes {
            painted.clear(offer.kind, begin, end);
            painted.0.insert((offer.kind, begin), (end, i));
        } else {
            painted.fill(offer.kind, begin, end, i);
        }
    }
    painted
        .0
        .into_iter()
        .map(|((_, first), (end, offer))| Visible { offer, first, count: end - first })
        .collect()
}

/// Disjoint runs: (kind, first) to (end, offer).
#[derive(Default)]
struct VisibleRuns(BTreeMap<(u8, u32), (u32, usize)>);

impl VisibleRuns {
    fn overlapping(&self, kind: u8, begin: u32, end: u32) -> Vec<(u32, u32, usize)> {
        let before = self.0.range((kind, 0)..(kind, begin)).next_back();
        let within = self.0.range((kind, begin)..(kind, end));
        before
            .into_iter()
            .chain(within)
            .map(|(&(_, from), &(to, offer))| (from, to, offer))
            .filter(|&(_, to, _)| to > begin)
            .collect()
    }

    fn clear(&mut self, kind: u8, begin: u32, end: u32) {
        for (from, to, offer) in self.overlapping(kind, begin, end) {
            self.0.remove(&(kind, from));
            if from < begin {
                self.0.insert((kind, from), (begin, offer));
            }
            if to > end {
                self.0.insert((kind, end), (to, offer));
            }
        }
    }

    fn fill(&mut self, kind: u8, begin: u32, end: u32, offer: usize) {
        let mut at = begin;
        for (from, to, _) in self.overlapping(kind, begin, end) {
            if at < from {
                self.0.insert((kind, at), (from, offer));
            }
            at = at.max(to);
        }
        if at < end {
            self.0.insert((kind, at), (end, offer));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_number_comes_from_the_offer_that_the_rule_names(
            raw in prop::collection::vec((0u8..3, any::<bool>(), 0u32..40, 1u32..15), 0..14),
        ) {
            let offer = |(kind, supersedes, first, count)| Offer { kind, supersedes, first, count };
            let offers: Vec<_> = raw.into_iter().map(offer).collect();
            let mut model = BTreeMap::new();
            for (i, o) in offers.iter().enumerate() {
                for n in o.first..o.first + o.count {
                    let owner = model.entry((o.kind, n)).or_insert(i);
                    if o.supersedes { *owner = i; }
                }
            }
            let found: Vec<_> = visible(&offers)
                .into_iter()
                .flat_map(|v| (v.first..v.first + v.count).map(move |n| (n, v.offer)))
                .map(|(n, offer)| ((offers[offer].kind, n), offer))
                .collect();
            prop_assert_eq!(found, model.into_iter().collect::<Vec<_>>());
        }
    }
}
