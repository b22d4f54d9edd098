//! Pictures of a scene known in closed form.

use crate::common::*;
use glam::DVec3;
use holo_driver_quadtree::{Quadtree, QuadtreeParams};
use holo_picture::View;
use holo_section::{Sample, Section, SectionSpec, ViewClass};
use std::sync::Arc;

const SIZE: (u32, u32) = (160, 120);

fn psnr(error: f64) -> f64 {
    -10.0 * error.log10()
}

#[test]
fn more_batch_samples_make_a_better_picture() {
    let (section, view) = (room_section(16), room_view(SIZE));
    let reference = truth(room, &view, SIZE, 8);
    let mut last = 0.0;
    for density in [0.25, 1.0, 4.0, 16.0] {
        let count = (f64::from(SIZE.0 * SIZE.1) * density) as usize;
        let stored = batch_samples(room, &section, &view, SIZE, count, 4, clean);
        let frame = quadtree(&section, &view, SIZE, QuadtreeParams::default(), &stored).draw();
        let quality = psnr(relative_error(&frame, &reference));
        println!("{density} batch samples a pixel ({} used): {quality:.1} dB", frame.samples_used);
        assert!(quality > last + 1.0, "{quality} after {last}");
        last = quality;
    }
    assert!(last > 25.0, "{last}");
}

#[test]
fn reprojected_samples_land_where_the_view_sees_their_surface() {
    // A sheared section far from the origin, with different cells along every axis.
    let section = Section::new(SectionSpec {
        origin: [1e6 + 2.0, -3e6, 5.0],
        axes: [[4.0, 0.5, 0.0], [-0.3, 3.0, 0.2], [0.1, 0.0, 2.0]],
        grid: [3, 5, 7],
        class: ViewClass::Interior,
        obstructions: true,
    })
    .unwrap();
    let eye = section.local_to_world(DVec3::new(0.4, 0.6, 0.3));
    let seen = View::new(
        eye,
        DVec3::new(0.7, 0.5, 0.2),
        DVec3::new(0.1, 0.0, 1.0),
        Some(70.0),
        None,
        SIZE,
    )
    .unwrap();
    let mut random = Random(9);
    let mut shown = 0;
    for _ in 0..400 {
        let (origin, direction) = seen.ray(random.unit(), random.unit());
        // A line near the eye's, so that its pixel follows from the distance.
        let near = origin + DVec3::new(random.unit(), random.unit(), random.unit()) * 0.3;
        let hit = section.line(near, direction).unwrap();
        let ray = section.ray(hit.pair, hit.coords);
        let sample = Sample::encode(
            hit.coords,
            [0.25, 0.5, 1.0],
            1.0 + 30.0 * random.unit(),
            section.diagonal(),
            0,
        );
        let surface = ray.origin + ray.direction * sample.distance(section.diagonal());
        let Some((x, y, distance)) = seen.project(surface) else { continue };
        let Some((column, row)) = View::pixel_at(SIZE, x, y) else { continue };
        // Within a thousandth of a pixel's border it may land on the other side.
        let inside = |along: f64| (0.001..0.999).contains(&along.fract());
        if !(inside(x * f64::from(SIZE.0)) && inside(y * f64::from(SIZE.1))) {
            continue;
        }
        let params = QuadtreeParams {
            leaf: holo_driver_quadtree::LeafSize::Fixed(0),
            ..QuadtreeParams::default()
        };
        let mut tree = Quadtree::new(Arc::from([section.clone()]), seen, SIZE, params);
        tree.insert(key(0, section.beam(hit.pair)), 1, &[sample]);
        let frame = tree.draw();
        assert_eq!(frame.samples_used, 1);
        assert_eq!(frame.empty_pixels, u64::from(SIZE.0 * SIZE.1 - 1));
        assert_eq!(
            frame.picture.get(column, row),
            Some([0.25, 0.5, 1.0]),
            "its colours, in their order"
        );
        let depth = f64::from(frame.depth[(row * SIZE.0 + column) as usize]);
        assert!((depth / distance - 1.0).abs() < 0.02, "{depth} {distance}");
        shown += 1;
    }
    assert!(shown > 250, "{shown}");
}

#[test]
fn what_hit_nothing_is_shown_by_direction_at_any_distance_from_the_eye() {
    let (section, seen) = (room_section(8), room_view(SIZE));
    fn sky(_: DVec3, direction: DVec3) -> ([f32; 3], f64) {
        ([0.5 + 0.4 * direction.y as f32, 0.5, 0.5 + 0.4 * direction.z as f32], f64::INFINITY)
    }
    let stored = batch_samples(sky, &section, &seen, SIZE, 200_000, 1, clean);
    let frame = quadtree(&section, &seen, SIZE, QuadtreeParams::default(), &stored).draw();
    let error = relative_error(&frame, &truth(sky, &seen, SIZE, 2));
    assert!(psnr(error) > 40.0, "{}", psnr(error));
    assert!(frame.depth.iter().all(|depth| depth.is_infinite()));
}

/// A bright disc before a dark far wall; the eye is in a small section in front of it.
fn disc(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let to_disc = (6.0 - origin.x) / direction.x;
    let point = origin + direction * to_disc;
    if to_disc > 0.0 && (point.y * point.y + point.z * point.z) < 1.0 {
        return ([1.0, 0.8, 0.1], to_disc);
    }
    let to_wall = (20.0 - origin.x) / direction.x;
    if to_wall > 0.0 { ([0.05, 0.1, 0.2], to_wall) } else { ([0.0; 3], f64::INFINITY) }
}

#[test]
fn silhouettes_do_not_bleed() {
    let section = section([-1.0; 3], [2.0; 3], [8; 3], ViewClass::Interior, true);
    let seen = view([0.1, 0.2, -0.1], [6.0, 0.0, 0.0], 40.0, SIZE);
    let reference = truth(disc, &seen, SIZE, 8);
    for (name, batch, near, noise) in [
        ("batch only, sparse", 0.5, 0.0, clean as Noise),
        ("batch only", 4.0, 0.0, clean),
        ("clean", 1.0, 1.0, clean),
        ("noisy", 2.0, 2.0, some_paths),
        ("one path", 8.0, 8.0, one_path),
    ] {
        let count = |density: f64| (f64::from(SIZE.0 * SIZE.1) * density) as usize;
        let mut stored = batch_samples(disc, &section, &seen, SIZE, count(batch), 3, noise);
        stored.extend(near_samples(disc, &section, &seen, count(near), 5, noise));
        let frame = quadtree(&section, &seen, SIZE, QuadtreeParams::default(), &stored).draw();
        // Pixels two or more from the silhouette show one surface only. The share of red identifies
        // it, whatever the noise.
        let (mut wrong, mut looked_at) = (0, 0);
        for row in 2..SIZE.1 as i32 - 2 {
            for column in 2..SIZE.0 as i32 - 2 {
                let at = |column: i32, row: i32| (row * SIZE.0 as i32 + column) as usize;
                let here = reference[at(column, row)];
                let pure =
                    (-2..=2).all(|y| (-2..=2).all(|x| reference[at(column + x, row + y)] == here));
                if !pure {
                    continue;
                }
                looked_at += 1;
                let shown = frame.picture.pixels[at(column, row)];
                let red_share = shown[0] / (shown[0] + shown[2]);
                let expected = here[0] / (here[0] + here[2]);
                wrong += u32::from((red_share - expected).abs() > 0.1);
            }
        }
        println!("{name}: {wrong} of {looked_at} pixels away from the silhouette mix surfaces");
        assert!(looked_at > 10_000);
        // Allowed: an empty pixel whose leaf has too few samples of the surface in front.
        assert!(f64::from(wrong) < 0.002 * f64::from(looked_at), "{name}: {wrong} of {looked_at}");
    }
}

#[test]
fn silhouettes_become_smooth_by_samples_near_the_eye() {
    let section = section([-1.0; 3], [2.0; 3], [8; 3], ViewClass::Interior, true);
    let seen = view([0.1, 0.2, -0.1], [6.0, 0.0, 0.0], 40.0, SIZE);
    let reference = truth(disc, &seen, SIZE, 16);
    let mut errors = Vec::new();
    for density in [4.0, 16.0, 64.0] {
        let count = (f64::from(SIZE.0 * SIZE.1) * density) as usize;
        let mut stored = near_samples(disc, &section, &seen, count, 5, clean);
        stored.extend(batch_samples(disc, &section, &seen, SIZE, count, 3, clean));
        let frame = quadtree(&section, &seen, SIZE, QuadtreeParams::default(), &stored).draw();
        errors.push(relative_error(&frame, &reference));
    }
    println!("{errors:.6?}");
    // All error is on the silhouette, where coverage is a share of n samples: it falls as 1/n.
    assert!(errors[1] < errors[0] / 2.5 && errors[2] < errors[1] / 2.5, "{errors:?}");
}

#[test]
fn pixels_that_no_section_covers_stay_black_and_are_counted() {
    let section = section([0.0; 3], [1.0; 3], [4; 3], ViewClass::Exterior, true);
    let seen = view([-1.0, 0.0, 0.5], [0.0, 0.0, 0.5], 60.0, SIZE);
    fn bright(_: DVec3, _: DVec3) -> ([f32; 3], f64) {
        ([1.0; 3], 1.0)
    }
    let stored = near_samples(bright, &section, &seen, 2000, 5, clean);
    let frame = quadtree(&section, &seen, SIZE, QuadtreeParams::default(), &stored).draw();
    let mut uncovered = 0;
    for row in 0..SIZE.1 {
        for column in 0..SIZE.0 {
            let (x, y) = View::pixel_centre(SIZE, column, row);
            let (eye, direction) = seen.ray(x, y);
            let pixel = frame.picture.get(column, row).unwrap();
            if section.line(eye, direction).is_some() {
                assert!(
                    pixel[0] > 0.9,
                    "({column}, {row}) is covered, and its siblings have samples"
                );
            } else {
                assert_eq!(pixel, [0.0; 3]);
                uncovered += 1;
            }
        }
    }
    assert_eq!(frame.uncovered_pixels, uncovered);
    assert!(uncovered > 5000 && uncovered < 15_000);
    assert!(
        frame.empty_pixels > 5000 && frame.empty_pixels + uncovered < u64::from(SIZE.0 * SIZE.1)
    );

    let tree = Quadtree::new(Arc::from([]), seen, SIZE, QuadtreeParams::default());
    assert_eq!(tree.draw().uncovered_pixels, u64::from(SIZE.0 * SIZE.1));
}

#[test]
fn surfaces_behind_the_eye_are_dropped() {
    let section = section([0.0; 3], [1.0; 3], [4; 3], ViewClass::Interior, true);
    // The eye is beyond the section; lines through it meet the section behind.
    let seen = view([3.0, 0.5, 0.5], [4.0, 0.5, 0.5], 20.0, SIZE);
    let (eye, direction) = seen.ray(0.5, 0.5);
    let hit = section.line(eye, direction).unwrap();
    let draw = |distance| {
        let sample = Sample::encode(hit.coords, [1.0; 3], distance, section.diagonal(), 0);
        let mut tree =
            Quadtree::new(Arc::from([section.clone()]), seen, SIZE, QuadtreeParams::default());
        tree.insert(key(0, section.beam(hit.pair)), 1, &[sample]);
        tree.draw().samples_used
    };
    // From the entry wall at x = 0: the eye is 3 away.
    assert_eq!(draw(2.9), 0);
    assert_eq!(draw(3.1), 1);
}

/// A disc and a thin bar close to the eye, before a wall eight times as far.
fn near_disc(origin: DVec3, direction: DVec3) -> ([f32; 3], f64) {
    let to_disc = (2.5 - origin.x) / direction.x;
    let point = origin + direction * to_disc;
    let met = point.y * point.y + point.z * point.z < 0.16 || (point.y - 0.55).abs() < 0.02;
    if to_disc > 0.0 && met { ([1.0, 0.8, 0.1], to_disc) } else { disc(origin, direction) }
}

#[test]
fn batch_samples_that_looked_behind_a_near_edge_do_not_spoil_it() {
    for grid in [4, 8, 16] {
        let section = section([-1.0; 3], [2.0; 3], [grid; 3], ViewClass::Interior, true);
        let seen = view([0.1, 0.2, -0.1], [6.0, 0.0, 0.0], 40.0, SIZE);
        let reference = truth(near_disc, &seen, SIZE, 8);
        let mut last = f64::INFINITY;
        for density in [0.1, 0.4, 1.6, 6.4] {
            let count = (f64::from(SIZE.0 * SIZE.1) * density) as usize;
            let stored = batch_samples(near_disc, &section, &seen, SIZE, count, 3, clean);
            let frame = quadtree(&section, &seen, SIZE, QuadtreeParams::default(), &stored).draw();
            let error = relative_error(&frame, &reference);
            println!(
                "{grid}³, {density} batch samples a pixel: error {error:.4}, bias {:+.3}",
                bias(&frame, &reference)
            );
            assert!(error < 0.85 * last, "{grid}³, {density} a pixel: {error} after {last}");
            last = error;
        }
        assert!(last < 0.1, "{last}");
    }
}

#[test]
fn one_sample_fills_all_that_is_covered() {
    let (section, seen) = (room_section(4), room_view((300, 200)));
    let stored = near_samples(room, &section, &seen, 1, 5, clean);
    let frame = quadtree(&section, &seen, (300, 200), QuadtreeParams::default(), &stored).draw();
    let expected = stored[0].1.rgb();
    for pixel in &frame.picture.pixels {
        // Blending single-precision means rounds a few times.
        assert!(
            (0..3).all(|i| (pixel[i] - expected[i]).abs() <= 1e-6 * expected[i]),
            "{pixel:?} {expected:?}"
        );
    }
    assert_eq!(
        (frame.samples_used, frame.empty_pixels, frame.uncovered_pixels),
        (1, 300 * 200 - 1, 0)
    );
}
