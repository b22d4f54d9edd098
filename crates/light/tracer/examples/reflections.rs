//! Measures cached reflections as Ruff, Clua and Fernandes 2013 did, on a scene of `holo-scenes
//! reflections`. Pictures have one path per pixel, direct light, and perfect mirrors. The eye is at
//! (0, -4, 0) and looks at zero. It moves around zero to fill the cubes.
//!
//! `reflections SCENE.obj WHAT SIDE TEXELS [parallax] [unmarked] [PICTURE.png]` prints a line of
//! JSON. SIDE is the picture's side in pixels. WHAT is
//! - `times`: processor time of a frame without cubes, with filled ones, and of its first hits, ms;
//! - `fills`: the share of invalid texels of the cubes before each of nine steps of 10/3 degrees,
//!   and after the last;
//! - `errors`: in pixels of mirrors, relative root mean square error of luminance, share of pixels
//!   that are more than a tenth off, and PSNR, after the cubes were filled from all around. Here
//!   walls shine by themselves, so that pictures have no noise.
//!
//! `unmarked` lets rays that meet their own object use the cube, as in the paper.

use std::error::Error;
use std::sync::Arc;

use glam::DVec3;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, ShinyObjects};
use holo_tracer::{ReflectionSettings, Settings, Tracer};

/// Distance of the eye from zero.
const AWAY: f64 = 4.0;
/// Half of the picture's field of view, degrees.
const HALF_FIELD: f64 = 22.0;
/// A step of the eye, degrees.
const STEP: f64 = 10.0 / 3.0;
/// Steps that fill the cubes from all around.
const ALL_AROUND: u32 = 36;
/// Frames of which the fastest counts.
const FRAMES: u32 = 5;

/// Returns the processor time of this thread, seconds.
fn processor_seconds() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    text.split(' ').next().and_then(|first| first.parse::<f64>().ok()).unwrap_or(0.0) * 1e-9
}

/// The rays of a picture.
struct Eye {
    at: DVec3,
    forward: DVec3,
    right: DVec3,
    up: DVec3,
    side: u32,
}

impl Eye {
    /// An eye turned around zero by so many degrees.
    fn new(degrees: f64, side: u32) -> Eye {
        let (sin, cos) = degrees.to_radians().sin_cos();
        let forward = DVec3::new(-sin, cos, 0.0);
        let right = DVec3::new(cos, sin, 0.0);
        let half = HALF_FIELD.to_radians().tan();
        Eye { at: -AWAY * forward, forward, right: right * half, up: DVec3::Z * half, side }
    }

    fn direction(&self, pixel: u32) -> DVec3 {
        let at = |k: u32| 2.0 * (f64::from(k) + 0.5) / f64::from(self.side) - 1.0;
        let (x, y) = (at(pixel % self.side), -at(pixel / self.side));
        (self.forward + x * self.right + y * self.up).normalize()
    }

    fn pixels(&self) -> std::ops::Range<u32> {
        0..self.side * self.side
    }

    /// Traces a frame.
    fn frame(&self, tracer: &Tracer) -> Vec<[f32; 3]> {
        let trace = |pixel| tracer.trace(self.at, self.direction(pixel), u64::from(pixel)).radiance;
        self.pixels().map(trace).collect()
    }
}

/// Returns the least processor time of some calls, milliseconds.
fn fastest(mut call: impl FnMut()) -> f64 {
    let once = |_| {
        let start = processor_seconds();
        call();
        1e3 * (processor_seconds() - start)
    };
    (0..FRAMES).map(once).fold(f64::INFINITY, f64::min)
}

fn luminance([r, g, b]: [f32; 3]) -> f64 {
    0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
}

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [path, what, side, texels, rest @ ..] = args.as_slice() else {
        return Err("usage: reflections SCENE.obj WHAT SIDE TEXELS [parallax] [unmarked]".into());
    };
    let (side, resolution): (u32, u32) = (side.parse()?, texels.parse()?);
    let has = |word: &str| rest.iter().any(|other| other == word);
    let mut scene = holo_scene::load(path.as_ref(), &Default::default())?.scene;
    if what == "errors" {
        // Walls that shine by themselves have no noise, which would count as error.
        for material in &mut scene.materials {
            if let Bsdf::Diffuse { kd } = material.bsdf {
                (0..3).for_each(|c| material.emission[c] += kd[c]);
                material.bsdf = Bsdf::Diffuse { kd: [0.0; 3] };
                material.two_sided_emission = true;
            }
        }
    }
    let raycaster = Arc::new(Raycaster::build(Arc::new(scene))?);
    let settings = Settings { bounces: Some(0), ..Settings::default() };
    let tracer = || Tracer::with_raycaster(Arc::clone(&raycaster), settings);
    let cached = tracer()?.with_cached_reflections(ReflectionSettings {
        resolution,
        least_paths: 1,
        has_parallax: has("parallax"),
        traces_self_hits: !has("unmarked"),
    });
    let eye = Eye::new(0.0, side);
    match what.as_str() {
        "times" => {
            for step in 0..9 {
                _ = Eye::new(STEP * f64::from(step) - 15.0, side).frame(&cached);
            }
            _ = eye.frame(&cached);
            let exact = tracer()?;
            let first = fastest(|| {
                for pixel in eye.pixels() {
                    let direction = eye.direction(pixel);
                    let hit = raycaster
                        .localize(eye.at, direction)
                        .and_then(|(ray, _)| raycaster.nearest(&ray));
                    std::hint::black_box(hit);
                }
            });
            let standard = fastest(|| _ = std::hint::black_box(eye.frame(&exact)));
            let with = fastest(|| _ = std::hint::black_box(eye.frame(&cached)));
            println!("{{\"standard\": {standard}, \"cached\": {with}, \"first_hits\": {first}}}");
        }
        "fills" => {
            let mut invalid = vec![1.0];
            for step in 0..9 {
                _ = Eye::new(STEP * f64::from(step), side).frame(&cached);
                let report = cached.reflection_report();
                invalid.push(1.0 - report.valid as f64 / report.texels.max(1) as f64);
            }
            println!("{{\"invalid\": {invalid:?}}}");
        }
        "errors" => {
            // None of these views is the one that is measured.
            let step = 360.0 / f64::from(ALL_AROUND);
            for number in 0..ALL_AROUND {
                _ = Eye::new(180.0 + step * (f64::from(number) + 0.5), side).frame(&cached);
            }
            let (truth, shown) = (eye.frame(&tracer()?), eye.frame(&cached));
            let shiny = ShinyObjects::find(raycaster.scene()).ok_or("no shiny object")?;
            let is_mirror = |pixel: &u32| {
                let ray = raycaster.localize(eye.at, eye.direction(*pixel));
                let hit = ray.and_then(|(ray, _)| raycaster.nearest(&ray));
                hit.is_some_and(|hit| shiny.of(hit.triangle).is_some())
            };
            let (mut pixels, mut square, mut sum, mut wrong, mut most) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for pixel in eye.pixels().filter(is_mirror) {
                let [one, other] = [&truth, &shown].map(|all| luminance(all[pixel as usize]));
                pixels += 1.0;
                square += (one - other).powi(2);
                sum += one;
                most = f64::max(most, one);
                wrong += f64::from((one - other).abs() > 0.1 * one.max(1e-3));
            }
            let rms = (square / pixels).sqrt();
            // As a display shows it: what is brighter than three times the mean is white.
            let white = 3.0 * sum / pixels;
            let seen = |all: &[[f32; 3]], pixel: u32| luminance(all[pixel as usize]).min(white);
            let squares: f64 = eye
                .pixels()
                .filter(is_mirror)
                .map(|pixel| (seen(&truth, pixel) - seen(&shown, pixel)).powi(2))
                .sum();
            let psnr = 20.0 * (white / (squares / pixels).sqrt()).log10();
            let (relative, wrong) = (rms / (sum / pixels), wrong / pixels);
            println!("{{\"rms\": {relative}, \"wrong\": {wrong}, \"psnr\": {psnr}}}");
            if let Some(picture) = rest.iter().find(|word| word.ends_with(".png")) {
                let byte =
                    |c: f32| (255.0 * (f64::from(c) / white).clamp(0.0, 1.0).powf(1.0 / 2.2)) as u8;
                let bytes = shown.iter().flat_map(|rgb| rgb.map(byte)).collect();
                image::RgbImage::from_raw(side, side, bytes).ok_or("no picture")?.save(picture)?;
            }
        }
        other => return Err(format!("there is no measurement `{other}`").into()),
    }
    Ok(())
}
