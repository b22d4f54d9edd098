//! Pictures agree with those of an independent path tracer, by z-tests over blocks of pixels.
//!
//! Each z-test uses the standard errors of both sides. Scenes and pictures lie in `../shared`,
//! beside the project.
//!
//! The cabin's reference is 0.4 % too bright where its flood lamps shine: its renderer loses the
//! shadow of the rims of their housings. `housing.rs` tests that this tracer does not. The paths
//! traced here are too few to show that difference.

#![allow(clippy::expect_used, clippy::panic, reason = "tests fail by them")]

use std::f64::consts::FRAC_PI_3;
use std::path::{Path, PathBuf};

use glam::DVec3;
use holo_tracer::{Sampler, Settings, Tracer};

/// Blocks across a picture; large enough for the means to be normal.
const BLOCKS: usize = 8;

struct Pfm {
    width: usize,
    height: usize,
    /// Rows from the bottom.
    pixels: Vec<[f32; 3]>,
}

fn pfm(path: &Path) -> Pfm {
    let bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    let mut at = 0;
    let mut word = || {
        let end = at + bytes[at..].iter().position(u8::is_ascii_whitespace).expect("a header");
        let word = std::str::from_utf8(&bytes[at..end]).expect("text").to_owned();
        at = end + 1;
        word
    };
    assert_eq!(word(), "PF");
    let (width, height): (usize, usize) =
        (word().parse().expect("width"), word().parse().expect("height"));
    assert!(word().starts_with('-'), "little-endian");
    let floats: Vec<f32> =
        bytes[at..].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    let pixels: Vec<[f32; 3]> = floats.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    assert_eq!(pixels.len(), width * height);
    Pfm { width, height, pixels }
}

struct View {
    eye: [f64; 3],
    towards: [f64; 3],
    up: [f64; 3],
    /// Distance between traced pixels, in both directions.
    stride: usize,
    /// Paths per traced pixel.
    paths: u64,
    /// Paths per pixel of the reference.
    reference_paths: f64,
}

#[derive(Clone, Copy, Default)]
struct Block {
    difference: f64,
    variance: f64,
    pixels: f64,
}

fn compare(scene: &str, picture: &str, bounces: Option<u32>, view: &View) {
    let shared: PathBuf =
        [env!("CARGO_MANIFEST_DIR"), "..", "..", "..", "..", "shared"].iter().collect();
    let obj = shared.join("scenes").join(scene).join(format!("{scene}.obj"));
    let reference = shared.join("reference").join(format!("{picture}.pfm"));
    let errors = shared.join("reference").join(format!("{picture}_se.pfm"));
    let (reference, errors) = (pfm(&reference), pfm(&errors));
    let loaded = holo_scene::load(&obj, &Default::default()).expect("a scene");
    let tracer =
        Tracer::new(loaded.scene.into(), Settings { bounces, paths: 1 }).expect("a tracer");
    let (width, height) = (reference.width, reference.height);
    let eye = DVec3::from_array(view.eye);
    let forward = DVec3::from_array(view.towards).normalize();
    let right = forward.cross(view.up.into()).normalize();
    let up = right.cross(forward);
    let half_width = (FRAC_PI_3 / 2.0).tan();
    let half_height = half_width * height as f64 / width as f64;
    let mut blocks = vec![[Block::default(); 3]; BLOCKS * BLOCKS];
    for y in (0..height).step_by(view.stride) {
        for x in (0..width).step_by(view.stride) {
            let i = y * width + x;
            // The reference found no light here, so its error is unknown.
            if errors.pixels[i] == [0.0; 3] {
                continue;
            }
            let (mut sum, mut squares) = ([0.0; 3], [0.0; 3]);
            for path in 0..view.paths {
                let seed = i as u64 * view.paths + path;
                let [dx, dy] = Sampler::new(!seed, 1).two();
                let (px, py) = (x as f64 + f64::from(dx), y as f64 + f64::from(dy));
                let (sx, sy) = (2.0 * px / width as f64 - 1.0, 2.0 * py / height as f64 - 1.0);
                let direction = forward + right * (sx * half_width) + up * (sy * half_height);
                let radiance = tracer.trace(eye, direction.normalize(), seed).radiance;
                for c in 0..3 {
                    sum[c] += f64::from(radiance[c]);
                    squares[c] += f64::from(radiance[c]).powi(2);
                }
            }
            let n = view.paths as f64;
            let block = &mut blocks[y * BLOCKS / height * BLOCKS + x * BLOCKS / width];
            for c in 0..3 {
                let mean = sum[c] / n;
                block[c].difference += mean - f64::from(reference.pixels[i][c]);
                let own = (squares[c] / n - mean * mean) / (n - 1.0);
                let error = f64::from(errors.pixels[i][c]).powi(2);
                // A lamp in a mirror contributes few bright paths, which our block may have missed.
                // Then its own variance is too small, and that of as many of the reference's paths
                // is used.
                block[c].variance += own.max(error * view.reference_paths / n) + error;
                block[c].pixels += 1.0;
            }
        }
    }
    assert_eq!(tracer.nonfinite_paths(), 0);
    for c in 0..3 {
        let (difference, variance) =
            blocks.iter().fold((0.0, 0.0), |(d, v), b| (d + b[c].difference, v + b[c].variance));
        let mean = difference / blocks.iter().map(|b| b[c].pixels).sum::<f64>();
        let z = difference / variance.sqrt();
        let lit: Vec<Block> = blocks.iter().map(|b| b[c]).filter(|b| b.variance > 0.0).collect();
        assert!(lit.len() > BLOCKS * BLOCKS / 2);
        let chi2: f64 = lit.iter().map(|b| b.difference.powi(2) / b.variance).sum();
        // Wilson and Hilferty 1931.
        let degrees = lit.len() as f64;
        let v = 2.0 / (9.0 * degrees);
        let z_blocks = ((chi2 / degrees).cbrt() - (1.0 - v)) / v.sqrt();
        println!(
            "{picture} channel {c}: mean difference {mean:+.2e} (z {z:+.2}), blocks chi² {chi2:.1} of {degrees} (z {z_blocks:+.2})"
        );
        assert!(z.abs() < 4.5 && z_blocks < 4.5, "{picture} channel {c}: z {z}, blocks {z_blocks}");
    }
}

const CORNELL: View = View {
    eye: [2.78, 2.73, -2.0],
    towards: [0.0, 0.0, 1.0],
    up: [0.0, 1.0, 0.0],
    stride: 2,
    paths: 32,
    reference_paths: 4096.0,
};

#[test]
#[ignore = "needs ../shared"]
fn cornell_box_with_all_its_light() {
    compare("cornell", "cornell", None, &CORNELL);
}

#[test]
#[ignore = "needs ../shared"]
fn cornell_box_with_direct_light() {
    compare("cornell", "cornell_direct", Some(0), &View { reference_paths: 1024.0, ..CORNELL });
}

#[test]
#[ignore = "needs ../shared"]
fn cabin_living_room_with_mirrors_and_windows() {
    let view = View {
        eye: [12.5, 0.5, 5.0],
        towards: [1.0, 1.0, 0.0],
        up: [0.0, 0.0, 1.0],
        stride: 2,
        paths: 32,
        reference_paths: 2048.0,
    };
    compare("cabin", "cabin", None, &view);
}
