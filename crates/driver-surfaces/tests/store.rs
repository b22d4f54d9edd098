//! Behaviours of the store and of pictures made from it, in a room that is known.

#![allow(clippy::unwrap_used, missing_docs)]

use glam::DVec3;
use holo_driver_surfaces::{Gathered, Materials, Placer, RaySample, Store, View};
use holo_picture::View as Eye;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};
use std::sync::Arc;

/// A floor of 4 × 4 at height 0, of albedo 0.5, and a sheet of 1 × 1 that lies 1 mm above it.
fn room() -> Arc<Raycaster> {
    let square = |half: f64, height: f64| {
        [(-half, -half), (half, -half), (half, half), (-half, half)]
            .map(|(x, y)| DVec3::new(x, y, height))
    };
    let positions: Vec<DVec3> = [square(2.0, 0.0), square(0.5, 0.001)].concat();
    let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let mut floor = Material::grey("floor");
    floor.bsdf = Bsdf::Diffuse { kd: [0.5; 3] };
    let made = Scene::from_world(&positions, &triangles, &[0; 4], vec![floor], [1.0; 3]);
    Arc::new(Raycaster::build(Arc::new(made.unwrap().0)).unwrap())
}

fn eye() -> Eye {
    let (at, down) = (DVec3::new(0.0, 0.0, 3.0), DVec3::new(0.0, 0.0, -1.0));
    Eye::new(at, down, DVec3::Y, Some(60.0), None, (64, 64)).unwrap()
}

/// Rays straight down to a regular grid of points of the floor, each with this radiance.
fn rays(count: u32, radiance: impl Fn(f64, f64) -> f32) -> Vec<RaySample> {
    let at = |n: u32| (f64::from(n) + 0.5) / f64::from(count) * 3.8 - 1.9;
    let grid = (0..count).flat_map(|y| (0..count).map(move |x| (at(x), at(y))));
    grid.map(|(x, y)| {
        let on_sheet = x.abs() < 0.5 && y.abs() < 0.5;
        RaySample {
            origin: DVec3::new(x, y, 2.0),
            direction: DVec3::new(0.0, 0.0, -1.0),
            distance: if on_sheet { 1.999 } else { 2.0 },
            uncertainty: 0.0,
            radiance: [radiance(x, y); 3],
            paths: 1,
        }
    })
    .collect()
}

fn drawn(raycaster: &Arc<Raycaster>, batches: &[&[RaySample]]) -> Vec<[f32; 3]> {
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(raycaster, &materials);
    let mut store = Store::new(0.001, 64 << 20);
    for batch in batches {
        let mut placed = Vec::new();
        placer.place_rays(batch, &mut placed);
        store.add(&placed);
    }
    let view = View::new(Arc::clone(raycaster), Arc::clone(&materials), &eye(), (64, 64));
    Gathered::new(&view, &store).draw(&view, &store, None).pixels
}

#[test]
fn a_picture_does_not_depend_on_the_order_and_batches_of_samples() {
    let raycaster = room();
    let all = rays(100, |x, y| (1.5 + x.sin() + y * 0.3).max(0.0) as f32);
    let mut reversed = all.clone();
    reversed.reverse();
    let (first, second) = reversed.split_at(1234);
    assert_eq!(drawn(&raycaster, &[&all]), drawn(&raycaster, &[first, second]));
}

#[test]
fn samples_that_come_later_count_as_if_they_had_been_there() {
    let raycaster = room();
    let all = rays(100, |x, y| (1.5 + x.sin() + y * 0.3).max(0.0) as f32);
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(&raycaster, &materials);
    let mut placed = Vec::new();
    placer.place_rays(&all, &mut placed);
    let view = View::new(Arc::clone(&raycaster), Arc::clone(&materials), &eye(), (64, 64));
    let mut store = Store::new(0.001, 64 << 20);
    let (first, later) = placed.split_at(3456);
    store.add(first);
    let mut gathered = Gathered::new(&view, &store);
    store.add(later);
    gathered.add(&view, later);
    let at_once = Gathered::new(&view, &store);
    let pixels = |gathered: &Gathered| gathered.draw(&view, &store, None).pixels;
    assert_eq!(pixels(&gathered), pixels(&at_once));
}

/// A floor in front of a wall of 4 × 4 at y = 2.
fn walled_room(wall: Bsdf) -> Arc<Raycaster> {
    let floor = [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)];
    let upright = [(-2.0, 0.0), (2.0, 0.0), (2.0, 4.0), (-2.0, 4.0)];
    let positions: Vec<DVec3> = floor
        .iter()
        .map(|&(x, y)| DVec3::new(x, y, 0.0))
        .chain(upright.iter().map(|&(x, z)| DVec3::new(x, 2.0, z)))
        .collect();
    let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let (mut below, mut behind) = (Material::grey("floor"), Material::grey("wall"));
    below.bsdf = Bsdf::Diffuse { kd: [0.5; 3] };
    behind.bsdf = wall;
    let ids = [0, 0, 1, 1];
    let made = Scene::from_world(&positions, &triangles, &ids, vec![below, behind], [1.0; 3]);
    Arc::new(Raycaster::build(Arc::new(made.unwrap().0)).unwrap())
}

fn to_wall() -> Eye {
    let (at, ahead) = (DVec3::new(0.0, -1.0, 1.0), DVec3::new(0.0, 1.0, -0.1));
    Eye::new(at, ahead, DVec3::Z, Some(40.0), None, (64, 64)).unwrap()
}

#[test]
fn a_mirror_shows_the_light_of_what_it_mirrors() {
    let raycaster = walled_room(Bsdf::Mirror { ks: [0.8; 3] });
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(&raycaster, &materials);
    let mut placed = Vec::new();
    let straight_down = rays(100, |_, _| 0.25).into_iter();
    let floor: Vec<RaySample> =
        straight_down.map(|ray| RaySample { distance: 2.0, ..ray }).collect();
    placer.place_rays(&floor, &mut placed);
    let mut store = Store::new(0.001, 64 << 20);
    store.add(&placed);
    let view = View::new(Arc::clone(&raycaster), materials, &to_wall(), (64, 64));
    let pixels = Gathered::new(&view, &store).draw(&view, &store, None).pixels;
    let mut found = 0;
    for (seen, pixel) in view.seen.iter().zip(pixels) {
        if seen.is_surface() && seen.way > 0 {
            assert!((pixel[1] - 0.2).abs() < 1e-3, "{pixel:?}");
            found += 1;
        }
    }
    assert!(found > 200, "{found} pixels see the floor in the mirror");
}

#[test]
fn pixels_on_edges_show_the_mean_of_what_they_see() {
    let raycaster = walled_room(Bsdf::Mirror { ks: [0.8; 3] });
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(&raycaster, &materials);
    let mut placed = Vec::new();
    let floor = rays(100, |_, _| 0.25).into_iter().map(|ray| RaySample { distance: 2.0, ..ray });
    placer.place_rays(&floor.collect::<Vec<_>>(), &mut placed);
    let mut store = Store::new(0.001, 64 << 20);
    store.add(&placed);
    // The floor's edge at x = 2 goes through pixels; the sky beyond has radiance 1.
    let at = DVec3::new(2.0, -1.0, 3.0);
    let down = DVec3::new(0.0, 0.0, -1.0);
    let eye = Eye::new(at, down, DVec3::new(0.1, 1.0, 0.0), Some(20.0), None, (64, 64)).unwrap();
    let mut view = View::new(Arc::clone(&raycaster), materials, &eye, (64, 64));
    let draw = |view: &View| Gathered::new(view, &store).draw(view, &store, None).pixels;
    let jagged = draw(&view);
    assert!(jagged.iter().all(|p| (p[1] - 0.25).abs() < 1e-3 || (p[1] - 1.0).abs() < 1e-3));
    view.look_into_edges();
    let smooth = draw(&view);
    let between = smooth.iter().filter(|p| p[1] > 0.3 && p[1] < 0.95).count();
    assert!(between > 40, "{between} pixels lie between floor and sky");
    for edge in &view.edges {
        let sky = edge.seen.iter().filter(|seen| !seen.is_surface()).count() as f32 / 8.0;
        let shown = smooth[edge.pixel][1];
        assert!((shown - (0.25 + 0.75 * sky)).abs() < 2e-3, "{shown} for {sky} of sky");
    }
}

#[test]
fn what_is_not_known_is_as_bright_as_all_that_is() {
    let raycaster = walled_room(Bsdf::Diffuse { kd: [0.8; 3] });
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(&raycaster, &materials);
    let mut placed = Vec::new();
    let floor = rays(20, |_, _| 0.25).into_iter().map(|ray| RaySample { distance: 2.0, ..ray });
    placer.place_rays(&floor.collect::<Vec<_>>(), &mut placed);
    let mut store = Store::new(0.001, 64 << 20);
    store.add(&placed);
    let view = View::new(Arc::clone(&raycaster), materials, &to_wall(), (64, 64));
    let drawn = Gathered::new(&view, &store).draw(&view, &store, None);
    let mut on_wall = 0;
    for ((seen, pixel), error) in view.seen.iter().zip(drawn.pixels).zip(drawn.errors) {
        if seen.is_surface() && seen.material == 1 {
            assert!(error.is_infinite() && (pixel[1] - 0.4).abs() < 1e-3, "{pixel:?} {error}");
            on_wall += 1;
        }
    }
    assert!(on_wall > 200, "{on_wall}");
}

#[test]
fn even_light_is_shown_as_it_is() {
    let raycaster = room();
    let pixels = drawn(&raycaster, &[&rays(100, |_, _| 0.25)]);
    for y in 4..60 {
        for x in 4..60 {
            let shown = pixels[y * 64 + x][1];
            assert!((shown - 0.25).abs() < 1e-4, "pixel {x} {y} shows {shown}");
        }
    }
}

#[test]
fn one_bright_sample_brings_less_than_its_light_and_many_bring_all() {
    let raycaster = room();
    let sum = |pixels: &[[f32; 3]]| pixels.iter().map(|p| f64::from(p[1])).sum::<f64>();
    let even = rays(100, |_, _| 0.25);
    let quiet = sum(&drawn(&raycaster, &[&even]));
    let mut one = even.clone();
    one[3030].radiance = [25_000.0; 3];
    let excess = sum(&drawn(&raycaster, &[&one])) - quiet;
    // Uncut, it would bring about twelve times the light of all others.
    assert!(excess > 0.0 && excess < 0.25 * quiet, "{excess} of {quiet}");
    let all = rays(100, |_, _| 25.0);
    let bright = sum(&drawn(&raycaster, &[&all]));
    assert!((bright / quiet - 100.0).abs() < 0.1, "{bright} of {quiet}");
}

#[test]
fn a_store_keeps_at_most_what_fits_and_what_was_seen_last() {
    let raycaster = room();
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(&raycaster, &materials);
    // A sample takes 24 bytes.
    let mut store = Store::new(0.0001, 24 * 6400);
    let mut placed = Vec::new();
    placer.place_rays(&rays(200, |_, _| 1.0), &mut placed);
    for part in placed.chunks(1000) {
        store.begin_round();
        store.add(part);
        assert!(store.kept() <= 6400, "{} samples", store.kept());
    }
    assert!(store.kept() > 1600, "{} samples", store.kept());
}
