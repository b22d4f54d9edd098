//! Shiny objects while the eye moves: their reflection cubes show what the tracer's rays meet.

#![allow(clippy::unwrap_used, missing_docs)]

use crate::curved::glowing_box;
use crate::viewer::TestViewer;
use glam::DVec3;
use holo_display::{FramePhase, FrameRequest};
use holo_driver_surfaces::surfaces_driver;
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_scene::Bsdf;
use holo_section::{BeamId, BeamKey, RayCoords, Sample, Section, SectionSpec, ViewClass};
use holo_tracer::{Settings, Tracer};
use std::sync::Arc;

const SIZE: (u32, u32) = (96, 96);
const MIRROR: Bsdf = Bsdf::Mirror { ks: [0.8, 0.6, 0.4] };
const BRASS: Bsdf = Bsdf::Conductor { ks: [0.8, 0.6, 0.4], alpha: 0.3 };
const DIFFUSE: Bsdf = Bsdf::Diffuse { kd: [0.5; 3] };

fn view(x: f64) -> View {
    let at = DVec3::new(x, -3.0, 0.7);
    View::new(at, -at, DVec3::Z, Some(50.0), None, SIZE).unwrap()
}

/// A driver with some samples of the box. The light of its walls is known without them.
fn driver(raycaster: &Arc<Raycaster>) -> TestViewer {
    let section = Section::new(SectionSpec {
        origin: [-3.9; 3],
        axes: [[7.8, 0.0, 0.0], [0.0, 7.8, 0.0], [0.0, 0.0, 7.8]],
        grid: [4; 3],
        class: ViewClass::Interior,
        obstructions: false,
    })
    .unwrap();
    let tracer = Tracer::with_raycaster(Arc::clone(raycaster), Settings::default()).unwrap();
    let mut samples = Vec::new();
    for number in 0..20_000 {
        let random = holo_display::split_mix(number + 1);
        let beam = BeamId(random % section.beam_count());
        let coords = RayCoords(((random >> 32) as u32).to_le_bytes());
        let ray = section.ray(section.cells(beam).unwrap(), coords);
        let traced = tracer.trace(ray.origin, ray.direction, random);
        let diagonal = section.diagonal();
        let sample = Sample::encode(coords, traced.radiance, traced.distance, diagonal, 0);
        samples.push((BeamKey { section: 0, beam }, sample));
    }
    let sections: Arc<[Section]> = Arc::from([section]);
    let mut driver = TestViewer::new(surfaces_driver(sections, Arc::clone(raycaster), None));
    samples.iter().for_each(|(beam, sample)| driver.insert(*beam, 1, &[*sample]));
    driver
}

fn look(driver: &mut TestViewer, x: f64, is_moving: bool) -> Vec<[f32; 3]> {
    driver.look(&FrameRequest { view: view(x), size: SIZE, is_moving }).unwrap();
    driver.draw().picture.pixels
}

/// Draws a view while the eye moves, without cubes and with them.
fn moving(raycaster: &Arc<Raycaster>) -> [Vec<[f32; 3]>; 2] {
    let mut driver = driver(raycaster);
    _ = look(&mut driver, 0.2, false);
    let without = look(&mut driver, 0.4, true);
    while driver.renderer.prepare(FramePhase::Moving) {}
    [without, look(&mut driver, 0.4, true)]
}

/// The mean of paths through the middle of each pixel, and whether it shows the ball.
fn truth(raycaster: &Arc<Raycaster>, paths: u32) -> Vec<([f32; 3], bool)> {
    let settings = Settings { paths, ..Settings::default() };
    let tracer = Tracer::with_raycaster(Arc::clone(raycaster), settings).unwrap();
    let pixel = |pixel: u32| {
        let at = |number: u32, of: u32| (f64::from(number) + 0.5) / f64::from(of);
        let (x, y) = (at(pixel % SIZE.0, SIZE.0), at(pixel / SIZE.0, SIZE.1));
        let (origin, direction) = view(0.4).ray(x, 1.0 - y);
        let traced = tracer.trace(origin, direction, u64::from(pixel));
        let point = origin + traced.distance * direction;
        (traced.radiance, point.length() < 1.1)
    };
    (0..SIZE.0 * SIZE.1).map(pixel).collect()
}

/// The mean relative difference of the ball's red.
fn difference(shown: &[[f32; 3]], truth: &[([f32; 3], bool)]) -> f32 {
    let of_ball = || shown.iter().zip(truth).filter(|(_, (_, is_ball))| *is_ball);
    let differ: f32 = of_ball().map(|(shown, (truth, _))| (shown[0] - truth[0]).abs()).sum();
    let whole: f32 = of_ball().map(|(_, (truth, _))| truth[0]).sum();
    differ / whole
}

#[test]
fn a_mirror_ball_in_motion_shows_what_its_rays_meet() {
    let raycaster = glowing_box(MIRROR);
    let [without, with] = moving(&raycaster);
    let truth = truth(&raycaster, 1);
    let followed = difference(&without, &truth);
    let differs = difference(&with, &truth);
    // Pixels at edges of reflections are means over a texel.
    assert!(differs < 0.04, "{differs} {followed}");
    assert!(with != without, "the cube is used");
}

#[test]
fn rough_metal_in_motion_shows_the_light_around_it_blurred() {
    let raycaster = glowing_box(BRASS);
    let [without, with] = moving(&raycaster);
    let truth = truth(&raycaster, 256);
    let (before, after) = (difference(&without, &truth), difference(&with, &truth));
    // With 512 facets, it is 0.112.
    assert!(after < 0.13 && after < before, "{after} {before}");
}

#[test]
fn a_frame_at_rest_is_the_same_with_cubes() {
    for ball in [MIRROR, BRASS] {
        let raycaster = glowing_box(ball);
        let rest = |moves: bool| {
            let mut driver = driver(&raycaster);
            if moves {
                for step in 0..3 {
                    _ = look(&mut driver, 0.1 * f64::from(step), true);
                    while driver.renderer.prepare(FramePhase::Moving) {}
                }
            }
            _ = look(&mut driver, 0.4, false);
            driver.settle();
            while driver.prepare() {}
            driver.draw().picture.pixels
        };
        assert!(rest(false) == rest(true));
    }
}

#[test]
fn a_scene_without_shiny_objects_is_drawn_as_before() {
    let [without, with] = moving(&glowing_box(DIFFUSE));
    assert!(without == with);
}
