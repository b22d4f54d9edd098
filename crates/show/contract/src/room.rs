//! A room with a mirror, a pane, a coat, a texture, a cover, a lamp and a window, and samples of
//! it.

use glam::DVec3;
use holo_display::{LiveSample, split_mix};
use holo_picture::{View, ViewSpec};
use holo_raycast::{Ray, Raycaster};
use holo_scene::{Bsdf, LoadOptions};
use holo_section::{BeamId, BeamKey, RayCoords, Sample, Section, SectionSpec, ViewClass};
use std::path::Path;
use std::sync::Arc;

/// Radiance of rays that hit nothing.
const SKY: [f32; 3] = [0.6, 0.8, 1.2];

/// Materials of the room. `checks.png` lies beside them.
const MATERIALS: &str = "newmtl wall\nKd 0.7 0.6 0.5\n\
    newmtl floor\nKd 0.8 0.8 0.8\nmap_Kd checks.png\n\
    newmtl mirror\nKs 0.9 0.9 0.9\nillum 3\n\
    newmtl pane\nillum 4\nNi 1.5\nTf 0.9 0.95 0.9\n\
    newmtl coat\nKd 0.2 0.4 0.1\nPr 0.3\n\
    newmtl metal\nKd 0.8 0.7 0.4\nPm 1\nPr 0.5\n\
    newmtl veil\nKd 0.9 0.9 0.9\nd 0.5\n\
    newmtl lamp\nKd 0 0 0\nKe 6 6 5\n";

/// Most mirrors and panes that a sample's ray follows.
const MOST_TURNS: u32 = 3;

/// A ray that is stored: its beam and its sample.
pub type RoomSample = (BeamKey, Sample);

/// The room, its sections, and the geometry that stands in for it.
pub struct TestRoom {
    /// The sections: one in the room, and a small one at its window.
    pub sections: Arc<[Section]>,
    /// The scene.
    pub raycaster: Arc<Raycaster>,
    /// Simpler geometry without what stands in the room, and without the wall with the mirror.
    pub simple: Arc<Raycaster>,
    /// An invisible surface before that wall.
    pub portal: Arc<Raycaster>,
}

/// Corners of a quadrilateral, with its material.
type Quad = (&'static str, [[f64; 3]; 4]);

/// The room: 6 × 5 × 3, with a window in the wall at x = 6. The floor comes first.
const SHELL: [Quad; 8] = [
    ("floor", [[0.0, 0.0, 0.0], [6.0, 0.0, 0.0], [6.0, 5.0, 0.0], [0.0, 5.0, 0.0]]),
    ("wall", [[0.0, 0.0, 3.0], [0.0, 5.0, 3.0], [6.0, 5.0, 3.0], [6.0, 0.0, 3.0]]),
    ("wall", [[0.0, 0.0, 0.0], [0.0, 0.0, 3.0], [6.0, 0.0, 3.0], [6.0, 0.0, 0.0]]),
    ("wall", [[0.0, 0.0, 0.0], [0.0, 5.0, 0.0], [0.0, 5.0, 3.0], [0.0, 0.0, 3.0]]),
    ("wall", [[6.0, 0.0, 0.0], [6.0, 0.0, 3.0], [6.0, 1.5, 3.0], [6.0, 1.5, 0.0]]),
    ("wall", [[6.0, 3.5, 0.0], [6.0, 3.5, 3.0], [6.0, 5.0, 3.0], [6.0, 5.0, 0.0]]),
    ("wall", [[6.0, 1.5, 0.0], [6.0, 1.5, 1.0], [6.0, 3.5, 1.0], [6.0, 3.5, 0.0]]),
    ("lamp", [[2.5, 2.0, 2.9], [2.5, 3.0, 2.9], [3.5, 3.0, 2.9], [3.5, 2.0, 2.9]]),
];

/// The wall at y = 5 and its mirror.
const FAR_WALL: [Quad; 2] = [
    ("wall", [[0.0, 5.0, 0.0], [6.0, 5.0, 0.0], [6.0, 5.0, 3.0], [0.0, 5.0, 3.0]]),
    ("mirror", [[2.0, 4.98, 0.8], [4.0, 4.98, 0.8], [4.0, 4.98, 2.4], [2.0, 4.98, 2.4]]),
];

/// What stands in the room.
const FURNITURE: [Quad; 6] = [
    ("pane", [[4.2, 1.2, 0.0], [4.2, 3.8, 0.0], [4.2, 3.8, 2.0], [4.2, 1.2, 2.0]]),
    ("veil", [[0.8, 4.0, 0.2], [1.8, 4.3, 0.2], [1.8, 4.3, 1.9], [0.8, 4.0, 1.9]]),
    ("coat", [[2.2, 3.2, 0.6], [3.4, 3.2, 0.6], [3.4, 4.2, 0.6], [2.2, 4.2, 0.6]]),
    ("coat", [[2.2, 3.2, 0.0], [3.4, 3.2, 0.0], [3.4, 3.2, 0.6], [2.2, 3.2, 0.6]]),
    ("metal", [[4.6, 4.0, 0.0], [5.4, 4.4, 0.0], [5.4, 4.4, 1.2], [4.6, 4.0, 1.2]]),
    ("wall", [[0.3, 2.4, 0.0], [0.9, 2.4, 0.0], [0.9, 2.4, 1.4], [0.3, 2.4, 1.4]]),
];

const PORTAL: [Quad; 1] =
    [("wall", [[0.0, 4.9, 0.0], [6.0, 4.9, 0.0], [6.0, 4.9, 3.0], [0.0, 4.9, 3.0]])];

/// Writes faces as an OBJ file and loads it.
fn load(folder: &Path, name: &str, faces: &[Quad]) -> Arc<Raycaster> {
    let mut obj = String::from("mtllib room.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n");
    for (number, (material, corners)) in faces.iter().enumerate() {
        for [x, y, z] in corners {
            obj.push_str(&format!("v {x} {y} {z}\n"));
        }
        let corner = |at: usize| format!("{}/{at}", 4 * number + at);
        let corners = [1, 2, 3, 4].map(corner).join(" ");
        obj.push_str(&format!("usemtl {material}\nf {corners}\n"));
    }
    let path = folder.join(name);
    std::fs::write(&path, obj).unwrap();
    let options = LoadOptions { sky: SKY, ..LoadOptions::default() };
    let scene = holo_scene::load(&path, &options).unwrap().scene;
    Arc::new(Raycaster::build(Arc::new(scene)).unwrap())
}

fn section(origin: [f64; 3], sides: [f64; 3], grid: u32) -> Section {
    let [x, y, z] = sides;
    let axes = [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]];
    let class = ViewClass::Interior;
    Section::new(SectionSpec { origin, axes, grid: [grid; 3], class, obstructions: true }).unwrap()
}

/// Returns a number in [0, 1) from random bits.
fn unit(bits: u64) -> f64 {
    (bits >> 11) as f64 / (1_u64 << 53) as f64
}

/// Light at a point, before reflection.
fn light(at: DVec3) -> f32 {
    let from_lamp = (at - DVec3::new(3.0, 2.5, 2.9)).length_squared();
    let shadow = if (at.x - 1.5).abs() < 0.4 && at.z < 1.0 { 0.4 } else { 1.0 };
    (shadow * (0.3 + 2.0 / (1.0 + from_lamp))) as f32
}

impl Default for TestRoom {
    fn default() -> TestRoom {
        TestRoom::new()
    }
}

impl TestRoom {
    /// Builds the room. Takes some milliseconds.
    #[must_use]
    pub fn new() -> TestRoom {
        let folder = tempfile::tempdir().unwrap();
        let square = |x: u32, y: u32| if (x / 4 + y / 4).is_multiple_of(2) { 90 } else { 240 };
        let checks = image::GrayImage::from_fn(64, 64, |x, y| image::Luma([square(x, y)]));
        checks.save(folder.path().join("checks.png")).unwrap();
        std::fs::write(folder.path().join("room.mtl"), MATERIALS).unwrap();
        let all: Vec<Quad> = [&SHELL[..], &FAR_WALL, &FURNITURE].concat();
        TestRoom {
            sections: Arc::from([
                section([0.5, 0.5, 0.3], [5.0, 4.0, 2.4], 6),
                section([5.2, 1.6, 1.0], [0.7, 1.8, 1.8], 2),
            ]),
            raycaster: load(folder.path(), "room.obj", &all),
            simple: load(folder.path(), "simple.obj", &SHELL),
            portal: load(folder.path(), "portal.obj", &PORTAL),
        }
    }

    /// Radiance of rays that hit nothing.
    #[must_use]
    pub fn sky(&self) -> [f32; 3] {
        SKY
    }

    /// Returns a view by Radiance's options.
    #[must_use]
    pub fn view(&self, options: &str, size: (u32, u32)) -> View {
        let mut spec = ViewSpec::default();
        spec.apply_line(options).unwrap();
        spec.resolve(size).unwrap().0
    }

    /// Returns the radiance that a ray brings and the distance to what it hits first.
    fn radiance(&self, origin: DVec3, direction: DVec3, turns: u32) -> ([f32; 3], f64) {
        let nothing = (SKY, f64::INFINITY);
        let Some((ray, skipped)) = self.raycaster.localize(origin, direction) else {
            return nothing;
        };
        let Some(hit) = self.raycaster.nearest(&ray) else { return nothing };
        let scene = self.raycaster.scene();
        let distance = f64::from(hit.t) + skipped;
        let at = origin + direction * distance;
        let material = scene.material(hit.triangle);
        let reflectance = scene.reflectance(hit.triangle, hit.u, hit.v, 0.0);
        let normal = scene.normal(hit.triangle).as_dvec3().normalize();
        let turned = direction - 2.0 * direction.dot(normal) * normal;
        let beyond = |direction: DVec3| match turns {
            0 => SKY,
            _ => self.radiance(at + direction * 1e-4, direction, turns - 1).0,
        };
        let diffuse = reflectance.map(|kd| kd * light(at));
        let shown = match material.bsdf {
            Bsdf::Diffuse { .. } => diffuse,
            Bsdf::Mirror { .. } | Bsdf::Conductor { .. } => {
                let mirrored = beyond(turned);
                [0, 1, 2].map(|c| reflectance[c] * mirrored[c])
            }
            Bsdf::ThinGlass { .. } | Bsdf::Dielectric { .. } => {
                let (passed, mirrored) = (beyond(direction), beyond(turned));
                [0, 1, 2].map(|c| 0.85 * passed[c] + 0.08 * mirrored[c])
            }
            Bsdf::Coated { .. } => {
                let mirrored = beyond(turned);
                [0, 1, 2].map(|c| diffuse[c] + 0.04 * mirrored[c])
            }
        };
        ([0, 1, 2].map(|c| shown[c] + material.emission[c]), distance)
    }

    /// Returns a stored ray's sample with noise, which `bits` determine.
    fn sample(&self, section: u16, beam: BeamId, coords: RayCoords, bits: u64) -> RoomSample {
        let of = &self.sections[usize::from(section)];
        let ray = of.ray(of.cells(beam).unwrap(), coords);
        let (radiance, distance) = self.radiance(ray.origin, ray.direction, MOST_TURNS);
        let noise = (0.5 + unit(bits)) as f32;
        let dither = split_mix(bits) as u32;
        let radiance = radiance.map(|c| c * noise);
        let sample = Sample::encode(coords, radiance, distance, of.diagonal(), dither);
        (BeamKey { section, beam }, sample)
    }

    /// Returns samples of random rays of all sections.
    #[must_use]
    pub fn samples(&self, count: u64, seed: u64) -> Vec<RoomSample> {
        let sample = |number: u64| {
            let bits = split_mix(seed << 32 | number);
            let section = u16::from(number.is_multiple_of(8));
            let beam = BeamId(bits % self.sections[usize::from(section)].beam_count());
            let coords = RayCoords((split_mix(bits) as u32).to_le_bytes());
            self.sample(section, beam, coords, split_mix(bits ^ 1))
        };
        (0..count).map(sample).collect()
    }

    /// Returns samples of rays through random points of a view's picture.
    #[must_use]
    pub fn samples_of_view(&self, view: &View, count: u64, seed: u64) -> Vec<RoomSample> {
        let sample = |number: u64| {
            let bits = split_mix(seed << 32 | number);
            let (eye, direction) = view.ray(unit(bits), unit(split_mix(bits)));
            let hit = self.sections[0].line(eye, direction)?;
            let beam = self.sections[0].beam(hit.pair);
            Some(self.sample(0, beam, hit.coords, split_mix(bits ^ 1)))
        };
        (0..count).filter_map(sample).collect()
    }

    /// Returns samples along the same rays, this many times as bright.
    #[must_use]
    pub fn brighter(&self, samples: &[RoomSample], factor: f32) -> Vec<RoomSample> {
        let brighter = |&(key, sample): &RoomSample| {
            let diagonal = self.sections[usize::from(key.section)].diagonal();
            let radiance = sample.rgb().map(|c| c * factor);
            let distance = sample.distance(diagonal);
            (key, Sample::encode(sample.coords, radiance, distance, diagonal, 0))
        };
        samples.iter().map(brighter).collect()
    }

    /// Returns a ray through the middle of each of these pixels of a view.
    #[must_use]
    pub fn live(&self, view: &View, size: (u32, u32), pixels: &[u32]) -> Vec<LiveSample> {
        let ray = |&pixel: &u32| {
            let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
            let (origin, direction) = view.try_ray(x, y)?;
            let (radiance, distance) = self.radiance(origin, direction, MOST_TURNS);
            Some(LiveSample { origin, direction, radiance, distance })
        };
        pixels.iter().filter_map(ray).collect()
    }

    /// Returns the beams whose rays hit nothing. 64 rays of each beam are tried.
    #[must_use]
    pub fn unseen(&self) -> Vec<BeamKey> {
        let section = &self.sections[1];
        let misses = |beam: &BeamId| {
            let pair = section.cells(*beam).unwrap();
            let mut coords = (0..64).map(|n| RayCoords((split_mix(n) as u32).to_le_bytes()));
            coords.all(|coords| {
                let ray = section.ray(pair, coords);
                let local = self.raycaster.localize(ray.origin, ray.direction);
                local.is_none_or(|(ray, _): (Ray, f64)| self.raycaster.nearest(&ray).is_none())
            })
        };
        let beams = (0..section.beam_count()).map(BeamId).filter(misses);
        beams.map(|beam| BeamKey { section: 1, beam }).collect()
    }
}
