//! Tests that the measures are those of the reference data's `compare.py`, and that the bias
//! interval has its stated coverage.

// Helpers of tests may fail as tests do; clippy allows it only inside the test functions
// themselves.
#![allow(clippy::unwrap_used, clippy::panic)]

use holo_picture::{
    BIAS_Z, CompareError, Measures, Picture, bias_interval, compare, worst_block_away,
    worst_block_beyond_noise, worst_block_shown,
};
use std::path::PathBuf;

/// x ← 1664525·x + 1013904223 mod 2³², u = x / 2³² (Numerical Recipes, "quick and dirty").
struct Lcg(u32);

impl Lcg {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(self.0) / 2f64.powi(32)
    }

    /// Standard normal by Box and Muller.
    fn normal(&mut self) -> f64 {
        let (u, v) = (self.next(), self.next());
        (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

/// Returns (picture, reference). For each pixel from the top, row by row, and each channel, u and v
/// are drawn. The reference is (0.02 + u³)(1 + 0.1·row), except for a lamp 200(1 + u) in the top
/// left 3×3 and 0 in the last two columns. The picture is the reference (as f32) times 0.8 + 0.5v,
/// plus 0.001v, except for 10⁴ in the last column of row 1.
fn pair(width: u32, height: u32, seed: u32) -> (Picture, Picture) {
    let mut lcg = Lcg(seed);
    let (mut picture, mut reference) = (Picture::new(width, height), Picture::new(width, height));
    for y in 0..height {
        for x in 0..width {
            let at = (y * width + x) as usize;
            for c in 0..3 {
                let (u, v) = (lcg.next(), lcg.next());
                let value = match (x, y) {
                    _ if x + 2 >= width => 0.0,
                    (0..3, 0..3) => 200.0 * (1.0 + u),
                    _ => (0.02 + u * u * u) * (1.0 + 0.1 * f64::from(y)),
                };
                reference.pixels[at][c] = value as f32;
                let noisy = f64::from(value as f32) * (0.8 + 0.5 * v) + 0.001 * v;
                picture.pixels[at][c] = if x == width - 1 && y == 1 { 1e4 } else { noisy as f32 };
            }
        }
    }
    (picture, reference)
}

/// numpy sums in another order, so 10⁴ terms of f64 differ in the last digits.
fn assert_equal(found: Measures, wanted: [f64; 8]) {
    let Measures { relmse, relmse_trim, log_rmse, psnr_disp, bias, bias_all, worst_block, bad } =
        found;
    let found = [relmse, relmse_trim, log_rmse, psnr_disp, bias, bias_all, worst_block, bad];
    for (index, (found, wanted)) in found.into_iter().zip(wanted).enumerate() {
        assert!(
            (found - wanted).abs() <= 1e-10 * wanted.abs().max(1e-3),
            "measure {index}: {found} for {wanted}"
        );
    }
}

// Results of compare.py's `metrics` for `pair` (numpy 2.4): lamps, blacks, fireflies, incomplete
// blocks.
const BY_COMPARE_PY: [((u32, u32, u32), [f64; 8]); 3] = [
    (
        (50, 37, 1),
        [
            5.418924858527638,
            0.013501734836563507,
            0.16436621232126933,
            28.179701432030633,
            7.716313422137773,
            2.6855227567088207,
            0.05063223119582272,
            0.036216216216216214,
        ],
    ),
    (
        (4, 3, 7),
        [
            833.3516726208591,
            0.020006495482465095,
            1.4087380462394754,
            10.703775225264822,
            6.398537909937485,
            6.398537909937485,
            0.0,
            0.16666666666666666,
        ],
    ),
    (
        (64, 48, 12345),
        [
            3.270528329703535,
            0.0152772566006896,
            0.13316406064524047,
            28.869685895691877,
            3.7939856281178903,
            1.9001766088928043,
            94.72275520256753,
            0.0322265625,
        ],
    ),
];

#[test]
fn the_measures_match_compare_py() {
    for ((width, height, seed), wanted) in BY_COMPARE_PY {
        let (picture, reference) = pair(width, height, seed);
        assert_equal(compare(&picture, &reference).unwrap(), wanted);
    }
}

#[test]
fn measures_print_as_in_compare_py() {
    let line = |(width, height, seed)| {
        let (picture, reference) = pair(width, height, seed);
        compare(&picture, &reference).unwrap().to_string()
    };
    assert_eq!(
        line((50, 37, 1)),
        "relmse=5.4189 relmse_trim=0.013502 log_rmse=0.16437 psnr_disp=28.18 bias=7.7163 bias_all=2.6855 \
         worst_block=0.050632 bad=0.036216"
    );
    assert_eq!(
        line((4, 3, 7)),
        "relmse=833.35 relmse_trim=0.020006 log_rmse=1.4087 psnr_disp=10.704 bias=6.3985 bias_all=6.3985 worst_block=0 \
         bad=0.16667"
    );
}

#[test]
fn five_digits_print_as_in_c() {
    let mut measures = compare(&Picture::new(1, 1), &Picture::new(1, 1)).unwrap();
    // Each from Python: f'{x:.5g}'.
    measures.relmse = 1.7e-5;
    measures.relmse_trim = 123456.0;
    measures.log_rmse = 99999.6;
    measures.psnr_disp = 0.00012345678;
    measures.bias = -3.0;
    measures.bias_all = f64::NAN;
    measures.worst_block = f64::INFINITY;
    measures.bad = -1e-12;
    assert_eq!(
        measures.to_string(),
        "relmse=1.7e-05 relmse_trim=1.2346e+05 log_rmse=1e+05 psnr_disp=0.00012346 bias=-3 bias_all=nan worst_block=inf \
         bad=-1e-12"
    );
}

#[test]
fn equal_pictures_have_no_error_and_a_scaled_picture_has_its_scale_as_bias() {
    let (_, reference) = pair(40, 40, 3);
    let same = compare(&reference, &reference).unwrap();
    assert_equal(same, [0.0, 0.0, 0.0, 120.0, 0.0, 0.0, 0.0, 0.0]);
    let mut twice = reference.clone();
    twice.pixels.as_flattened_mut().iter_mut().for_each(|value| *value *= 2.0);
    let measures = compare(&twice, &reference).unwrap();
    assert!((measures.bias - 1.0).abs() < 1e-12 && (measures.bias_all - 1.0).abs() < 1e-12);
    assert!((measures.worst_block - 1.0).abs() < 1e-12);
}

#[test]
fn a_block_counts_only_if_half_of_its_pixels_are_not_lamps() {
    // Three blocks side by side, the first with lamps. Its other pixels are three times too bright.
    let worst = |lamps: usize| {
        let mut reference = Picture::from_pixels(48, 16, vec![[1.0; 3]; 48 * 16]).unwrap();
        let mut picture = reference.clone();
        for index in 0..256 {
            let at = index / 16 * 48 + index % 16;
            if index < lamps {
                (reference.pixels[at], picture.pixels[at]) = ([1e3; 3], [1e3; 3]);
            } else {
                picture.pixels[at] = [3.0; 3];
            }
        }
        compare(&picture, &reference).unwrap().worst_block
    };
    assert!((worst(0) - 2.0).abs() < 1e-12 && (worst(128) - 2.0).abs() < 1e-12);
    assert_eq!(worst(129), 0.0);
}

#[test]
fn a_block_is_shown_no_brighter_than_white() {
    // Four blocks: one at a half, one with 16 pixels of a lamp, which are fewer than 5 % of all.
    // White is 1.
    let of_block = |column: usize, index: usize| index / 16 * 64 + column * 16 + index % 16;
    let mut reference = Picture::from_pixels(64, 16, vec![[1.0; 3]; 1024]).unwrap();
    (0..256).for_each(|index| reference.pixels[of_block(1, index)] = [0.5; 3]);
    (0..16).for_each(|index| reference.pixels[of_block(3, index)] = [500.0; 3]);
    let shown = |change: fn(&mut Picture, usize), column: usize| {
        let mut picture = reference.clone();
        (0..16).for_each(|index| change(&mut picture, of_block(column, index)));
        worst_block_shown(&picture, &reference).unwrap()
    };
    assert_eq!(shown(|picture, at| picture.pixels[at] = [400.0; 3], 0), 0.0);
    // 16 of 256 pixels of value 0.5 change by 0.25.
    assert!(
        (shown(|picture, at| picture.pixels[at] = [0.25; 3], 1) - 16.0 * 0.25 / 128.0).abs() < 1e-7
    );
    assert!(
        (shown(|picture, at| picture.pixels[at] = [400.0; 3], 1) - 16.0 * 0.5 / 128.0).abs() < 1e-7
    );
}

#[test]
fn a_block_that_approaches_the_reference_does_not_flicker() {
    let even = |values: [f32; 2]| {
        let pixels = (0..512).map(|at| [values[at % 32 / 16]; 3]).collect();
        Picture::from_pixels(32, 16, pixels).unwrap()
    };
    let reference = even([1.0, 0.5]);
    let away =
        |picture, before| worst_block_away(&even(picture), &even(before), &reference).unwrap();
    assert_eq!(away([0.9, 0.5], [0.7, 0.5]), 0.0);
    assert_eq!(away([0.9, 0.45], [0.9, 0.55]), 0.0);
    assert!((away([0.9, 0.4], [0.7, 0.55]) - 0.1).abs() < 1e-6);
    // Values above white are white.
    assert_eq!(away([3.0, 0.5], [1.0, 0.5]), 0.0);
}

#[test]
fn errors_name_the_picture_that_cannot_be_compared() {
    let (a, b) = (Picture::new(4, 3), Picture::new(3, 4));
    assert_eq!(compare(&a, &b), Err(CompareError::Sizes { picture: (4, 3), reference: (3, 4) }));
    let mut broken = a.clone();
    broken.pixels[6][1] = f32::NAN;
    assert_eq!(
        compare(&a, &broken),
        Err(CompareError::NotFinite { which: "reference", column: 2, row: 1 })
    );
    broken.pixels.pop();
    assert_eq!(compare(&broken, &a), Err(CompareError::Pixels("picture")));
    let mut negative = a.clone();
    negative.pixels[11][2] = -1.0;
    let which = "reference's standard error";
    assert_eq!(
        bias_interval(&a, None, &a, Some(&negative)),
        Err(CompareError::NegativeError { which, column: 3, row: 2 })
    );
}

#[test]
fn the_interval_of_an_even_picture_is_that_of_the_closed_form() {
    // Mean of n pixels with standard error s each: s/√n. Ratio 1.5, both errors 0.1 and 0.2: √(0.01
    // + 2.25·0.04)/√n.
    let even = |value: f32| Picture::from_pixels(8, 4, vec![[value; 3]; 32]).unwrap();
    let (a, a_se, r, r_se) = (even(1.5), even(0.1), even(1.0), even(0.2));
    let half = |a_se, r_se| bias_interval(&a, a_se, &r, r_se).unwrap();
    let close = |found: (f64, f64), half: f64| {
        (found.0 - 0.5).abs() < 1e-7 && (found.1 / half - 1.0).abs() < 1e-6
    };
    assert!(close(
        half(Some(&a_se), Some(&r_se)),
        BIAS_Z * (0.01f64 + 2.25 * 0.04).sqrt() / 32f64.sqrt()
    ));
    assert!(close(half(Some(&a_se), None), BIAS_Z * 0.1 / 32f64.sqrt()));
    assert!(close(half(None, Some(&r_se)), BIAS_Z * 0.3 / 32f64.sqrt()));
    assert_eq!(half(None, None).1, 0.0);
}

#[test]
fn noise_is_subtracted_from_the_error_of_a_block() {
    // One of four blocks is 10 % too bright. If a pixel has standard error s, the mean of its 256
    // pixels has s/16; the reference's is 1.1 times that.
    let even = |value: f32| Picture::from_pixels(32, 32, vec![[value; 3]; 1024]).unwrap();
    let (mut a, r) = (even(1.0), even(1.0));
    for at in (0..16).flat_map(|row| row * 32..row * 32 + 16) {
        a.pixels[at] = [1.1; 3];
    }
    let beyond = |a_se: Option<f32>, r_se: Option<f32>| {
        worst_block_beyond_noise(&a, a_se.map(even).as_ref(), &r, r_se.map(even).as_ref()).unwrap()
    };
    let close = |found: f64, wanted: f64| (found - wanted).abs() < 1e-6;
    assert!(
        close(beyond(None, None), compare(&a, &r).unwrap().worst_block)
            && close(beyond(None, None), 0.1)
    );
    assert!(close(beyond(Some(0.8), None), (0.01f64 - 0.05 * 0.05).sqrt()));
    assert!(close(beyond(Some(0.8), Some(0.8)), (0.01f64 - 2.21 * 0.05 * 0.05).sqrt()));
    assert_eq!(beyond(Some(1.7), None), 0.0);
}

#[test]
fn the_interval_contains_the_true_bias_in_99_of_100_pictures() {
    const TRIALS: u32 = 2000;
    const TRUE_BIAS: f64 = 0.03;
    let (width, height) = (16, 16);
    let mut lcg = Lcg(99);
    let truth: Vec<f64> = (0..width * height).map(|_| 0.5 + lcg.next()).collect();
    let mut lamps = truth.clone();
    lamps[0] = 1e4;
    let grey = |values: Vec<f64>| {
        Picture::from_pixels(width, height, values.into_iter().map(|v| [v as f32; 3]).collect())
            .unwrap()
    };
    let (share_a, share_r) = (0.4, 0.2);
    let errors = |share: f64| grey(lamps.iter().map(|v| v * share).collect());
    let (a_se, r_se) = (errors(share_a), errors(share_r));
    let mut missed = 0;
    for _ in 0..TRIALS {
        // Grey noise: the channels are fully correlated, as the interval assumes, so it is neither
        // too wide nor too narrow.
        let mut noisy = |share: f64, scale: f64| {
            grey(lamps.iter().map(|v| v * (scale + share * lcg.normal())).collect())
        };
        let (a, r) = (noisy(share_a, 1.0 + TRUE_BIAS), noisy(share_r, 1.0));
        let (bias, half) = bias_interval(&a, Some(&a_se), &r, Some(&r_se)).unwrap();
        missed += u32::from((bias - TRUE_BIAS).abs() > half);
    }
    // Binomial(2000, 0.01): mean 20, standard deviation 4.45; outside 5..=42 by chance less than
    // once in 10⁵ runs.
    assert!((5..=42).contains(&missed), "{missed} of {TRIALS} intervals miss the true bias");
}

/// Returns a reference picture of `../shared`, beside the project.
fn reference(name: &str) -> Picture {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../../shared/reference");
    Picture::read(folder.join(name)).unwrap()
}

#[test]
#[ignore = "needs ../shared"]
fn reference_pictures_measure_as_with_compare_py() {
    let pairs = [
        (
            ("cornell_direct.pfm", "cornell.pfm"),
            [
                0.27026309538098486,
                0.26963965280573554,
                1.185228671710471,
                10.931453004734513,
                -0.5044233107254601,
                -0.18700524766749016,
                1.0,
                0.94219970703125,
            ],
        ),
        (
            ("cabin_bed.pfm", "cabin.pfm"),
            [
                5.8630687150658005,
                5.7119708178837545,
                0.5990796823579929,
                11.07828704318272,
                1.1293183542255414,
                -0.7097363404529442,
                9.918064581928565,
                0.883984375,
            ],
        ),
    ];
    for ((name, reference_name), wanted) in pairs {
        assert_equal(compare(&reference(name), &reference(reference_name)).unwrap(), wanted);
    }
}
