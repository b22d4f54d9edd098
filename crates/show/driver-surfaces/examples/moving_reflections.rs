//! Measures shiny objects while the eye moves, without their reflection cubes and with them.
//!
//! `moving_reflections near.obj SAMPLES [OUT]` takes the scene `near` of `holo-scenes reflections`:
//! a ball in a lit room. The ball becomes chrome, brass of several roughnesses, and glass in turn.
//! A section around the room gets the samples, and a view at rest is drawn from them. The eye then
//! moves to other places. Cubes are filled between frames, so the frames before have none. For each
//! material it prints processor time of a frame and the PSNR of the ball's pixels against traced
//! ones, with three times the ball's mean as white. It writes the last frames as
//! OUT-MATERIAL-*.png.

#![allow(clippy::unwrap_used, clippy::panic)]

#[path = "../../display/tests/common/viewer.rs"]
mod viewer;

use glam::DVec3;
use holo_display::{FrameRequest, split_mix};
use holo_driver_surfaces::surfaces_driver;
use holo_picture::{Picture, View};
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Scene, ShinyObjects};
use holo_section::{BeamId, BeamKey, RayCoords, Sample, Section, SectionSpec, ViewClass};
use holo_tracer::{Settings, Tracer};
use std::sync::Arc;
use std::time::Instant;
use viewer::TestViewer;

const SIZE: (u32, u32) = (480, 360);

/// Frames of a motion.
const FRAMES: u32 = 8;

/// Paths of a pixel of the truth.
const TRUTH: u32 = 64;

fn section() -> Section {
    Section::new(SectionSpec {
        origin: [-4.4; 3],
        axes: [[8.8, 0.0, 0.0], [0.0, 8.8, 0.0], [0.0, 0.0, 8.8]],
        grid: [8; 3],
        class: ViewClass::Interior,
        obstructions: false,
    })
    .unwrap()
}

/// Returns the eye after so many steps of a motion around the ball.
fn eye(step: f64, size: (u32, u32)) -> View {
    let (sin, cos) = (0.06 * step).sin_cos();
    let at = DVec3::new(-3.2 * sin, -3.2 * cos, 0.6);
    View::new(at, -at, DVec3::Z, Some(50.0), None, size).unwrap()
}

/// Traces samples of the section, on all cores.
fn samples(section: &Section, tracer: &Tracer, count: u64) -> Vec<(BeamKey, Sample)> {
    let sample = |number: u64| {
        let random = split_mix(number + 1);
        let beam = BeamId(random % section.beam_count());
        let coords = RayCoords(((random >> 32) as u32).to_le_bytes());
        let ray = section.ray(section.cells(beam)?, coords);
        let traced = tracer.trace(ray.origin, ray.direction, random);
        let diagonal = section.diagonal();
        let sample = Sample::encode(coords, traced.radiance, traced.distance, diagonal, 0);
        Some((BeamKey { section: 0, beam }, sample))
    };
    let half = |part: u64| (0..count).filter(|n| n % 2 == part).filter_map(sample).collect();
    std::thread::scope(|scope| {
        let other = scope.spawn(|| -> Vec<_> { half(1) });
        let mut all: Vec<_> = half(0);
        all.extend(other.join().unwrap());
        all
    })
}

fn seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

fn luminance([r, g, b]: [f32; 3]) -> f64 {
    0.2126 * f64::from(r) + 0.7152 * f64::from(g) + 0.0722 * f64::from(b)
}

/// What is seen of a ball.
struct Truth {
    pixels: Vec<usize>,
    light: Vec<f64>,
    white: f64,
}

impl Truth {
    fn new(tracer: &Tracer, shiny: &ShinyObjects, view: &View) -> Truth {
        let raycaster = tracer.raycaster();
        let ray = |pixel: usize, x: f64, y: f64| {
            let (column, row) = (pixel % SIZE.0 as usize, pixel / SIZE.0 as usize);
            let at = (column as f64 + x) / f64::from(SIZE.0);
            view.ray(at, 1.0 - (row as f64 + y) / f64::from(SIZE.1))
        };
        let is_ball = |pixel: &usize| {
            let corners = [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)];
            corners.iter().all(|&(x, y)| {
                let (origin, direction) = ray(*pixel, x, y);
                let hit = raycaster
                    .localize(origin, direction)
                    .and_then(|(ray, _)| raycaster.nearest(&ray));
                hit.is_some_and(|hit| shiny.of(hit.triangle).is_some())
            })
        };
        let pixels: Vec<usize> = (0..(SIZE.0 * SIZE.1) as usize).filter(is_ball).collect();
        let traced = |pixel: &usize| {
            let path = |path: u32| {
                let (x, y) = (f64::from(path % 8), f64::from(path / 8 % 8));
                let (origin, direction) = ray(*pixel, (x + 0.5) / 8.0, (y + 0.5) / 8.0);
                let seed = split_mix((*pixel as u64) << 20 | u64::from(path));
                luminance(tracer.trace(origin, direction, seed).radiance)
            };
            (0..TRUTH).map(path).sum::<f64>() / f64::from(TRUTH)
        };
        let (one, other) = pixels.split_at(pixels.len() / 2);
        let mut light: Vec<f64> = Vec::new();
        std::thread::scope(|scope| {
            let rest = scope.spawn(|| other.iter().map(traced).collect::<Vec<_>>());
            light.extend(one.iter().map(traced));
            light.extend(rest.join().unwrap());
        });
        let white = 3.0 * light.iter().sum::<f64>() / light.len().max(1) as f64;
        Truth { pixels, light, white }
    }

    /// Returns the PSNR of the ball's pixels, dB.
    fn psnr(&self, shown: &Picture) -> f64 {
        let seen = |light: f64| light.min(self.white);
        let square = |(pixel, truth): (&usize, &f64)| {
            (seen(luminance(shown.pixels[*pixel])) - seen(*truth)).powi(2)
        };
        let sum: f64 = self.pixels.iter().zip(&self.light).map(square).sum();
        20.0 * (self.white / (sum / self.pixels.len() as f64).sqrt()).log10()
    }
}

fn save(picture: &Picture, white: f64, path: &str) {
    let byte = |c: f32| (255.0 * (f64::from(c) / white).clamp(0.0, 1.0).powf(1.0 / 2.2)) as u8;
    let bytes = picture.pixels.iter().flat_map(|rgb| rgb.map(byte)).collect();
    image::RgbImage::from_raw(SIZE.0, SIZE.1, bytes).unwrap().save(path).unwrap();
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let [_, scene, count, rest @ ..] = &args[..] else { panic!("see the source") };
    let count: u64 = count.parse().unwrap();
    let ks = [0.9, 0.7, 0.4];
    let materials = [
        ("chrome", Bsdf::Mirror { ks: [0.9; 3] }),
        ("brass-0.1", Bsdf::Conductor { ks, alpha: 0.1 }),
        ("brass-0.2", Bsdf::Conductor { ks, alpha: 0.2 }),
        ("brass-0.4", Bsdf::Conductor { ks, alpha: 0.4 }),
        ("glass", Bsdf::Dielectric { ior: 1.5, transmittance: [1.0; 3], alpha: 0.0 }),
    ];
    let loaded: Scene = holo_scene::load(scene.as_ref(), &Default::default()).unwrap().scene;
    for (name, bsdf) in materials {
        let mut scene = loaded.clone();
        for material in &mut scene.materials {
            if matches!(material.bsdf, Bsdf::Mirror { .. }) {
                material.bsdf = bsdf;
            }
        }
        let shiny = ShinyObjects::find(&scene).unwrap();
        let raycaster = Arc::new(Raycaster::build(Arc::new(scene)).unwrap());
        let tracer = Tracer::with_raycaster(Arc::clone(&raycaster), Settings::default()).unwrap();
        let section = section();
        let traced = samples(&section, &tracer, count);
        let sections: Arc<[Section]> = Arc::from([section]);
        let mut driver = TestViewer::new(surfaces_driver(sections, raycaster, None));
        for (beam, sample) in &traced {
            driver.insert(*beam, 1, &[*sample]);
        }
        let look =
            |step: f64, is_moving| FrameRequest { view: eye(step, SIZE), size: SIZE, is_moving };
        driver.look(&look(0.0, false)).unwrap();
        driver.settle();
        _ = driver.draw();
        let last = f64::from(FRAMES);
        let truth = Truth::new(&tracer, &shiny, &eye(last, SIZE));
        for with in [false, true] {
            let mut filling = 0.0;
            for step in 1..=FRAMES {
                driver.look(&look(f64::from(step), true)).unwrap();
                let start = Instant::now();
                while with && driver.renderer.prepare(holo_display::FramePhase::Moving) {}
                filling += start.elapsed().as_secs_f64();
                _ = driver.draw();
            }
            // The last view again, whose cubes are as full as they get.
            let start = seconds();
            driver.look(&look(last, true)).unwrap();
            let looked = seconds();
            let frame = driver.draw().picture;
            let drawn = seconds();
            driver.look(&look(last, false)).unwrap();
            let first = driver.draw().picture;
            println!(
                "{name}, {} cubes: look {:.1} ms, draw {:.1} ms, moving {:.1} dB, first at rest \
                 {:.1} dB, filling {:.0} ms",
                if with { "with" } else { "without" },
                1e3 * (looked - start),
                1e3 * (drawn - looked),
                truth.psnr(&frame),
                truth.psnr(&first),
                1e3 * filling,
            );
            if let Some(out) = rest.first() {
                let with = if with { "with" } else { "without" };
                save(&frame, truth.white, &format!("{out}-{name}-moving-{with}.png"));
                save(&first, truth.white, &format!("{out}-{name}-first-{with}.png"));
            }
        }
        driver.settle();
        while driver.renderer.prepare(holo_display::FramePhase::Rest) {}
        println!("{name}, at rest: {:.1} dB", truth.psnr(&driver.draw().picture));
    }
}
