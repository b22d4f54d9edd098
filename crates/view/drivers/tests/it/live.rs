//! Rays traced for one view only: where they land, and that covered pixels ignore them.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]

use crate::common::{Random, section, view};
use crate::viewer::TestViewer;
use glam::DVec3;
use holo_display::{Driver, Frame, FrameRequest, LiveSample, covered};
use holo_driver_quadtree::quadtree_driver;
use holo_driver_surfaces::surfaces_driver;
use holo_picture::{View, ViewSpec};
use holo_raycast::Raycaster;
use holo_scene::{Material, Scene};
use holo_section::{BeamId, BeamKey, RayCoords, Sample, Section, ViewClass};
use std::sync::Arc;

const SIZE: (u32, u32) = (48, 36);

/// Radiance of rays that hit nothing.
const SKY: [f32; 3] = [0.25, 0.5, 1.0];

/// Radiance of the floor.
fn light(at: DVec3) -> [f32; 3] {
    [0.4 + 0.1 * at.x, 0.5 + 0.05 * at.y, 0.3].map(|x| x as f32)
}

/// A floor of 16 × 16 with slowly changing light, and nothing above it.
struct Stage {
    sections: Arc<[Section]>,
    raycaster: Arc<Raycaster>,
    view: View,
}

impl Stage {
    /// Puts a section over a part of the floor. The view looks past it.
    fn new(options: &str) -> Stage {
        let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
        let positions =
            [corner(-8.0, -8.0), corner(8.0, -8.0), corner(8.0, 8.0), corner(-8.0, 8.0)];
        let materials = vec![Material::grey("floor")];
        let triangles = [[0, 1, 2], [0, 2, 3]];
        let (scene, _) =
            Scene::from_world(&positions, &triangles, &[0, 0], materials, [0.25, 0.5, 1.0])
                .unwrap();
        let mut spec = ViewSpec::default();
        spec.apply_line(options).unwrap();
        let one = section([-2.0, -2.0, 0.1], [3.0; 3], [4; 3], ViewClass::Interior, true);
        Stage {
            sections: Arc::from([one]),
            raycaster: Arc::new(Raycaster::build(Arc::new(scene)).unwrap()),
            view: spec.resolve(SIZE).unwrap().0,
        }
    }

    fn look(&self, driver: Driver) -> TestViewer {
        let mut driver = TestViewer::new(driver);
        let look = FrameRequest { view: self.view, size: SIZE, is_moving: false };
        driver.look(&look).unwrap();
        driver
    }

    fn quadtree(&self) -> TestViewer {
        self.look(quadtree_driver(Arc::clone(&self.sections), SKY))
    }

    fn surfaces(&self) -> TestViewer {
        let raycaster = Arc::clone(&self.raycaster);
        self.look(surfaces_driver(Arc::clone(&self.sections), raycaster, None))
    }

    /// Returns what the view's ray through a point of a pixel sees.
    fn ray(&self, pixel: u32, right: f64, down: f64) -> Option<LiveSample> {
        let (column, row) = (f64::from(pixel % SIZE.0) + right, f64::from(pixel / SIZE.0) + down);
        let (origin, direction) =
            self.view.try_ray(column / f64::from(SIZE.0), 1.0 - row / f64::from(SIZE.1))?;
        let distance = -origin.z / direction.z;
        let at = origin + direction * distance;
        let hits = distance > 0.0 && at.abs().max_element() < 8.0;
        let (radiance, distance) =
            if hits { (light(at), distance) } else { ([0.25, 0.5, 1.0], f64::INFINITY) };
        Some(LiveSample { origin, direction, radiance, distance })
    }

    /// Returns `count` rays through each of these pixels.
    fn rays(&self, pixels: &[u32], count: usize) -> Vec<LiveSample> {
        let mut random = Random(5);
        let mut all = Vec::new();
        for _ in 0..count {
            all.extend(
                pixels.iter().filter_map(|&pixel| self.ray(pixel, random.unit(), random.unit())),
            );
        }
        all
    }

    /// Returns samples of the section's beams.
    fn samples(&self, count: usize) -> Vec<(BeamId, Sample)> {
        let (mut random, section) = (Random(3), &self.sections[0]);
        let sample = |_| {
            let beam = BeamId(random.bits() % section.beam_count());
            let coords = RayCoords((random.bits() as u32).to_le_bytes());
            let ray = section.ray(section.cells(beam)?, coords);
            let distance = -ray.origin.z / ray.direction.z;
            let at = ray.origin + ray.direction * distance;
            let hits = distance > 0.0 && at.abs().max_element() < 8.0;
            hits.then(|| {
                (
                    beam,
                    Sample::encode(
                        coords,
                        light(at),
                        distance,
                        section.diagonal(),
                        random.bits() as u32,
                    ),
                )
            })
        };
        (0..count).filter_map(sample).collect()
    }
}

/// Draws the picture at rest.
fn draw(driver: &mut TestViewer) -> Frame {
    driver.settle();
    driver.draw()
}

fn bits(frame: &Frame) -> Vec<[u32; 3]> {
    frame.picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}

/// One view of every type with live rays.
const VIEWS: [&str; 4] = [
    "-vp -5 0.5 3 -vd 1 0 -0.4 -vu 0 0 1 -vh 70",
    "-vtl -vp -5 0.5 3 -vd 1 0 -0.6 -vu 0 0 1 -vh 9",
    "-vtc -vp -5 0.5 3 -vd 1 0 0 -vu 0 0 1 -vh 120 -vv 70",
    "-vta -vp -5 0.5 3 -vd 1 0 -0.4 -vu 0 0 1 -vh 110",
];

#[test]
fn uncovered_pixels_show_what_their_rays_saw_in_every_type_of_view() {
    let mut skies = 0;
    for options in VIEWS {
        let stage = Stage::new(options);
        let (mut surfaces, mut quadtree) = (stage.surfaces(), stage.quadtree());
        let (pixels, seen) = (quadtree.uncovered(), surfaces.uncovered());
        // One of the drivers knows the sky, but every pixel of the floor is traced.
        assert!(
            seen.len() > 100 && pixels.len() >= seen.len(),
            "{options}: {} of {}",
            seen.len(),
            pixels.len()
        );
        let is_floor =
            |pixel: u32| stage.ray(pixel, 0.5, 0.5).is_some_and(|ray| ray.distance.is_finite());
        assert!(pixels.iter().all(|&pixel| seen.contains(&pixel) == is_floor(pixel)), "{options}");
        quadtree.insert_live(1, &stage.rays(&pixels, 32));
        surfaces.insert_live(1, &stage.rays(&seen, 32));
        let (by_surfaces, by_quadtree) = (draw(&mut surfaces), draw(&mut quadtree));
        let (mut compared, mut differing) = (0, 0);
        for &pixel in &seen {
            // Light is a linear function of the place, so its extremes on a piece of the floor are
            // at the corners. Means and filters reach two pixels farther. If the corners see the
            // floor, the mean lies between their extremes.
            let corners = [(-2.0, -2.0), (3.0, -2.0), (-2.0, 3.0), (3.0, 3.0)];
            let rays: Vec<LiveSample> =
                corners.iter().filter_map(|&(x, y)| stage.ray(pixel, x, y)).collect();
            if rays.len() < 4 || !rays.iter().all(|ray| ray.distance.is_finite()) {
                continue;
            }
            compared += 1;
            for (name, frame) in [("surfaces", &by_surfaces), ("quadtree", &by_quadtree)] {
                let shown = frame.picture.pixels[pixel as usize];
                for channel in 0..3 {
                    let of = rays.iter().map(|ray| ray.radiance[channel]);
                    let (most, least) =
                        (of.clone().fold(0.0, f32::max), of.fold(f32::INFINITY, f32::min));
                    // RGBE rounds by up to 1/128 of the largest channel.
                    let rounding = shown.into_iter().fold(0.0, f32::max) / 128.0;
                    let is_between = (least - rounding..=most + rounding).contains(&shown[channel]);
                    // At the floor's border a filter sometimes reaches farther.
                    differing += usize::from(!is_between);
                    assert!(
                        is_between || name == "surfaces",
                        "{options} {name} {pixel}: {shown:?}, {least} to {most}"
                    );
                }
            }
            assert!(by_quadtree.depth[pixel as usize] > 0.0);
        }
        assert!(2 * compared > seen.len(), "{options}: {compared} of {}", seen.len());
        // This allows 1 % of all channels.
        assert!(100 * differing <= 3 * compared, "{options}: {differing} of {compared}");
        // If a pixel sees only the sky, its rays show the sky.
        let sky = pixels.iter().filter(|&&pixel| {
            [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (0.5, 0.5)]
                .iter()
                .all(|&(x, y)| stage.ray(pixel, x, y).is_some_and(|ray| !ray.distance.is_finite()))
        });
        let shown = sky.map(|&pixel| {
            (by_quadtree.picture.pixels[pixel as usize], by_quadtree.depth[pixel as usize])
        });
        for (rgb, depth) in shown {
            skies += 1;
            assert!(
                (rgb[0] - 0.25).abs() < 0.005
                    && (rgb[2] - 1.0).abs() < 0.005
                    && depth == f32::INFINITY,
                "{rgb:?} {depth}"
            );
        }
    }
    assert!(skies > 500, "{skies} pixels see the sky");
}

#[test]
fn live_rays_change_no_covered_pixel_and_their_order_changes_no_bit() {
    let stage = Stage::new(VIEWS[0]);
    let samples = stage.samples(4000);
    let (early, late) = samples.split_at(samples.len() / 2);
    let insert = |driver: &mut TestViewer, samples: &[(BeamId, Sample)]| {
        for (beam, sample) in samples {
            driver.insert(BeamKey { section: 0, beam: *beam }, 1, std::slice::from_ref(sample));
        }
    };
    for make in [Stage::surfaces, Stage::quadtree] {
        let mut driver = make(&stage);
        let covered = covered(&stage.sections, &stage.view, SIZE);
        let uncovered = driver.uncovered();
        let mut rays = stage.rays(&uncovered, 3);
        insert(&mut driver, &samples);
        let without = bits(&draw(&mut driver));
        driver.insert_live(1, &rays);
        let with_live = bits(&draw(&mut driver));
        assert_ne!(with_live, without);
        for (pixel, (with, without)) in with_live.iter().zip(&without).enumerate() {
            assert!(with == without || !covered[pixel], "{} {pixel}", driver.name());
        }
        // The same in another order: live rays one by one, between the samples.
        let mut other = make(&stage);
        rays.reverse();
        insert(&mut other, late);
        rays.iter().for_each(|ray| other.insert_live(1, std::slice::from_ref(ray)));
        insert(&mut other, early);
        assert_eq!(bits(&draw(&mut other)), with_live, "{}", other.name());
    }
}

#[test]
fn a_fully_covered_view_has_no_pixels_to_trace() {
    let mut stage = Stage::new("-vp -0.5 -0.5 1 -vd 1 0 -0.4 -vu 0 0 1 -vh 70");
    assert!(stage.surfaces().uncovered().is_empty());
    stage.view = view([-0.5, -0.5, 1.0], [8.0, 0.0, 0.0], 60.0, SIZE);
    assert!(stage.quadtree().uncovered().is_empty());
}
