//! Pixels on edges, mirrors and panes.

#![allow(clippy::unwrap_used, missing_docs)]

use crate::common::*;
use glam::DVec3;
use holo_driver_surfaces::{
    Gathered, InPane, LightStore, Materials, Placer, RaySample, SurfaceView,
};
use holo_picture::View as Eye;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};
use std::sync::Arc;

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
    // The sky behind the pane has radiance 1. The pane reflects about 8 % of the bright floor.
    let mirrored: Vec<_> = view.in_panes.iter().filter(|pane| pane.seen.is_surface()).collect();
    assert!(mirrored.len() > 200, "{}", mirrored.len());
    for pane in mirrored {
        let shown = drawn.pixels[pane.pixel][1];
        assert!((5.0..20.0).contains(&shown), "{shown}");
    }
}

#[test]
fn a_pane_behind_a_mirror_shows_what_it_mirrors() {
    // A floor between a pane and a mirror that face each other.
    let upright =
        |y: f64| [(-2.0, 0.0), (2.0, 0.0), (2.0, 4.0), (-2.0, 4.0)].map(|(x, z)| (x, y, z));
    let floor = [(-2.0, -2.0, 0.0), (2.0, -2.0, 0.0), (2.0, 2.0, 0.0), (-2.0, 2.0, 0.0)];
    let corners = [floor, upright(2.0), upright(-2.0)].concat();
    let positions: Vec<DVec3> = corners.into_iter().map(DVec3::from).collect();
    let triangles = [0, 4, 8].map(|at| [[at, at + 1, at + 2], [at, at + 2, at + 3]]).concat();
    let glass = Bsdf::ThinGlass { ior: 1.5, transmittance: [1.0; 3] };
    let bsdfs = [Bsdf::Diffuse { kd: [0.5; 3] }, glass, Bsdf::Mirror { ks: [0.5; 3] }];
    let named = ["floor", "pane", "mirror"].into_iter().zip(bsdfs);
    let materials = named.map(|(name, bsdf)| Material { bsdf, ..Material::grey(name) }).collect();
    let made = Scene::from_world(&positions, &triangles, &[0, 0, 1, 1, 2, 2], materials, [1.0; 3]);
    let raycaster = Arc::new(Raycaster::build(Arc::new(made.unwrap().0)).unwrap());
    let (at, ahead) = (DVec3::new(0.0, 0.5, 1.4), DVec3::new(0.0, -1.0, -0.15));
    let eye = Eye::new(at, ahead, DVec3::Z, Some(20.0), None, (64, 64)).unwrap();
    let (store, materials) = kept(&raycaster, &floor_rays(100, |_, _| 100.0));
    let mut view = SurfaceView::new(raycaster, materials, &eye, (64, 64));
    let mirrors_floor = |pane: &&InPane| pane.seen.is_surface() && pane.share == 1.0;
    for _ in 0..2 {
        let drawn = Gathered::new(&view, &store).draw(&view, &store, None);
        let panes: Vec<&InPane> = view.in_panes.iter().filter(mirrors_floor).collect();
        assert!(panes.len() > 200, "{}", panes.len());
        for pane in panes {
            // The pane reflects 1/13 of the floor's light, and lets the sky's radiance of 1 pass.
            // The mirror halves both, and at the top the floor's light once more.
            let shown = drawn.pixels[pane.pixel][1];
            let is_near = |floor: f32| (shown - 0.5 * (12.0 + floor) / 13.0).abs() < 0.05;
            assert!(is_near(100.0) || is_near(50.0), "{shown}");
        }
        // Pixels on edges do not lose the reflection.
        view.look_into_edges();
    }
}

#[test]
fn pixels_on_edges_show_the_mean_of_what_they_see() {
    let raycaster = walled_room(Bsdf::Mirror { ks: [0.8; 3] });
    let (store, materials) = kept(&raycaster, &floor_rays(100, |_, _| 0.25));
    // The floor's edge at x = 2 crosses pixels. The sky beyond has radiance 1.
    let at = DVec3::new(2.0, -1.0, 3.0);
    let down = DVec3::new(0.0, 0.0, -1.0);
    let eye = Eye::new(at, down, DVec3::new(0.1, 1.0, 0.0), Some(20.0), None, (64, 64)).unwrap();
    let mut view = SurfaceView::new(Arc::clone(&raycaster), materials, &eye, (64, 64));
    let draw = |view: &SurfaceView| Gathered::new(view, &store).draw(view, &store, None).pixels;
    let jagged = draw(&view);
    assert!(jagged.iter().all(|p| (p[1] - 0.25).abs() < 1e-3 || (p[1] - 1.0).abs() < 1e-3));
    view.look_into_edges();
    let smooth = draw(&view);
    // Sixteen rays were cast: shares by eight rays are no odd number of sixteenths.
    let is_odd = |share: f32| (share * 16.0).round() as u32 % 2 == 1;
    assert!(view.pieces.iter().any(|piece| is_odd(piece.share)));
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
    // The border crosses the middles of a column of pixels.
    let (at, down) = (DVec3::new(0.027, 0.0, 3.0), DVec3::new(0.0, 0.0, -1.0));
    let eye = Eye::new(at, down, DVec3::Y, Some(60.0), None, (64, 64)).unwrap();
    let mut view = SurfaceView::new(Arc::clone(&raycaster), materials, &eye, (64, 64));
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
    // The store's cubes are two pixels wide. In some, pieces show the strip, but no middle does.
    let mut store = LightStore::new(1e-4, 64 << 20);
    store.add(&placed);
    // The eye is turned a little, so that the middles of some pixels show the strip and the others
    // become edges.
    let (at, down, up) = (DVec3::Z * 3.0, DVec3::NEG_Z, DVec3::new(0.05, 1.0, 0.0));
    let eye = Eye::new(at, down, up, Some(60.0), None, (64, 64)).unwrap();
    let mut view = SurfaceView::new(raycaster, materials, &eye, (64, 64));
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
fn a_hair_that_only_the_middles_of_pixels_meet_does_not_fill_them() {
    let quad = |x: f64, to: f64, z: f64| {
        [(x, -2.0), (to, -2.0), (to, 2.0), (x, 2.0)].map(|(x, y)| DVec3::new(x, y, z))
    };
    // The middle of column 31 at this height.
    let middle = -0.5 * 2.5 * 30f64.to_radians().tan() / 32.0;
    let positions = [quad(-2.0, 2.0, 0.0), quad(middle - 1e-4, middle + 1e-4, 0.5)].concat();
    let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let mut named = ["floor", "hair"].map(Material::grey).to_vec();
    named[1].bsdf = Bsdf::Diffuse { kd: [0.01; 3] };
    let made = Scene::from_world(&positions, &triangles, &[0, 0, 1, 1], named, [1.0; 3]);
    let raycaster = Arc::new(Raycaster::build(Arc::new(made.unwrap().0)).unwrap());
    let (store, materials) = kept(&raycaster, &floor_rays(200, |_, _| 0.1));
    let eye = Eye::new(DVec3::Z * 3.0, DVec3::NEG_Z, DVec3::Y, Some(60.0), None, (64, 64)).unwrap();
    let mut view = SurfaceView::new(raycaster, materials, &eye, (64, 64));
    let hairs = view.seen.iter().filter(|seen| seen.material == 1).count();
    assert!(hairs > 50, "{hairs} middles show the hair");
    view.look_into_edges();
    let pixels = Gathered::new(&view, &store).draw(&view, &store, None).pixels;
    for row in 4..60 {
        let shown = pixels[row * 64 + 31][1];
        assert!((shown / 0.1 - 1.0).abs() < 0.05, "row {row}: {shown}");
    }
}

#[test]
fn the_order_of_edges_and_samples_changes_no_bit() {
    let raycaster = walled_room(Bsdf::Mirror { ks: [0.8; 3] });
    let sheet = room_with_sheet(0.5);
    let up = DVec3::new(0.1, 1.0, 0.0);
    let turned = Eye::new(DVec3::Z * 3.0, DVec3::NEG_Z, up, Some(60.0), None, (64, 64)).unwrap();
    for (raycaster, eye, rays) in [
        (&raycaster, to_wall(), noisy(floor_rays(150, halves))),
        // Rays to the sheet's height, and past its edges to the floor.
        (&sheet, turned, noisy(rays(150, halves)).into_iter().map(past_sheet).collect()),
    ] {
        let materials = Arc::new(Materials::new(raycaster.scene()));
        let placer = Placer::new(raycaster, &materials);
        let mut placed = Vec::new();
        placer.place_rays(&rays, &mut placed);
        let new_view =
            || SurfaceView::new(Arc::clone(raycaster), Arc::clone(&materials), &eye, (64, 64));
        let mut all = LightStore::new(1e-4, 64 << 20);
        all.add(&placed);
        let mut expected = new_view();
        expected.look_into_edges();
        let expected = Gathered::new(&expected, &all).draw(&expected, &all, None);
        for parts in [[0.0, 1.0], [0.3, 0.6], [1.0, 1.0]] {
            let [before, between] = parts.map(|part: f64| (part * placed.len() as f64) as usize);
            let mut view = new_view();
            let mut store = LightStore::new(1e-4, 64 << 20);
            store.add(&placed[..before]);
            let mut gathered = Gathered::new(&view, &store);
            store.add(&placed[before..between]);
            gathered.add(&view, &placed[before..between]);
            view.look_into_edges();
            gathered.look_into_edges(&view, &store);
            store.add(&placed[between..]);
            gathered.add(&view, &placed[between..]);
            let drawn = gathered.draw(&view, &store, None);
            assert!(!view.edges.is_empty());
            assert_eq!(drawn.pixels, expected.pixels, "{parts:?}");
        }
    }
}

#[test]
fn a_pane_mirrors_into_the_share_of_a_pixel_that_it_takes() {
    let raycaster = walled_room(Bsdf::ThinGlass { ior: 1.5, transmittance: [1.0; 3] });
    let (store, materials) = kept(&raycaster, &floor_rays(100, |_, _| 100.0));
    // The pane ends at x = 2 before a sky of radiance 1, and below before the floor. For the second
    // eye, that end lies half a pixel beside the first one's.
    let mut shares = Vec::new();
    for turned in [-0.11, -0.1135] {
        let (at, ahead) = (DVec3::new(2.3, -1.0, 2.2), DVec3::new(turned, 1.0, -0.5));
        let eye = Eye::new(at, ahead, DVec3::Z, Some(20.0), None, (64, 64)).unwrap();
        let mut view =
            SurfaceView::new(Arc::clone(&raycaster), Arc::clone(&materials), &eye, (64, 64));
        let rough = Gathered::new(&view, &store).draw(&view, &store, None).pixels;
        view.look_into_edges();
        let fine = Gathered::new(&view, &store).draw(&view, &store, None).pixels;
        let beside_sky = |pane: &&InPane| {
            pane.share < 1.0 && rough[pane.pixel + 2][1] == 1.0 && pane.pixel < 64 * 56
        };
        for pane in view.in_panes.iter().filter(|pane| pane.seen.is_surface()).filter(beside_sky) {
            // Pixels well inside the pane show the reflection in full.
            let inside = rough[pane.pixel - 2][1];
            let expected = 1.0 + pane.share * (inside - 1.0);
            let shown = fine[pane.pixel][1];
            assert!((shown / expected - 1.0).abs() < 0.05, "{shown}, not {expected}");
            shares.push(pane.share);
        }
    }
    let small = shares.iter().filter(|share| **share < 0.5).count();
    assert!(small > 15 && shares.len() - small > 15, "{small} of {}", shares.len());
}

#[test]
fn a_pane_mirrors_the_light_of_what_it_mirrors() {
    let pane = Bsdf::ThinGlass { ior: 1.5, transmittance: [1.0; 3] };
    let of = |light: f32| {
        let light = |x: f64, y: f64| light * halves(x, y);
        seen_by(&walled_room(pane), &floor_rays(200, light), &to_wall())
    };
    let ((view, lit), (_, unlit)) = (of(100.0), of(0.0));
    let mirrored = |pixel: usize| lit.pixels[pixel][1] - unlit.pixels[pixel][1];
    let mut found = 0;
    for pane in view.in_panes.iter().filter(|pane| pane.seen.is_surface()) {
        // The same angle on the darker side. A mean over a wide place would not distinguish the two
        // sides.
        let (x, row) = (pane.pixel % 64, pane.pixel / 64);
        if (0.15..0.6).contains(&pane.seen.point.x) {
            let ratio = mirrored(pane.pixel) / mirrored(row * 64 + 63 - x);
            assert!((ratio / 4.0 - 1.0).abs() < 0.05, "{ratio} at {:?}", pane.seen.point);
            found += 1;
        }
    }
    assert!(found > 50, "{found}");
}

#[test]
fn a_pane_mirrors_light_without_its_noise() {
    let pane = Bsdf::ThinGlass { ior: 1.5, transmittance: [1.0; 3] };
    let light = 100.0;
    let of = |rays: Vec<RaySample>| seen_by(&walled_room(pane), &rays, &to_wall());
    let (view, even) = of(floor_rays(100, |_, _| light));
    let (_, noisy) = of(noisy(floor_rays(100, |_, _| light)));
    let mirroring = view.in_panes.iter().filter(|pane| pane.seen.is_surface());
    let errors: Vec<f32> = mirroring
        .map(|pane| noisy.pixels[pane.pixel][1] / even.pixels[pane.pixel][1] - 1.0)
        .collect();
    // Single samples are off by 1, and a pixel has two or three of them.
    let square = errors.iter().map(|error| error * error).sum::<f32>() / errors.len() as f32;
    assert!(errors.len() > 200 && square < 0.02, "{square}");
}

#[test]
fn samples_through_a_pane_count_what_it_mirrors_once() {
    let (behind, room) = (0.05, 1.0);
    let raycaster = room_with_window();
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let eye = to_wall();
    let view = SurfaceView::new(Arc::clone(&raycaster), materials, &eye, (64, 64));
    // The pixels through which a pane shows the backdrop, and mirrors the floor.
    let panes = view.in_panes.iter().filter(|pane| pane.seen.is_surface());
    let panes: Vec<usize> =
        panes.map(|pane| pane.pixel).filter(|&pixel| view.seen[pixel].is_surface()).collect();
    let share = |pixel: usize| {
        let way = view.ways[view.seen[pixel].way as usize];
        (way.share[1], way.pane)
    };
    let ray = |number: usize, pixel: usize, radiance: f32| {
        let jitter = |shift: u32| {
            let bits = holo_display::split_mix(number as u64) >> shift & 0xffff;
            bits as f64 / 65536.0
        };
        let x = ((pixel % 64) as f64 + jitter(0)) / 64.0;
        let y = 1.0 - ((pixel / 64) as f64 + jitter(16)) / 64.0;
        let (origin, direction) = eye.ray(x, y);
        let distance = (2.0 - origin.y) / direction.y;
        let radiance = [radiance; 3];
        RaySample { origin, direction, distance, uncertainty: 1e-6, radiance, paths: 1 }
    };
    let total = |pixel: usize| share(pixel).0 * behind + share(pixel).1 * room;
    let even = |_: usize, pixel: usize| total(pixel);
    // A path follows what the pane lets pass or what it mirrors, each half of the time.
    let either = |number: usize, pixel: usize| match number % 2 {
        0 => 2.0 * share(pixel).0 * behind,
        _ => 2.0 * share(pixel).1 * room,
    };
    let shown = |radiance: &dyn Fn(usize, usize) -> f32| {
        let mut rays = floor_rays(100, |_, _| room);
        let numbered = (0..16 * panes.len()).map(|number| {
            let pixel = panes[number / 16];
            ray(number, pixel, radiance(number, pixel))
        });
        rays.extend(numbered);
        let (_, drawn) = seen_by(&raycaster, &rays, &eye);
        let shown: f32 = panes.iter().map(|&pixel| drawn.pixels[pixel][1] / total(pixel)).sum();
        shown / panes.len() as f32
    };
    assert!(panes.len() > 200, "{}", panes.len());
    for shown in [shown(&even), shown(&either)] {
        assert!((shown - 1.0).abs() < 0.03, "{shown}");
    }
}

/// A floor of albedo 0.5 before a pane, with a backdrop of the same albedo 1 m behind the pane.
fn room_with_window() -> Arc<Raycaster> {
    let square = |half: f64, y: f64| {
        [(-half, 0.0), (half, 0.0), (half, 2.0 * half), (-half, 2.0 * half)]
            .map(|(x, z)| DVec3::new(x, y, z))
    };
    let floor =
        [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)].map(|(x, y)| DVec3::new(x, y, 0.0));
    let positions: Vec<DVec3> = [floor, square(2.0, 2.0), square(4.0, 3.0)].concat();
    let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7], [8, 9, 10], [8, 10, 11]];
    let (mut grey, mut pane) = (Material::grey("grey"), Material::grey("pane"));
    grey.bsdf = Bsdf::Diffuse { kd: [0.5; 3] };
    pane.bsdf = Bsdf::ThinGlass { ior: 1.5, transmittance: [1.0; 3] };
    let ids = [0, 0, 1, 1, 0, 0];
    let made = Scene::from_world(&positions, &triangles, &ids, vec![grey, pane], [0.0; 3]);
    Arc::new(Raycaster::build(Arc::new(made.unwrap().0)).unwrap())
}
