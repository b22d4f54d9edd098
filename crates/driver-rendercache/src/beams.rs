//! Requests as what a holoserver can be asked for: single rays of beams, and weights of beams (Larson & Simmons 1999, §2.4.2).
//!
//! Always true: the weights of the beams add up to the same as before, and a beam that was wanted still is.

use super::Frame;
use holo_display::WantedBeam;
use holo_display::candidates;
use holo_section::{BeamKey, RayCoords, Section};
use std::collections::BTreeMap;

impl Frame<'_> {
    /// The requests of this frame as stored rays: the nearest of the best beam of each. Those that no section covers are left out.
    pub fn rays(&self, sections: &[Section]) -> Vec<(BeamKey, RayCoords)> {
        let mut found = Vec::new();
        let ray = |(_, eye, direction)| {
            candidates(sections, eye, direction, &mut found);
            let best = found.first()?;
            let hit = sections.get(usize::from(best.key.section))?.line(eye, direction)?;
            Some((best.key, hit.coords))
        };
        self.requests().filter_map(ray).collect()
    }

    /// Shares the weight of a view's beams out anew: `share` of it (0 to 1) by the requests of this frame, the rest as it was.
    ///
    /// Beams of predicted requests come in besides. The result is ordered by section and beam, each once.
    pub fn weigh(&self, sections: &[Section], beams: &[WantedBeam], share: f32) -> Vec<WantedBeam> {
        let mut asked: BTreeMap<BeamKey, f32> = BTreeMap::new();
        let mut found = Vec::new();
        let mut count = 0;
        for (_, eye, direction) in self.requests() {
            candidates(sections, eye, direction, &mut found);
            if let Some(best) = found.first() {
                *asked.entry(best.key).or_default() += 1.0;
                count += 1;
            }
        }
        if count == 0 {
            return beams.to_vec();
        }
        let total: f64 = beams.iter().map(|beam| f64::from(beam.weight)).sum();
        let each = (total * f64::from(share) / f64::from(count)) as f32;
        asked.values_mut().for_each(|weight| *weight *= each);
        for beam in beams {
            *asked.entry(beam.key).or_default() += (1.0 - share) * beam.weight;
        }
        asked.into_iter().map(|(key, weight)| WantedBeam { key, weight }).collect()
    }
}
