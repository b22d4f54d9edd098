//! The store: what it keeps, and its independence of the order of samples.

#![allow(clippy::unwrap_used, missing_docs)]

use crate::common::*;
use glam::DVec3;
use holo_driver_surfaces::{Gathered, LightStore, Materials, Placer, RaySample, SurfaceView};
use holo_scene::Bsdf;
use std::sync::Arc;

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
    let view = SurfaceView::new(Arc::clone(&raycaster), Arc::clone(&materials), &eye(), (64, 64));
    let mut store = LightStore::new(0.001, 64 << 20);
    let (first, later) = placed.split_at(3456);
    store.add(first);
    let mut gathered = Gathered::new(&view, &store);
    store.add(later);
    gathered.add(&view, later);
    let at_once = Gathered::new(&view, &store);
    let pixels = |gathered: &Gathered| gathered.draw(&view, &store, None).pixels;
    assert_eq!(pixels(&gathered), pixels(&at_once));
}

#[test]
fn a_pixel_has_all_its_samples_however_wide_it_is() {
    let raycaster = room();
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let mut placed = Vec::new();
    Placer::new(&raycaster, &materials).place_rays(&rays(200, |_, _| 1.0), &mut placed);
    let samples = |finest: f32| {
        let view = SurfaceView::new(Arc::clone(&raycaster), Arc::clone(&materials), &eye(), (4, 4));
        let mut store = LightStore::new(finest, 64 << 20);
        store.add(&placed);
        Gathered::new(&view, &store).samples()
    };
    // A pixel is 0.87 wide; buckets are 1.02 and 0.1 wide.
    let [wide, narrow] = [1e-3, 1e-4].map(samples);
    assert!(wide > 20_000, "{wide}");
    // Rounding moves samples over the border of pixels.
    assert!(narrow.abs_diff(wide) * 50 < wide, "{narrow} of {wide}");
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
fn samples_count_by_their_paths() {
    let mut mixed = rays(100, |_, _| 0.5);
    let few = |ray: &RaySample| RaySample { radiance: [0.1; 3], paths: 3, ..*ray };
    mixed.extend(mixed.clone().iter().map(few));
    let pixels = drawn(&room(), &[&mixed]);
    let middle = pixels[32 * 64 + 10][1];
    assert!((middle - 0.2).abs() < 1e-3, "{middle}");
}

#[test]
fn unknown_pixels_are_as_bright_as_known_ones() {
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
fn a_store_keeps_what_was_seen_last() {
    let raycaster = room();
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(&raycaster, &materials);
    let mut placed = Vec::new();
    placer.place_rays(&rays(80, |_, _| 1.0), &mut placed);
    // Both halves are farther apart than the width of a bucket, 0.1.
    placed.retain(|sample| sample.point().x.abs() > 0.2);
    let (before, now): (Vec<_>, Vec<_>) =
        placed.into_iter().partition(|sample| sample.point().x < 0.0);
    // A sample takes 16 bytes, and a list may be a fifth empty. Both halves do not fit.
    let mut store = LightStore::new(0.0001, 20 * 4_500);
    store.add(&before);
    store.begin_round();
    store.add(&now);
    assert_eq!(store.kept(), now.len());
}

#[test]
fn a_view_with_too_many_samples_keeps_some_whatever_their_light() {
    let raycaster = room();
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(&raycaster, &materials);
    let mut placed = Vec::new();
    placer.place_rays(&rays(200, |x, _| if x.sin() > 0.0 { 1.0 } else { 0.5 }), &mut placed);
    let mut store = LightStore::new(0.0001, 16 * 6_400);
    for part in placed.chunks(1000) {
        store.add(part);
        assert!(store.kept() <= 6_400, "{} samples", store.kept());
    }
    assert!(store.kept() > 1_600, "{} samples", store.kept());
    // The same samples in another order leave the same set.
    let mut other = LightStore::new(0.0001, 16 * 6_400);
    placed.reverse();
    placed.chunks(777).for_each(|part| _ = other.add(part));
    assert_eq!(other.kept(), store.kept());
}
