//! Simple rooms, and rays in them.

#![allow(dead_code, reason = "each test file uses its own part")]
#![allow(clippy::unwrap_used, reason = "tests")]

use glam::DVec3;
use holo_driver_surfaces::{
    Drawn, Gathered, LightStore, Materials, Placer, RaySample, SurfaceView,
};
use holo_picture::View as Eye;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};
use std::sync::Arc;

/// Returns a store with these rays' samples, and the scene's materials.
pub fn kept(raycaster: &Arc<Raycaster>, rays: &[RaySample]) -> (LightStore, Arc<Materials>) {
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let mut placed = Vec::new();
    Placer::new(raycaster, &materials).place_rays(rays, &mut placed);
    let mut store = LightStore::new(0.001, 64 << 20);
    store.add(&placed);
    (store, materials)
}

/// A floor of 4 × 4 at height 0, of albedo 0.5, and a sheet of 1 × 1 that lies 1 mm above it.
pub fn room() -> Arc<Raycaster> {
    room_with_sheet(0.001)
}

/// The same with the sheet at this height.
pub fn room_with_sheet(height: f64) -> Arc<Raycaster> {
    let square = |half: f64, height: f64| {
        [(-half, -half), (half, -half), (half, half), (-half, half)]
            .map(|(x, y)| DVec3::new(x, y, height))
    };
    let positions: Vec<DVec3> = [square(2.0, 0.0), square(0.5, height)].concat();
    let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let mut floor = Material::grey("floor");
    floor.bsdf = Bsdf::Diffuse { kd: [0.5; 3] };
    let made = Scene::from_world(&positions, &triangles, &[0; 4], vec![floor], [1.0; 3]);
    Arc::new(Raycaster::build(Arc::new(made.unwrap().0)).unwrap())
}

pub fn eye() -> Eye {
    let (at, down) = (DVec3::new(0.0, 0.0, 3.0), DVec3::new(0.0, 0.0, -1.0));
    Eye::new(at, down, DVec3::Y, Some(60.0), None, (64, 64)).unwrap()
}

pub fn on_sheet(x: f64, y: f64) -> bool {
    x.abs() < 0.5 && y.abs() < 0.5
}

/// Rays straight down to a regular grid of points of the floor, each with this radiance.
pub fn rays(count: u32, radiance: impl Fn(f64, f64) -> f32) -> Vec<RaySample> {
    let at = |n: u32| (f64::from(n) + 0.5) / f64::from(count) * 3.8 - 1.9;
    let grid = (0..count).flat_map(|y| (0..count).map(move |x| (at(x), at(y))));
    grid.map(|(x, y)| RaySample {
        origin: DVec3::new(x, y, 2.0),
        direction: DVec3::new(0.0, 0.0, -1.0),
        distance: if on_sheet(x, y) { 1.999 } else { 2.0 },
        uncertainty: 0.0,
        radiance: [radiance(x, y); 3],
        paths: 1,
    })
    .collect()
}

/// Lets a ray end on a sheet at height 0.5, or past the sheet on the floor.
pub fn past_sheet(ray: RaySample) -> RaySample {
    let distance = if on_sheet(ray.origin.x, ray.origin.y) { 1.5 } else { 2.0 };
    RaySample { distance, ..ray }
}

/// A floor in front of a wall of 4 × 4 at y = 2. Floor and wall have materials 0 and 1.
pub fn walled_room(wall: Bsdf) -> Arc<Raycaster> {
    let floor = [(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)];
    let upright = [(-2.0, 0.0), (2.0, 0.0), (2.0, 4.0), (-2.0, 4.0)];
    let positions: Vec<DVec3> = floor
        .iter()
        .map(|&(x, y)| DVec3::new(x, y, 0.0))
        .chain(upright.iter().map(|&(x, z)| DVec3::new(x, 2.0, z)))
        .collect();
    let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
    let (mut below, mut behind) = (Material::grey("floor"), Material::grey("wall"));
    below.bsdf = Bsdf::Diffuse { kd: [0.5; 3] };
    behind.bsdf = wall;
    let ids = [0, 0, 1, 1];
    let made = Scene::from_world(&positions, &triangles, &ids, vec![below, behind], [1.0; 3]);
    Arc::new(Raycaster::build(Arc::new(made.unwrap().0)).unwrap())
}

pub fn to_wall() -> Eye {
    let (at, ahead) = (DVec3::new(0.0, -1.0, 1.0), DVec3::new(0.0, 1.0, -0.1));
    Eye::new(at, ahead, DVec3::Z, Some(40.0), None, (64, 64)).unwrap()
}

/// Returns what an eye sees of these rays' samples.
pub fn seen_by(raycaster: &Arc<Raycaster>, rays: &[RaySample], eye: &Eye) -> (SurfaceView, Drawn) {
    let (store, materials) = kept(raycaster, rays);
    let view = SurfaceView::new(Arc::clone(raycaster), materials, eye, (64, 64));
    let drawn = Gathered::new(&view, &store).draw(&view, &store, None);
    (view, drawn)
}

/// Rays straight down to the floor of a room with a wall, each with this radiance.
pub fn floor_rays(count: u32, radiance: impl Fn(f64, f64) -> f32) -> Vec<RaySample> {
    let down = rays(count, radiance).into_iter();
    down.map(|ray| RaySample { distance: 2.0, ..ray }).collect()
}

/// Rays to the wall from the front.
pub fn wall_rays(count: u32, radiance: f32) -> Vec<RaySample> {
    let forward = rays(count, |_, _| radiance).into_iter().map(|ray| RaySample {
        origin: DVec3::new(ray.origin.x, 0.0, ray.origin.y + 2.0),
        direction: DVec3::Y,
        distance: 2.0,
        ..ray
    });
    forward.collect()
}

/// Radiance of a light of 0.2 on the left and of 0.8 on the right.
pub fn halves(x: f64, _: f64) -> f32 {
    if x < 0.0 { 0.2 } else { 0.8 }
}

/// Returns the same rays with noise: half of them at random are black, and the others twice as
/// bright.
pub fn noisy(rays: Vec<RaySample>) -> Vec<RaySample> {
    let noise = |(number, ray): (u64, RaySample)| {
        let factor = if holo_display::split_mix(number) & 1 == 0 { 0.0 } else { 2.0 };
        RaySample { radiance: ray.radiance.map(|c| c * factor), ..ray }
    };
    (0..).zip(rays).map(noise).collect()
}

pub fn drawn(raycaster: &Arc<Raycaster>, batches: &[&[RaySample]]) -> Vec<[f32; 3]> {
    let materials = Arc::new(Materials::new(raycaster.scene()));
    let placer = Placer::new(raycaster, &materials);
    let mut store = LightStore::new(0.001, 64 << 20);
    for batch in batches {
        let mut placed = Vec::new();
        placer.place_rays(batch, &mut placed);
        store.add(&placed);
    }
    let view = SurfaceView::new(Arc::clone(raycaster), Arc::clone(&materials), &eye(), (64, 64));
    Gathered::new(&view, &store).draw(&view, &store, None).pixels
}
