//! Walls of which the light is known in closed form, samples of them, and their true picture.

use crate::common::{self, Random, section, view};
use glam::DVec3;
use holo_display::{Frame, Resolution};
use holo_driver_voronoi::Voronoi;
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};
use holo_section::{BeamId, BeamKey, RayCoords, Sample, Section, ViewClass};
use std::sync::Arc;

pub const SIZE: (u32, u32) = (64, 48);

/// Walls of a scene: four corners and a material each.
pub type Quad = ([[f64; 3]; 4], usize);

pub fn diffuse(kd: [f32; 3]) -> Material {
    Material { bsdf: Bsdf::Diffuse { kd }, ..Material::grey("wall") }
}

pub fn raycaster(quads: &[Quad], materials: Vec<Material>) -> Arc<Raycaster> {
    let positions: Vec<DVec3> =
        quads.iter().flat_map(|(corners, _)| corners.map(DVec3::from_array)).collect();
    let triangles: Vec<[u32; 3]> = (0..quads.len() as u32)
        .flat_map(|quad| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|k| 4 * quad + k)))
        .collect();
    let ids: Vec<u32> = quads.iter().flat_map(|&(_, material)| [material as u32; 2]).collect();
    let (scene, _) = Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).unwrap();
    Arc::new(Raycaster::build(Arc::new(scene)).unwrap())
}

/// A wall across x at `at`, from `low` to `high` in y and z.
pub fn wall(at: f64, low: [f64; 2], high: [f64; 2], material: usize) -> Quad {
    (
        [
            [at, low[0], low[1]],
            [at, high[0], low[1]],
            [at, high[0], high[1]],
            [at, low[0], high[1]],
        ],
        material,
    )
}

/// Radiance of a point of a surface.
pub type Light = fn(DVec3, &Material) -> [f32; 3];

pub fn kd(material: &Material) -> [f32; 3] {
    match material.bsdf {
        Bsdf::Diffuse { kd } => kd,
        _ => [0.0; 3],
    }
}

/// Any rays of the section, all over, with the light that they meet. Mirrors show what they reflect.
pub fn samples(
    section: &Section,
    raycaster: &Raycaster,
    light: Light,
    count: usize,
    noise: common::Noise,
) -> Vec<(BeamId, Sample)> {
    let mut random = Random(7);
    (0..count)
        .filter_map(|_| {
            let beam = BeamId(random.bits() % section.beam_count());
            let coords = RayCoords((random.bits() as u32).to_le_bytes());
            let ray = section.ray(section.cells(beam)?, coords);
            let (distance, colour) = shine(raycaster, ray.origin, ray.direction, light)?;
            let factor = noise(&mut random);
            let rgb = colour.map(|channel| channel * factor);
            Some((
                beam,
                Sample::encode(coords, rgb, distance, section.diagonal(), random.bits() as u32),
            ))
        })
        .collect()
}

/// Distance of what a ray meets, and its light.
pub fn shine(
    raycaster: &Raycaster,
    origin: DVec3,
    direction: DVec3,
    light: Light,
) -> Option<(f64, [f32; 3])> {
    let (ray, skipped) = raycaster.localize(origin, direction)?;
    let hit = raycaster.nearest(&ray)?;
    let material = raycaster.scene().material(hit.triangle);
    let distance = f64::from(hit.t) + skipped;
    let at = origin + direction * distance;
    let colour = match material.bsdf {
        Bsdf::Mirror { ks } => {
            let normal = raycaster.geometric_normal(hit.triangle).as_dvec3();
            let mirrored = direction - 2.0 * direction.dot(normal) * normal;
            let (_, colour) = shine(raycaster, at + mirrored * 1e-6, mirrored, light)?;
            [0, 1, 2].map(|channel| colour[channel] * ks[channel])
        }
        // A lobe about a direction of its own, as of a lamp far away.
        Bsdf::Conductor { .. } => {
            let towards = DVec3::new(0.95, 0.25, 0.1).normalize();
            let gleam = 0.1 + 0.8 * (-40.0 * (1.0 - direction.dot(towards))).exp() as f32;
            [gleam; 3]
        }
        _ => light(at, material),
    };
    Some((distance, colour))
}

pub struct Stage {
    pub section: Section,
    pub raycaster: Arc<Raycaster>,
    pub view: View,
}

impl Stage {
    pub fn new(quads: &[Quad], materials: Vec<Material>) -> Stage {
        Stage {
            section: section([0.0; 3], [4.0; 3], [6; 3], ViewClass::Interior, true),
            raycaster: raycaster(quads, materials),
            view: view([0.5, 2.03, 2.01], [8.0, 2.1, 2.05], 50.0, SIZE),
        }
    }

    pub fn empty(&self) -> Voronoi {
        Voronoi::new(
            Arc::from([self.section.clone()]),
            Arc::clone(&self.raycaster),
            self.view,
            SIZE,
        )
    }

    /// A canvas of another size, or resolution.
    pub fn sized(&self, size: (u32, u32), resolution: Resolution) -> Voronoi {
        let view =
            View::new(self.view.vp, self.view.vd, self.view.vu, Some(50.0), None, size).unwrap();
        let sections = Arc::from([self.section.clone()]);
        Voronoi::at_resolution(sections, Arc::clone(&self.raycaster), None, view, size, resolution)
    }

    pub fn draw(&self, samples: &[(BeamId, Sample)]) -> Frame {
        let mut canvas = self.empty();
        samples.iter().for_each(|(beam, sample)| {
            canvas.insert(BeamKey { section: 0, beam: *beam }, 1, std::slice::from_ref(sample))
        });
        canvas.draw()
    }

    pub fn samples(
        &self,
        light: Light,
        count: usize,
        noise: common::Noise,
    ) -> Vec<(BeamId, Sample)> {
        samples(&self.section, &self.raycaster, light, count, noise)
    }

    /// Each pixel the mean of 16 × 16 rays.
    pub fn truth(&self, light: Light) -> Vec<[f32; 3]> {
        let side = 16;
        let pixel = |column: u32, row: u32| {
            let mut sum = [0.0_f64; 3];
            for part in 0..side * side {
                let x = f64::from(column) + (f64::from(part % side) + 0.5) / f64::from(side);
                let y = f64::from(row) + (f64::from(part / side) + 0.5) / f64::from(side);
                let (eye, along) =
                    self.view.ray(x / f64::from(SIZE.0), 1.0 - y / f64::from(SIZE.1));
                let colour = shine(&self.raycaster, eye, along, light)
                    .map_or([0.0; 3], |(_, colour)| colour);
                (0..3).for_each(|channel| sum[channel] += f64::from(colour[channel]));
            }
            sum.map(|channel| (channel / f64::from(side * side)) as f32)
        };
        (0..SIZE.1).flat_map(|row| (0..SIZE.0).map(move |column| pixel(column, row))).collect()
    }
}

/// Largest and root mean square error of green.
pub fn error(drawn: &Frame, truth: &[[f32; 3]]) -> (f32, f32) {
    let errors: Vec<f32> =
        drawn.picture.pixels.iter().zip(truth).map(|(a, b)| (a[1] - b[1]).abs()).collect();
    let square: f32 = errors.iter().map(|error| error * error).sum();
    (errors.iter().fold(0.0, |most, error| error.max(most)), (square / errors.len() as f32).sqrt())
}

pub fn even(_: DVec3, material: &Material) -> [f32; 3] {
    kd(material)
}

pub fn shadow(at: DVec3, material: &Material) -> [f32; 3] {
    kd(material).map(|channel| channel * if at.y + 0.3 * at.z > 2.7 { 1.0 } else { 0.25 })
}

pub fn bright(_: DVec3, material: &Material) -> [f32; 3] {
    kd(material).map(|channel| 3.0 * channel)
}

/// A near plate before a far wall, both evenly lit.
pub fn plate() -> Stage {
    let quads = [wall(8.0, [-8.0, -8.0], [12.0, 12.0], 0), wall(5.0, [1.2, 1.4], [2.4, 3.1], 1)];
    Stage::new(&quads, vec![diffuse([0.2, 0.7, 0.2]), diffuse([0.1, 0.05, 0.6])])
}

pub fn bits(drawn: &Frame) -> Vec<[u32; 3]> {
    drawn.picture.pixels.iter().map(|pixel| pixel.map(f32::to_bits)).collect()
}
