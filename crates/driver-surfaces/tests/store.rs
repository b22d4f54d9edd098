//! Behaviours of the store and of pictures made from it, in a room that is known.

#![allow(clippy::unwrap_used, missing_docs)]

use glam::DVec3;
use holo_driver_surfaces::{Drawn, Gathered, InPane, Materials, Placer, RaySample, Store, View};
use holo_picture::View as Eye;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};
use std::sync::Arc;

/// A floor of 4 × 4 at height 0, of albedo 0.5, and a sheet of 1 × 1 that lies 1 mm above it.
fn room() -> Arc<Raycaster> {
    room_with_sheet(0.001)
}

/// The same with the sheet at this height.
fn room_with_sheet(height: f64) -> Arc<Raycaster> {
    let square = |half: f64, height: f64| {
        [(-half, -half), (half, -half), (half, half), (-half, half)]
            .map(|(x, y)| DVec3::new(x, y, height))
    };
    let positions: Vec<DVec3> = [square(2.0, 0.0), square(0.5, height)].concat();
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

fn on_sheet(x: f64, y: f64) -> bool {
    x.abs() < 0.5 && y.abs() < 0.5
}

/// Rays straight down to a regular grid of points of the floor, each with this radiance.
fn rays(count: u32, radiance: impl Fn(f64, f64) -> f32) -> Vec<RaySample> {
    let at = |n: u32| (f64::from(n) + 0.5) / f64::from(count) * 3.8 - 1.9;
    let grid = (0..count).flat_map(|y| (0..count).map(move |x| (at(x), at(y))));
    grid.map(|(x, y)| RaySample {
        origin: DVec3::new(x, y, 2.0),
        direction: DVec3::new(0.0, 0.0, -1.0),
        distance: if on_sheet(x, y) { 1.999 } else { 2.0 },
        uncertainty: 0.0,
        radiance: [radiance(x, y); 3],
        paths: 1,
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

/// A floor in front of a wall of 4 × 4 at y = 2. Floor and wall have materials 0 and 1.
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

/// A store of these rays' samples, and what an eye sees then.
fn seen_by(raycaster: &Arc<Raycaster>, rays: &[RaySample], eye: &Eye) -> (View, Drawn) {
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let mut placed = Vec::new();
    Placer::new(raycaster, &materials).place_rays(rays, &mut placed);
    let mut store = Store::new(0.001, 64 << 20);
    store.add(&placed);
    let view = View::new(Arc::clone(raycaster), materials, eye, (64, 64));
    let drawn = Gathered::new(&view, &store).draw(&view, &store, None);
    (view, drawn)
}

/// Rays straight down to the floor of a room with a wall, each with this radiance.
fn floor_rays(count: u32, radiance: impl Fn(f64, f64) -> f32) -> Vec<RaySample> {
    let down = rays(count, radiance).into_iter();
    down.map(|ray| RaySample { distance: 2.0, ..ray }).collect()
}

/// Rays to the wall from the front.
fn wall_rays(count: u32, radiance: f32) -> Vec<RaySample> {
    let forward = rays(count, |_, _| radiance).into_iter().map(|ray| RaySample {
        origin: DVec3::new(ray.origin.x, 0.0, ray.origin.y + 2.0),
        direction: DVec3::Y,
        distance: 2.0,
        ..ray
    });
    forward.collect()
}

/// What a light of 0.2 on the left and 0.8 on the right makes of a place.
fn halves(x: f64, _: f64) -> f32 {
    if x < 0.0 { 0.2 } else { 0.8 }
}

#[test]
fn a_mirror_shows_the_light_of_what_it_mirrors() {
    let raycaster = walled_room(Bsdf::Mirror { ks: [0.5; 3] });
    let (view, drawn) = seen_by(&raycaster, &floor_rays(200, halves), &to_wall());
    let mut found = 0;
    for (seen, pixel) in view.seen.iter().zip(drawn.pixels) {
        if seen.is_surface() && seen.way > 0 && seen.point.x.abs() > 0.3 {
            let wanted = 0.5 * halves(f64::from(seen.point.x), 0.0);
            assert!((pixel[1] / wanted - 1.0).abs() < 0.02, "{pixel:?} at {:?}", seen.point);
            found += 1;
        }
    }
    assert!(found > 200, "{found} pixels see the floor in the mirror");
}

#[test]
fn a_pane_shows_what_it_mirrors_besides_what_is_behind() {
    let pane = Bsdf::ThinGlass { ior: 1.5, transmittance: [1.0; 3] };
    let (view, drawn) = seen_by(&walled_room(pane), &floor_rays(100, |_, _| 100.0), &to_wall());
    // Behind the pane is the sky, of radiance 1; the bright floor is mirrored by some 8 %.
    let mirrored: Vec<_> = view.in_panes.iter().filter(|pane| pane.seen.is_surface()).collect();
    assert!(mirrored.len() > 200, "{}", mirrored.len());
    for pane in mirrored {
        let shown = drawn.pixels[pane.pixel][1];
        assert!((5.0..20.0).contains(&shown), "{shown}");
    }
}

/// The same rays, of which every other one at random is black and the others twice as bright.
fn noisy(rays: Vec<RaySample>) -> Vec<RaySample> {
    let noise = |(number, ray): (u64, RaySample)| {
        let factor = if holo_display::split_mix(number) & 1 == 0 { 0.0 } else { 2.0 };
        RaySample { radiance: ray.radiance.map(|c| c * factor), ..ray }
    };
    (0..).zip(rays).map(noise).collect()
}

#[test]
fn no_light_crosses_a_crease() {
    let raycaster = walled_room(Bsdf::Diffuse { kd: [0.5; 3] });
    let mut rays = noisy(floor_rays(150, |_, _| 0.02));
    rays.extend(noisy(wall_rays(150, 0.8)));
    let (view, drawn) = seen_by(&raycaster, &rays, &to_wall());
    // The floor just before the wall, a fortieth as bright.
    let crease: Vec<f32> = (view.seen.iter().zip(drawn.pixels))
        .filter(|(seen, _)| seen.material == 0 && seen.point.y > 1.8 && seen.point.x.abs() < 1.5)
        .map(|(_, pixel)| pixel[1])
        .collect();
    let mean = crease.iter().sum::<f32>() / crease.len() as f32;
    assert!(crease.len() > 30 && (mean / 0.02 - 1.0).abs() < 0.1, "{mean}, {}", crease.len());
}

#[test]
fn no_light_crosses_from_a_table_to_the_floor_below() {
    let raycaster = room_with_sheet(0.5);
    let rays = noisy(rays(150, |x, y| if on_sheet(x, y) { 0.8 } else { 0.02 }));
    let at_height = |ray: RaySample| {
        let distance = if on_sheet(ray.origin.x, ray.origin.y) { 1.5 } else { 2.0 };
        RaySample { distance, ..ray }
    };
    let rays: Vec<_> = rays.into_iter().map(at_height).collect();
    let (view, drawn) = seen_by(&raycaster, &rays, &eye());
    // The sheet hides the floor up to 0.6 from its middle.
    let beside: Vec<f32> = (view.seen.iter().zip(drawn.pixels))
        .filter(|(seen, _)| seen.point.z < 0.1 && seen.point.truncate().abs().max_element() < 0.8)
        .map(|(_, pixel)| pixel[1])
        .collect();
    let mean = beside.iter().sum::<f32>() / beside.len() as f32;
    assert!(beside.len() > 200 && (mean / 0.02 - 1.0).abs() < 0.1, "{mean}, {}", beside.len());
}

#[test]
fn the_two_sides_of_a_sheet_keep_their_own_light() {
    let raycaster = walled_room(Bsdf::Diffuse { kd: [0.5; 3] });
    let mut rays = wall_rays(100, 0.8);
    rays.extend(wall_rays(100, 0.1).into_iter().map(|ray| RaySample {
        origin: ray.origin + DVec3::Y * 4.0,
        direction: -DVec3::Y,
        ..ray
    }));
    let (view, drawn) = seen_by(&raycaster, &rays, &to_wall());
    let mut found = 0;
    for (seen, pixel) in view.seen.iter().zip(drawn.pixels) {
        if seen.is_surface() && seen.material == 1 && seen.point.x.abs() < 1.5 {
            assert!((pixel[1] / 0.8 - 1.0).abs() < 0.01, "{pixel:?} at {:?}", seen.point);
            found += 1;
        }
    }
    assert!(found > 200, "{found}");
}

#[test]
fn where_samples_are_many_a_shadow_is_as_sharp_as_its_pixels() {
    // The border goes through squares of pixels, not between them.
    let shadow = |x: f64, y: f64| halves(x - 0.08, y);
    let (view, drawn) = seen_by(&room(), &rays(600, shadow), &eye());
    let mut found = 0;
    for (seen, pixel) in view.seen.iter().zip(drawn.pixels) {
        let is_near = (seen.point.x - 0.08).abs() < 1.5 * seen.width;
        if !is_near && seen.point.truncate().abs().max_element() < 1.5 {
            let wanted = shadow(f64::from(seen.point.x), 0.0);
            assert!((pixel[1] / wanted - 1.0).abs() < 0.05, "{pixel:?} at {:?}", seen.point);
            found += 1;
        }
    }
    assert!(found > 2000, "{found}");
}

#[test]
fn samples_count_by_their_paths() {
    let mut mixed = rays(100, |_, _| 0.5);
    let few = |ray: &RaySample| RaySample { radiance: [0.1; 3], paths: 3, ..*ray };
    mixed.extend(mixed.clone().iter().map(few));
    let pixels = drawn(&room(), &[&mixed]);
    let middle = pixels[32 * 64 + 10][1];
    assert!((middle - 0.2).abs() < 1e-3, "{middle}");
}

#[test]
fn pixels_on_edges_show_the_mean_of_what_they_see() {
    let raycaster = walled_room(Bsdf::Mirror { ks: [0.8; 3] });
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(&raycaster, &materials);
    let mut placed = Vec::new();
    placer.place_rays(&floor_rays(100, |_, _| 0.25), &mut placed);
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
        let pieces = &view.pieces[edge.pieces.clone()];
        let sky: f32 = pieces.iter().filter(|p| !p.seen.is_surface()).map(|p| p.share).sum();
        let shown = smooth[edge.pixel][1];
        assert!((shown - (0.25 + 0.75 * sky)).abs() < 2e-3, "{shown} for {sky} of sky");
    }
}

#[test]
fn what_is_not_known_is_as_bright_as_all_that_is() {
    let raycaster = walled_room(Bsdf::Diffuse { kd: [0.8; 3] });
    let (view, drawn) = seen_by(&raycaster, &floor_rays(20, |_, _| 0.25), &to_wall());
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
fn pixels_between_two_materials_of_a_plane_are_edges() {
    let corner = |x: f64, y: f64| DVec3::new(x, y, 0.0);
    let left = [corner(-2.0, -2.0), corner(0.0, -2.0), corner(0.0, 2.0), corner(-2.0, 2.0)];
    let right = left.map(|at| at + DVec3::X * 2.0);
    let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let (mut dark, mut light) = (Material::grey("dark"), Material::grey("light"));
    dark.bsdf = Bsdf::Diffuse { kd: [0.2; 3] };
    light.bsdf = Bsdf::Diffuse { kd: [0.8; 3] };
    let positions = [left, right].concat();
    let ids = [0, 0, 1, 1];
    let made = Scene::from_world(&positions, &triangles, &ids, vec![dark, light], [1.0; 3]);
    let raycaster = Arc::new(Raycaster::build(Arc::new(made.unwrap().0)).unwrap());
    let materials = Arc::new(Materials::new(raycaster.scene()));
    // The border goes through the middles of a column of pixels.
    let (at, down) = (DVec3::new(0.027, 0.0, 3.0), DVec3::new(0.0, 0.0, -1.0));
    let eye = Eye::new(at, down, DVec3::Y, Some(60.0), None, (64, 64)).unwrap();
    let mut view = View::new(Arc::clone(&raycaster), materials, &eye, (64, 64));
    view.look_into_edges();
    assert!(view.edges.len() > 60 && view.edges.iter().all(|edge| edge.pixel % 64 == 31));
}

#[test]
fn a_strip_thinner_than_a_pixel_shows_its_own_light() {
    let quad = |x: f64, to: f64, z: f64| {
        [(x, -2.0), (to, -2.0), (to, 2.0), (x, 2.0)].map(|(x, y)| DVec3::new(x, y, z))
    };
    let positions = [quad(-2.0, 2.0, 0.0), quad(0.005, 0.015, 0.5)].concat();
    let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let (mut floor, mut strip) = (Material::grey("floor"), Material::grey("strip"));
    floor.bsdf = Bsdf::Diffuse { kd: [0.5; 3] };
    strip.bsdf = Bsdf::Diffuse { kd: [0.8; 3] };
    let ids = [0, 0, 1, 1];
    let made = Scene::from_world(&positions, &triangles, &ids, vec![floor, strip], [1.0; 3]);
    let raycaster = Arc::new(Raycaster::build(Arc::new(made.unwrap().0)).unwrap());
    let light = |y: f64| if y < 0.0 { 0.3 } else { 0.9 };
    let on_strip = (0..4000).map(|n| RaySample {
        origin: DVec3::new(0.01, (f64::from(n) + 0.5) / 4000.0 * 3.8 - 1.9, 2.0),
        radiance: [light((f64::from(n) + 0.5) / 4000.0 * 3.8 - 1.9); 3],
        distance: 1.5,
        ..floor_rays(1, |_, _| 0.0)[0]
    });
    let rays: Vec<RaySample> = floor_rays(200, |_, _| 0.1).into_iter().chain(on_strip).collect();
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let mut placed = Vec::new();
    Placer::new(&raycaster, &materials).place_rays(&rays, &mut placed);
    let mut store = Store::new(0.001, 64 << 20);
    store.add(&placed);
    // Turned a little: middles of some pixels see the strip, so that the others are looked into.
    let (at, down, up) = (DVec3::Z * 3.0, DVec3::NEG_Z, DVec3::new(0.05, 1.0, 0.0));
    let eye = Eye::new(at, down, up, Some(60.0), None, (64, 64)).unwrap();
    let mut view = View::new(raycaster, materials, &eye, (64, 64));
    view.look_into_edges();
    let pixels = Gathered::new(&view, &store).draw(&view, &store, None).pixels;
    let mut strips = 0;
    for row in (4..60).filter(|row| !(30..34).contains(row)) {
        for edge in view.edges.iter().filter(|edge| edge.pixel / 64 == row) {
            let pieces = view.pieces[edge.pieces.clone()].iter();
            let share: f32 = pieces.filter(|p| p.seen.material == 1).map(|p| p.share).sum();
            let expected = 0.1 + share * (light(31.5 - row as f64) - 0.1);
            let shown = pixels[edge.pixel][1];
            assert!((shown / expected - 1.0).abs() < 0.05, "row {row}: {shown}, not {expected}");
            strips += 1;
        }
    }
    assert!(strips > 15, "{strips}");
}

#[test]
fn a_pane_mirrors_into_the_share_of_a_pixel_that_it_takes() {
    let raycaster = walled_room(Bsdf::ThinGlass { ior: 1.5, transmittance: [1.0; 3] });
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let mut placed = Vec::new();
    Placer::new(&raycaster, &materials).place_rays(&floor_rays(100, |_, _| 100.0), &mut placed);
    let mut store = Store::new(0.001, 64 << 20);
    store.add(&placed);
    // The pane ends at x = 2 before a sky of radiance 1, and below before the floor.
    let (at, ahead) = (DVec3::new(2.3, -1.0, 2.2), DVec3::new(-0.11, 1.0, -0.5));
    let eye = Eye::new(at, ahead, DVec3::Z, Some(20.0), None, (64, 64)).unwrap();
    let mut view = View::new(raycaster, materials, &eye, (64, 64));
    let rough = Gathered::new(&view, &store).draw(&view, &store, None).pixels;
    view.look_into_edges();
    let fine = Gathered::new(&view, &store).draw(&view, &store, None).pixels;
    let mut found = 0;
    let beside_sky = |pane: &&InPane| {
        pane.share < 1.0 && rough[pane.pixel + 2][1] == 1.0 && pane.pixel < 64 * 56
    };
    for pane in view.in_panes.iter().filter(|pane| pane.seen.is_surface()).filter(beside_sky) {
        // Pixels well inside the pane beside it show what all of it would show.
        let inside = rough[pane.pixel - 2][1];
        let expected = 1.0 + pane.share * (inside - 1.0);
        let shown = fine[pane.pixel][1];
        assert!((shown / expected - 1.0).abs() < 0.05, "{shown}, not {expected}");
        found += 1;
    }
    assert!(found > 30, "{found}");
}

/// Draws noisy rays of this radiance. Returns the squares of errors, and which are within two
/// standard errors, each as a mean over pixels away from all edges.
fn errors_of(count: u32, radiance: impl Fn(f64, f64) -> f32 + Copy) -> (f32, f32) {
    let raycaster = walled_room(Bsdf::Diffuse { kd: [0.8; 3] });
    let (view, drawn) = seen_by(&raycaster, &noisy(floor_rays(count, radiance)), &eye());
    let (mut squares, mut within, mut pixels) = (0.0, 0.0, 0.0);
    for pixel in (0..64 * 64).filter(|p| (8..56).contains(&(p % 64)) && (8..56).contains(&(p / 64)))
    {
        let at = view.seen[pixel].point;
        let truth = radiance(f64::from(at.x), f64::from(at.y));
        let error = drawn.pixels[pixel][1] - truth;
        squares += error * error / (truth * truth);
        within += f32::from(u8::from(error.abs() < 2.0 * drawn.errors[pixel]));
        pixels += 1.0;
    }
    (squares / pixels, within / pixels)
}

#[test]
fn many_samples_of_even_light_leave_less_noise_than_those_of_a_pixel() {
    // 75 samples of a pixel of standard deviation 1 alone have a mean square error of 0.013.
    let (even, _) = errors_of(600, |_, _| 0.25);
    assert!(even < 0.0013, "{even}");
}

#[test]
fn standard_errors_contain_noise_and_blur() {
    let even = |_: f64, _: f64| 0.25;
    let waves = |x: f64, y: f64| (0.5 + 0.3 * (0.8 * x).sin() * (0.6 * y).cos()) as f32;
    for count in [100, 200, 300, 600] {
        for light in [even, waves] {
            let (_, within) = errors_of(count, light);
            assert!(within > 0.85, "{count}: {within} are within two standard errors");
        }
    }
}

#[test]
fn places_without_any_light_are_black_and_their_errors_are_numbers() {
    let raycaster = walled_room(Bsdf::Diffuse { kd: [0.5; 3] });
    let lit = |x: f64, _: f64| if x < 0.0 { 0.0 } else { 0.5 };
    for count in [20, 200] {
        let rays = [floor_rays(count, lit), wall_rays(count, 0.0)].concat();
        let materials = Arc::new(Materials::new(raycaster.scene()));
        let mut placed = Vec::new();
        Placer::new(&raycaster, &materials).place_rays(&rays, &mut placed);
        let mut store = Store::new(0.001, 64 << 20);
        store.add(&placed);
        let mut view = View::new(Arc::clone(&raycaster), materials, &to_wall(), (64, 64));
        view.look_into_edges();
        let drawn = Gathered::new(&view, &store).draw(&view, &store, None);
        assert!(drawn.pixels.iter().flatten().all(|c| c.is_finite() && *c >= 0.0));
        assert!(drawn.errors.iter().all(|error| !error.is_nan()));
    }
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
fn a_store_keeps_what_was_seen_last() {
    let raycaster = room();
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(&raycaster, &materials);
    let mut placed = Vec::new();
    placer.place_rays(&rays(80, |_, _| 1.0), &mut placed);
    // Apart by more than a bucket, of 0.1.
    placed.retain(|sample| sample.point().x.abs() > 0.2);
    let (before, now): (Vec<_>, Vec<_>) =
        placed.into_iter().partition(|sample| sample.point().x < 0.0);
    // A sample takes 24 bytes. Both halves do not fit.
    let mut store = Store::new(0.0001, 24 * 4_500);
    store.add(&before);
    store.begin_round();
    store.add(&now);
    assert_eq!(store.kept(), now.len());
}

#[test]
fn of_a_view_with_too_many_samples_some_are_kept_whatever_their_light() {
    let raycaster = room();
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(&raycaster, &materials);
    let mut placed = Vec::new();
    placer.place_rays(&rays(200, |x, _| if x.sin() > 0.0 { 1.0 } else { 0.5 }), &mut placed);
    let mut store = Store::new(0.0001, 24 * 6_400);
    for part in placed.chunks(1000) {
        store.add(part);
        assert!(store.kept() <= 6_400, "{} samples", store.kept());
    }
    assert!(store.kept() > 1_600, "{} samples", store.kept());
    // The same samples in another order leave the same.
    let mut other = Store::new(0.0001, 24 * 6_400);
    placed.reverse();
    placed.chunks(777).for_each(|part| other.add(part));
    assert_eq!(other.kept(), store.kept());
}
