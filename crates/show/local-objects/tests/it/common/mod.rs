//! Boxes, spheres of light around them, and frames of a floor.

use std::sync::Arc;

use glam::DVec3;
use holo_display::{Frame, Interrupt};
use holo_local_objects::{
    LIGHTS, LayerDetail, LightProbe, LitObject, LocalObject, ObjectLayer, ObjectLighting,
    ObjectModel, ObjectPose, Room, probe_views,
};
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Material, Scene};

/// Radius of the sphere that light comes from.
pub const FAR: f64 = 10.0;

/// Returns a scene of boxes, each with its lowest and highest corner and its material.
pub fn boxes(boxes: &[([f64; 3], [f64; 3], Bsdf)]) -> Scene {
    let (mut positions, mut triangles, mut ids) = (Vec::new(), Vec::new(), Vec::new());
    let mut materials = Vec::new();
    for (number, (low, high, bsdf)) in (0..).zip(boxes) {
        let first = positions.len() as u32;
        for corner in 0..8 {
            let pick = |axis: usize| if corner >> axis & 1 == 0 { low[axis] } else { high[axis] };
            positions.push(DVec3::new(pick(0), pick(1), pick(2)));
        }
        for [a, b, c, d] in
            [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
        {
            triangles.push([first + a, first + b, first + c]);
            triangles.push([first + a, first + c, first + d]);
            ids.extend([number; 2]);
        }
        materials.push(Material { bsdf: *bsdf, ..Material::grey("box") });
    }
    Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3]).unwrap().0
}

/// Returns a box of this size around the z axis, on the plane z = 0.
pub fn pedestal(width: f64, height: f64, bsdf: Bsdf) -> Arc<ObjectModel> {
    let half = 0.5 * width;
    let scene = boxes(&[([-half, -half, 0.0], [half, half, height], bsdf)]);
    Arc::new(ObjectModel::new(scene, DVec3::Z, 1.0).unwrap())
}

/// Returns a grey material.
pub fn grey(albedo: f32) -> Bsdf {
    Bsdf::Diffuse { kd: [albedo; 3] }
}

/// Returns the light at a place, of a sphere around it whose radiance is a function of direction.
pub fn sphere_of_light(centre: DVec3, radiance: impl Fn(DVec3) -> f32) -> LightProbe {
    let frames = probe_views(centre).unwrap().map(|view| {
        let size = (64, 64);
        let mut frame = Frame::black(size);
        for pixel in 0..size.0 * size.1 {
            let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
            frame.picture.pixels[pixel as usize] = [radiance(view.ray(x, y).1); 3];
            frame.depth[pixel as usize] = FAR as f32;
        }
        frame
    });
    LightProbe::new(centre, &frames).unwrap()
}

/// Returns a model at a place, lit by a sphere of light.
pub fn lit(
    model: &Arc<ObjectModel>,
    pose: ObjectPose,
    lights: usize,
    radiance: impl Fn(DVec3) -> f32,
) -> LitObject {
    let object = LocalObject::new(Arc::clone(model), pose, DVec3::Z).unwrap();
    let probe = sphere_of_light(object.centre(), radiance);
    LitObject::new(object, Arc::new(ObjectLighting::new(probe, lights, None)))
}

/// Returns the same with the usual number of lights, at the origin.
pub fn lit_here(model: &Arc<ObjectModel>, radiance: impl Fn(DVec3) -> f32) -> LitObject {
    lit(model, ObjectPose::at(DVec3::ZERO), LIGHTS, radiance)
}

/// Returns a view of this point from the side and above.
pub fn view(towards: DVec3, size: (u32, u32)) -> View {
    let eye = DVec3::new(4.0, -3.0, 3.5);
    View::new(eye, towards - eye, DVec3::Z, Some(40.0), None, size).unwrap()
}

/// Returns a frame of a floor at z = 0, of this radiance, below an empty sky.
pub fn floor(view: &View, size: (u32, u32), radiance: f32) -> Frame {
    let mut frame = Frame::black(size);
    for pixel in 0..size.0 * size.1 {
        let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
        let (eye, direction) = view.ray(x, y);
        let distance = -eye.z / direction.z;
        let at = pixel as usize;
        if distance > 0.0 {
            (frame.picture.pixels[at], frame.depth[at]) = ([radiance; 3], distance as f32);
        } else {
            frame.depth[at] = f32::INFINITY;
        }
    }
    frame.picture.view = Some(*view);
    frame
}

/// Returns a room that is only a floor of this albedo.
pub fn floor_room(albedo: f32) -> Room {
    let scene = boxes(&[([-50.0, -50.0, -1.0], [50.0, 50.0, 0.0], grey(albedo))]);
    Room::new(Arc::new(Raycaster::build(Arc::new(scene)).unwrap()))
}

/// Draws objects over a frame.
pub fn drawn(
    frame: &Frame,
    view: &View,
    objects: &[LitObject],
    room: Option<&Room>,
    detail: LayerDetail,
) -> Frame {
    let mut layer = ObjectLayer::new(frame, view, objects, room, detail);
    layer.draw(frame, objects, room, u32::MAX, &Interrupt::default());
    assert!(!layer.is_unfinished());
    let mut drawn = frame.clone();
    layer.compose(&mut drawn);
    drawn
}

/// Returns the number of the pixel that shows a point.
pub fn pixel_of(view: &View, size: (u32, u32), point: DVec3) -> usize {
    let (x, y, _) = view.project(point).unwrap();
    let (column, row) = View::pixel_at(size, x, y).unwrap();
    (row * size.0 + column) as usize
}
