//! Surfaces and light at half the resolution: exact edges, the same brightness.

use crate::common;
use crate::stage::{Stage, bits, diffuse, even, plate, shadow, shine, wall};
use holo_display::{Frame, Resolution};
use holo_driver_voronoi::Voronoi;
use holo_section::{BeamId, BeamKey, Sample};

fn drawn(mut canvas: Voronoi, samples: &[(BeamId, Sample)]) -> Frame {
    samples.iter().for_each(|(beam, sample)| {
        canvas.insert(BeamKey { section: 0, beam: *beam }, 1, std::slice::from_ref(sample))
    });
    canvas.draw()
}

#[test]
fn every_pixel_shows_the_surface_that_its_own_middle_meets() {
    let stage = plate();
    let samples = stage.samples(even, 20_000, common::clean);
    for size in [(64, 48), (61, 47), (120, 3)] {
        let canvas = stage.sized(size, Resolution::Half);
        let view = *canvas.view();
        let drawn = drawn(canvas, &samples);
        let picture = &drawn.picture;
        assert_eq!(
            (picture.width, picture.height, picture.pixels.len()),
            (size.0, size.1, (size.0 * size.1) as usize)
        );
        let mut contrasts = 0;
        for (number, colour) in (0..).zip(&picture.pixels) {
            let (x, y) = (f64::from(number % size.0) + 0.5, f64::from(number / size.0) + 0.5);
            let (eye, along) = view.ray(x / f64::from(size.0), 1.0 - y / f64::from(size.1));
            let (_, truth) = shine(&stage.raycaster, eye, along, even).unwrap();
            contrasts += u32::from(truth[1] < 0.1);
            // A step of RGBE, of the brightest channel.
            assert!(
                (colour[1] - truth[1]).abs() < 1.0 / 256.0,
                "{number} of {size:?}: {colour:?}, {truth:?}"
            );
        }
        assert!(size.1 < 10 || contrasts > 200, "the plate is seen: {contrasts}");
        assert_eq!(drawn.depth.len(), picture.pixels.len());
    }
}

#[test]
fn a_moving_picture_is_as_bright_as_one_at_rest() {
    let size = (96, 72);
    let stage = Stage::new(&[wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0)], vec![diffuse([0.5; 3])]);
    let all = stage.samples(shadow, 640_000, common::exponential);
    let mean = |resolution, samples: &[(BeamId, Sample)]| {
        let pixels = drawn(stage.sized(size, resolution), samples).picture.pixels;
        pixels.iter().map(|pixel| f64::from(pixel[1])).sum::<f64>() / pixels.len() as f64
    };
    // Independent sets of samples: of each the means at both resolutions.
    let sets = all.chunks(all.len() / 16).take(16);
    let means: Vec<(f64, f64)> =
        sets.map(|set| (mean(Resolution::Full, set), mean(Resolution::Half, set))).collect();
    let count = means.len() as f64;
    let bright = means.iter().map(|(full, _)| full).sum::<f64>() / count;
    let apart = means.iter().map(|(full, half)| half - full).sum::<f64>() / count;
    let variance =
        means.iter().map(|(full, half)| (half - full - apart).powi(2)).sum::<f64>() / (count - 1.0);
    // Student's t of 15 degrees of freedom, 99 %, both sides.
    let interval = 2.947 * (variance / count).sqrt();
    assert!(apart.abs() < interval, "{apart} of {bright}, within {interval}");
    assert!(interval < 0.003 * bright, "less than 0.3 % would be told: {interval} of {bright}");
}

#[test]
fn the_order_of_samples_changes_no_bit_of_a_moving_picture() {
    let stage = plate();
    let mut samples = stage.samples(even, 6000, common::exponential);
    let first = drawn(stage.sized((63, 49), Resolution::Half), &samples);
    samples.reverse();
    assert_eq!(bits(&first), bits(&drawn(stage.sized((63, 49), Resolution::Half), &samples)));
    // Without any, it is lit from the eye and counted in pixels of the picture.
    let empty = stage.sized((64, 48), Resolution::Half).draw();
    assert_eq!((empty.empty_pixels, empty.guessed_pixels), (64 * 48, 64 * 48));
}
