//! Views through portals: `surfaces` draws what is before them, and another driver what is beyond.

#![allow(clippy::unwrap_used, reason = "helpers beside the tests fail them in the same way")]

use crate::common::{Random, section, view};
use crate::viewer::TestViewer;
use glam::DVec3;
use holo_display::FrameRequest;
use holo_driver_quadtree::quadtree_driver;
use holo_driver_surfaces::{StandIn, StandIns, stand_ins_driver};
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};
use holo_section::{BeamId, BeamKey, RayCoords, Sample, Section, ViewClass};
use std::sync::Arc;

const SIZE: (u32, u32) = (64, 48);

/// A wall across x: its four corners, and its material.
type Wall = ([DVec3; 4], u32);

/// A wall at `x`, from `low` to `high` in y and z.
fn wall(x: f64, low: [f64; 2], high: [f64; 2], material: u32) -> Wall {
    let corners = [low, [high[0], low[1]], high, [low[0], high[1]]];
    (corners.map(|[y, z]| DVec3::new(x, y, z)), material)
}

fn raycaster(walls: &[Wall]) -> Arc<Raycaster> {
    let diffuse = |kd: [f32; 3]| Material { bsdf: Bsdf::Diffuse { kd }, ..Material::grey("wall") };
    let materials = vec![diffuse([0.8; 3]), diffuse([0.3, 0.5, 0.7])];
    let positions: Vec<DVec3> = walls.iter().flat_map(|(corners, _)| *corners).collect();
    let halves = |wall: u32| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|corner| 4 * wall + corner));
    let triangles: Vec<[u32; 3]> = (0..walls.len() as u32).flat_map(halves).collect();
    let ids: Vec<u32> = walls.iter().flat_map(|&(_, material)| [material; 2]).collect();
    let (scene, _) = Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).unwrap();
    Arc::new(Raycaster::build(Arc::new(scene)).unwrap())
}

/// Returns what a ray hits: the distance, and the colour in light of 1.
fn met(raycaster: &Raycaster, origin: DVec3, direction: DVec3) -> Option<(f64, [f32; 3])> {
    let (ray, skipped) = raycaster.localize(origin, direction)?;
    let hit = raycaster.nearest(&ray)?;
    match raycaster.scene().material(hit.triangle).bsdf {
        Bsdf::Diffuse { kd } => Some((f64::from(hit.t) + skipped, kd)),
        _ => None,
    }
}

/// Returns samples of rays from the whole section, with the colours that they hit.
fn samples(section: &Section, raycaster: &Raycaster, count: usize) -> Vec<(BeamId, Sample)> {
    let mut random = Random(7);
    let sample = |_| {
        let beam = BeamId(random.bits() % section.beam_count());
        let coords = RayCoords((random.bits() as u32).to_le_bytes());
        let ray = section.ray(section.cells(beam)?, coords);
        let (distance, colour) = met(raycaster, ray.origin, ray.direction)?;
        let dither = random.bits() as u32;
        Some((beam, Sample::encode(coords, colour, distance, section.diagonal(), dither)))
    };
    (0..count).filter_map(sample).collect()
}

#[test]
fn samples_draw_what_is_seen_through_a_portal_and_change_nothing_else() {
    // A wall with a doorway, and a room behind it. The stand-in lacks the room.
    let front = [wall(2.5, [0.0, 0.0], [1.4, 4.0], 0), wall(2.5, [2.6, 0.0], [4.0, 4.0], 0)];
    let room = front.into_iter().chain([wall(3.9, [0.0, 0.0], [4.0, 4.0], 1)]);
    let (scene, standing) = (raycaster(&room.collect::<Vec<_>>()), raycaster(&front));
    let portal = raycaster(&[wall(2.5, [1.4, 0.0], [2.6, 4.0], 0)]);
    let section = section([0.0; 3], [4.0; 3], [6; 3], ViewClass::Interior, true);
    let seen: View = view([0.5, 2.03, 2.01], [8.0, 2.1, 2.05], 50.0, SIZE);
    let samples = samples(&section, &scene, 60_000);
    let draw = |portals: Option<&Arc<Raycaster>>| {
        let sections: Arc<[Section]> = Arc::from([section.clone()]);
        let stand_in =
            StandIn { geometry: Some(Arc::clone(&standing)), portals: portals.map(Arc::clone) };
        let mut driver = TestViewer::new(stand_ins_driver(
            Arc::clone(&sections),
            Arc::clone(&scene),
            StandIns([(0, stand_in)].into()),
            None,
            Arc::new(move || quadtree_driver(Arc::clone(&sections), [0.0; 3])),
        ));
        driver.look(&FrameRequest { view: seen, size: SIZE, is_moving: false }).unwrap();
        for (beam, sample) in &samples {
            driver.insert(BeamKey { section: 0, beam: *beam }, 1, std::slice::from_ref(sample));
        }
        driver.draw()
    };
    let (through, blind) = (draw(Some(&portal)), draw(None));
    let (mut beyond, mut other) = (0, 0);
    for pixel in 0..SIZE.0 * SIZE.1 {
        let (x, y) = View::pixel_centre(SIZE, pixel % SIZE.0, pixel / SIZE.0);
        let (eye, along) = seen.ray(x, y);
        let truth = met(&scene, eye, along).unwrap().1;
        let pixel = pixel as usize;
        // The ray's place in the doorway's plane. Pixels at the doorway's sides mix both, and are
        // skipped.
        let across = (eye + along * ((2.5 - eye.x) / along.x)).y;
        let off = ((across - 1.4).abs()).min((across - 2.6).abs());
        if off < 0.1 {
            continue;
        }
        let (drawn, without) = (through.picture.pixels[pixel], blind.picture.pixels[pixel]);
        if (1.4..2.6).contains(&across) {
            beyond += 1;
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
    assert!(beyond > 500 && other > 500, "{beyond} {other}");
    // A portal that stands behind a wall hides nothing.
    let hidden = raycaster(&[wall(3.0, [3.0, 0.0], [4.0, 4.0], 0)]);
    assert!(draw(Some(&hidden)).picture.pixels == blind.picture.pixels);
}
