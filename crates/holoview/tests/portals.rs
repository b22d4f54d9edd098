//! Views through portals: `voronoi` draws what is before them, another driver what is beyond.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]
#![allow(dead_code, reason = "the stage serves other tests, too")]

#[path = "../../display/tests/common/mod.rs"]
mod common;
#[path = "../../driver-voronoi/tests/voronoi/stage.rs"]
mod stage;

use holo_display::{Driver, Look, Resolution};
use holo_driver_quadtree::QuadtreeDriver;
use holo_driver_voronoi::{StandIn, StandIns, VoronoiDriver};
use holo_light::Store;
use holo_raycast::Raycaster;
use holo_section::{BeamKey, Section};
use stage::{Quad, SIZE, Stage, diffuse, even, raycaster, wall};
use std::sync::Arc;

#[test]
fn what_is_seen_through_a_portal_is_drawn_by_its_samples_and_all_else_is_as_without() {
    // A wall with a doorway, and the room behind it, of which the stand-in has nothing.
    let front = [wall(2.5, [0.0, 0.0], [1.4, 4.0], 0), wall(2.5, [2.6, 0.0], [4.0, 4.0], 0)];
    let all: Vec<Quad> = front.into_iter().chain([wall(3.9, [0.0, 0.0], [4.0, 4.0], 1)]).collect();
    let materials = || vec![diffuse([0.8; 3]), diffuse([0.3, 0.5, 0.7])];
    let (full, standing) = (Stage::new(&all, materials()), Stage::new(&front, materials()));
    let portal = raycaster(&[wall(2.5, [1.4, 0.0], [2.6, 4.0], 0)], materials());
    let samples = full.samples(even, 60_000, common::clean);
    let draw = |raycaster: &Arc<Raycaster>, portals: Option<&Arc<Raycaster>>| {
        let sections: Arc<[Section]> = Arc::from([full.section.clone()]);
        let stand_in =
            StandIn { geometry: Some(Arc::clone(raycaster)), portals: portals.map(Arc::clone) };
        let mut driver = VoronoiDriver::new(
            Arc::clone(&sections),
            Arc::clone(&full.raycaster),
            Arc::new(Store::new(1e-3)),
            StandIns([(0, stand_in)].into()),
            Arc::new(move || Box::new(QuadtreeDriver::new(Arc::clone(&sections), [0.0; 3]))),
        );
        let (view, size) = (full.view, SIZE);
        driver.look(&Look { view, size, resolution: Resolution::Full }).unwrap();
        for (beam, sample) in &samples {
            driver.insert(BeamKey { section: 0, beam: *beam }, 1, std::slice::from_ref(sample));
        }
        driver.draw(&mut |_| {})
    };
    let (through, blind) =
        (draw(&standing.raycaster, Some(&portal)), draw(&standing.raycaster, None));
    let truth = full.truth(even);
    let (mut seen, mut other) = (0, 0);
    for (pixel, truth) in truth.iter().enumerate() {
        let (x, y) = (pixel as u32 % SIZE.0, pixel as u32 / SIZE.0);
        // Where a ray through the doorway's plane passes, in units of its width; next to its sides pixels are mixed.
        let (eye, along) =
            full.view.ray((f64::from(x) + 0.5) / 64.0, 1.0 - (f64::from(y) + 0.5) / 48.0);
        let across = (eye + along * ((2.5 - eye.x) / along.x)).y;
        let off = ((across - 1.4).abs()).min((across - 2.6).abs());
        if off < 0.1 {
            continue;
        }
        let (drawn, without) = (through.picture.pixels[pixel], blind.picture.pixels[pixel]);
        if (1.4..2.6).contains(&across) {
            seen += 1;
            assert_eq!(without, [0.0; 3], "{x} {y}");
            // RGBE's dither is 0.4 % of the largest channel.
            let near =
                (0..3).all(|channel| (drawn[channel] - truth[channel]).abs() < 0.01 * truth[2]);
            assert!(near, "{x} {y}: {drawn:?}, {truth:?}");
        } else {
            other += 1;
            assert_eq!(drawn, without, "{x} {y}");
        }
    }
    assert!(seen > 500 && other > 500, "{seen} {other}");
    // A portal that stands behind a wall hides nothing.
    let hidden = raycaster(&[wall(3.0, [3.0, 0.0], [4.0, 4.0], 0)], materials());
    assert!(draw(&standing.raycaster, Some(&hidden)).picture.pixels == blind.picture.pixels);
}
