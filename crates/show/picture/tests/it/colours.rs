//! Luminances of three pure lamps, wherever the program shows them.

use holo_picture::{
    EFFICACY, LUMINANCE_WEIGHTS, Look, Picture, Scale, Scaling, compare, luminance,
    relative_luminance,
};

/// Red, green, blue and white lamps of radiance 10, and their luminances in cd/m².
const LAMPS: [([f32; 3], f32); 4] = [
    ([10.0, 0.0, 0.0], 380.554),
    ([0.0, 10.0, 0.0], 1280.208),
    ([0.0, 0.0, 10.0], 129.238),
    ([10.0; 3], 1790.0),
];

#[test]
fn the_luminance_of_pure_lamps_is_that_of_rec_709() {
    for (lamp, candela) in LAMPS {
        assert!((luminance(lamp) / candela - 1.0).abs() < 1e-5, "{lamp:?}");
        assert!((relative_luminance(lamp) * EFFICACY / candela - 1.0).abs() < 1e-5, "{lamp:?}");
    }
    assert!((LUMINANCE_WEIGHTS.iter().sum::<f32>() - 1.0).abs() < 1e-6);
}

#[test]
fn false_colours_of_a_pure_lamp_are_those_of_a_grey_of_its_luminance() {
    for (lamp, candela) in LAMPS {
        let scaling = Scaling::Fixed(Scale::new(1.0, 1e4, true).unwrap());
        let look = Look { false_color: true, scaling, ..Look::default() };
        let shown = |rgb: [f32; 3]| {
            let picture = Picture::from_pixels(1, 1, vec![rgb]).unwrap();
            look.show(&picture).rgb
        };
        assert_eq!(shown(lamp), shown([candela / 179.0; 3]), "{lamp:?}");
    }
}

#[test]
fn differences_of_pure_lamps_count_by_their_luminance() {
    // A lamp that is twice as bright in one channel has a bias of that channel's weight.
    let even = Picture::from_pixels(8, 8, vec![[1.0; 3]; 64]).unwrap();
    for channel in 0..3 {
        let mut colour = [1.0f32; 3];
        colour[channel] = 1.5;
        let other = Picture::from_pixels(8, 8, vec![colour; 64]).unwrap();
        let bias = compare(&other, &even).unwrap().bias_all;
        let wanted = 0.5 * f64::from(LUMINANCE_WEIGHTS[channel]);
        assert!((bias - wanted).abs() < 1e-4, "{channel}: {bias} {wanted}");
    }
}
