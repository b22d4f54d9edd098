//! Fills a store from a file, and traces live samples of a view.

use crate::stored::Stored;
use holo_beamfile::BeamSamples;
use holo_driver_surfaces::{LightStore, Placer, RaySample};
use holo_picture::View;
use holo_section::BeamKey;
use holo_tracer::Tracer;
use rayon::prelude::*;
use std::sync::Arc;

/// Beams that are placed together.
const BATCH: usize = 20_000;

/// Adds all samples of a file.
pub fn place_all(store: &mut LightStore, stored: &Stored, placer: &Placer) {
    for batch in stored.beams.chunks(BATCH) {
        let place = |(key, read): &(BeamKey, Arc<BeamSamples>)| {
            let mut placed = Vec::new();
            let section = &stored.sections[usize::from(key.section)];
            placer.place_beam(section, key.beam, 1, &read.samples, &mut placed);
            placed
        };
        let placed: Vec<_> = batch.par_iter().flat_map_iter(place).collect();
        store.add(&placed);
    }
}

/// Returns rays of a view, spread evenly over it (Roberts' R2 sequence), each of one path.
pub fn live(tracer: &Tracer, eye: &View, numbers: std::ops::Range<u64>) -> Vec<RaySample> {
    let trace = |n: u64| {
        let t = n as f64 + 0.5;
        let (x, y) = ((t * 0.754_877_666_246_692_8).fract(), (t * 0.569_840_290_998_053_3).fract());
        let (origin, direction) = eye.ray(x, y);
        let traced = tracer.trace(origin, direction, 0xABCD_0000_0000 + n);
        let (distance, radiance) = (traced.distance, traced.radiance);
        RaySample { origin, direction, distance, uncertainty: 0.0, radiance, paths: 1 }
    };
    numbers.into_par_iter().map(trace).collect()
}
