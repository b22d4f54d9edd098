//! Noise, borders of light, and standard errors.

#![allow(clippy::unwrap_used, missing_docs)]

use crate::common::*;
use holo_denoise::{Denoiser, Quality};
use holo_driver_surfaces::{EXAMPLE, Gathered, LightStore, Materials, Placer, SurfaceView};
use holo_scene::Bsdf;
use std::path::Path;
use std::sync::Arc;

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
    let rays: Vec<_> = rays.into_iter().map(past_sheet).collect();
    let (view, drawn) = seen_by(&raycaster, &rays, &eye());
    // The sheet hides the floor up to 0.6 from the sheet's middle.
    let beside: Vec<f32> = (view.seen.iter().zip(drawn.pixels))
        .filter(|(seen, _)| seen.point.z < 0.1 && seen.point.truncate().abs().max_element() < 0.8)
        .map(|(_, pixel)| pixel[1])
        .collect();
    let mean = beside.iter().sum::<f32>() / beside.len() as f32;
    assert!(beside.len() > 200 && (mean / 0.02 - 1.0).abs() < 0.1, "{mean}, {}", beside.len());
}

#[test]
fn where_samples_are_many_a_shadow_is_as_sharp_as_its_pixels() {
    // The border crosses squares of pixels instead of running between them.
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
fn with_few_samples_a_shadow_along_a_wall_stays_dark() {
    let raycaster = walled_room(Bsdf::Diffuse { kd: [0.5; 3] });
    let shadow = |_: f64, y: f64| if y > 1.7 { 0.05 } else { 0.5 };
    // About one sample for four pixels.
    let mut rays = noisy(floor_rays(60, shadow));
    rays.extend(noisy(wall_rays(60, 0.5)));
    let (view, drawn) = seen_by(&raycaster, &rays, &to_wall());
    let shaded: Vec<f32> = (view.seen.iter().zip(drawn.pixels))
        .filter(|(seen, _)| seen.material == 0 && (1.75..1.95).contains(&seen.point.y))
        .map(|(_, pixel)| pixel[1])
        .collect();
    let mean = shaded.iter().sum::<f32>() / shaded.len() as f32;
    assert!(shaded.len() > 30 && (0.03..0.12).contains(&mean), "{mean}, {}", shaded.len());
}

#[test]
fn where_the_library_is_installed_few_samples_leave_no_spots() {
    let path = std::env::var_os("HOLODECK_TEST_OIDN");
    let Ok(mut denoiser) = Denoiser::load(path.as_deref().map(Path::new), Quality::Balanced) else {
        println!("skipped: Open Image Denoise is not installed");
        return;
    };
    let raycaster = walled_room(Bsdf::Diffuse { kd: [0.8; 3] });
    let size = 256_usize;
    // One sample for 50 pixels.
    let (store, materials) = kept(&raycaster, &noisy(floor_rays(40, |_, _| 0.25)));
    let view = SurfaceView::new(Arc::clone(&raycaster), materials, &eye(), (256, 256));
    let gathered = Gathered::new(&view, &store);
    let error = |denoiser: Option<&mut Denoiser>| {
        let drawn = gathered.draw(&view, &store, denoiser);
        let is_inner = |at: usize| (size / 8..size - size / 8).contains(&at);
        let inner: Vec<f32> = (0..size * size)
            .filter(|pixel| is_inner(pixel % size) && is_inner(pixel / size))
            .map(|pixel| (drawn.pixels[pixel][1] / 0.25 - 1.0).powi(2))
            .collect();
        inner.iter().sum::<f32>() / inner.len() as f32
    };
    let (own, denoised) = (error(None), error(Some(&mut denoiser)));
    // Lone samples that stay as spots make it three times as large.
    assert!(denoised < 1.5 * own, "{denoised}, the own filter leaves {own}");
}

/// Draws noisy rays of this radiance. Returns the mean squared relative error and the share of
/// pixels within two standard errors, both over pixels away from all edges.
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
    // The mean of 75 samples of standard deviation 1, in one pixel, has a mean squared error of
    // 0.013.
    let (even, _) = errors_of(600, |_, _| 0.25);
    assert!(even < 0.0013, "{even}");
}

#[test]
fn noise_does_not_choose_its_own_weights() {
    // The eye sees 0.83 of these samples, each of relative variance 1. Their mean has the least
    // error. A quarter of them leaves four times as much.
    for count in [100, 200] {
        let seen = 0.83 * (count * count) as f32;
        let (error, _) = errors_of(count, |_, _| 0.25);
        assert!(error < 4.0 / seen, "{count}: {error}, the mean of all has {}", 1.0 / seen);
    }
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
        let mut store = LightStore::new(0.001, 64 << 20);
        store.add(&placed);
        let mut view = SurfaceView::new(Arc::clone(&raycaster), materials, &to_wall(), (64, 64));
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
    // Without the limit, it would contribute about twelve times the light of all others.
    assert!(excess > 0.0 && excess < 0.25 * quiet, "{excess} of {quiet}");
    let all = rays(100, |_, _| 25.0);
    let bright = sum(&drawn(&raycaster, &[&all]));
    assert!((bright / quiet - 100.0).abs() < 0.1, "{bright} of {quiet}");
}

#[test]
fn examples_have_the_light_of_the_samples_and_of_the_others() {
    let raycaster = walled_room(Bsdf::Diffuse { kd: [0.8; 3] });
    let light = |radiance: f32| kept(&raycaster, &floor_rays(200, move |_, _| radiance));
    let ((store, materials), (others, _)) = (light(0.2), light(0.6));
    let view = SurfaceView::new(Arc::clone(&raycaster), materials, &eye(), (64, 64));
    let [gathered, true_light] = [&store, &others].map(|store| Gathered::new(&view, store));
    let examples = gathered.examples((&view, &store), &true_light, 3);
    let (examples, rest) = examples.as_chunks::<EXAMPLE>();
    assert!(rest.is_empty() && examples.len() > 100, "{}", examples.len());
    for example in examples {
        assert!(example.iter().all(|value| value.is_finite()), "{example:?}");
        let radiance = |light: &[f32]| example[3] + example[0] * light[0];
        assert!((radiance(&example[7..]) - 0.6).abs() < 0.01, "{example:?}");
        assert!((radiance(&example[10..]) - 0.2).abs() < 0.01, "{example:?}");
        // The narrowest neighbourhood: its light, and that it has samples.
        assert!((radiance(&example[13..]) - 0.2).abs() < 0.01 && example[16] == 1.0);
    }
}
