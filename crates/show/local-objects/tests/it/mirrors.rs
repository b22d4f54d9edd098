//! What mirrors show of a room whose model is known, and what those of the room show of objects.

use std::sync::Arc;

use glam::DVec3;
use holo_display::Frame;
use holo_local_objects::{
    LIGHTS, LayerDetail, LightProbe, LitObject, LocalObject, ObjectLighting, ObjectModel,
    ObjectPose, Room, probe_views, side_places,
};
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, Sky};
use holo_tracer::{Settings, Tracer};

use crate::common::{boxes, drawn, grey, lit, pedestal};

const SIZE: (u32, u32) = (96, 96);

/// Radiance of the table, and of the sky.
const TABLE: f32 = 1.0;
const SKY: f32 = 2.0;

/// Returns the radiance of the floor, which differs from place to place.
fn of_floor(place: DVec3) -> f32 {
    6.0 + 3.0 * (4.0 * place.x).sin() as f32
}

/// A table on a floor.
fn table() -> Arc<Raycaster> {
    let floor = ([-8.0, -8.0, -0.1], [8.0, 8.0, 0.0], grey(0.5));
    let table = ([-0.6, -0.4, 0.7], [0.6, 0.4, 0.75], grey(0.5));
    Arc::new(Raycaster::build(Arc::new(boxes(&[floor, table]))).unwrap())
}

/// Returns the radiance that a ray shows, and its length.
fn shown(room: &Raycaster, origin: DVec3, direction: DVec3) -> (f32, f64) {
    let nothing = (SKY, f64::INFINITY);
    let Some((ray, skipped)) = room.localize(origin, direction) else { return nothing };
    room.nearest(&ray).map_or(nothing, |hit| {
        let distance = f64::from(hit.t) + skipped;
        let is_floor = room.scene().material_id(hit.triangle) == 0;
        let radiance = if is_floor { of_floor(origin + direction * distance) } else { TABLE };
        (radiance, distance)
    })
}

/// Returns the light at a place, without noise.
fn probe(room: &Raycaster, centre: DVec3) -> LightProbe {
    let frames = probe_views(centre).unwrap().map(|view| {
        let mut frame = Frame::black((128, 128));
        for pixel in 0..128 * 128 {
            let (x, y) = View::pixel_centre((128, 128), pixel % 128, pixel / 128);
            let (origin, direction) = view.ray(x, y);
            let (radiance, distance) = shown(room, origin, direction);
            frame.picture.pixels[pixel as usize] = [radiance; 3];
            frame.depth[pixel as usize] = distance as f32;
        }
        frame
    });
    LightProbe::new(centre, &frames).unwrap()
}

/// Returns a mirror of 0.4 by 0.4 by 0.8 on the table.
fn mirror() -> LocalObject {
    let model = pedestal(0.4, 0.8, Bsdf::Mirror { ks: [1.0; 3] });
    LocalObject::new(model, ObjectPose::at(DVec3::new(0.0, 0.0, 0.7501)), DVec3::Z).unwrap()
}

#[test]
fn a_mirror_shows_the_floor_behind_the_edge_of_its_table_that_its_middle_does_not_see() {
    let raycaster = table();
    let room = Room::new(Arc::clone(&raycaster));
    let object = mirror();
    let places = side_places(&object, &room, 3);
    assert!((1..=3).contains(&places.len()), "{places:?}");
    let eye = DVec3::new(2.7, -0.3, 5.45);
    let view =
        View::new(eye, DVec3::new(0.2, 0.0, 1.2) - eye, DVec3::Z, Some(14.0), Some(14.0), SIZE)
            .unwrap();
    let mut frame = Frame::black(SIZE);
    let mut expected = vec![None; frame.depth.len()];
    for (pixel, expected) in expected.iter_mut().enumerate() {
        let (x, y) = View::pixel_centre(SIZE, pixel as u32 % SIZE.0, pixel as u32 / SIZE.0);
        let (origin, direction) = view.ray(x, y);
        let (radiance, distance) = shown(&raycaster, origin, direction);
        (frame.picture.pixels[pixel], frame.depth[pixel]) = ([radiance; 3], distance as f32);
        let Some(distance) = object.distance(origin, direction) else { continue };
        let point = origin + direction * distance;
        // The face to the right.
        if (point.x - 0.2).abs() < 1e-4 && point.y.abs() < 0.19 {
            let mirrored = DVec3::new(-direction.x, direction.y, direction.z);
            *expected = Some(shown(&raycaster, point + DVec3::X * 1e-4, mirrored).0);
        }
    }
    frame.picture.view = Some(view);
    let count = expected.iter().flatten().count();
    let behind = expected.iter().flatten().filter(|radiance| **radiance > SKY).count();
    assert!(count > 500 && behind > count / 10 && behind < count, "{behind} of {count}");
    let wrong = |sides: Vec<LightProbe>| {
        let lighting = ObjectLighting::new(probe(&raycaster, object.centre()), LIGHTS, None);
        let lit = LitObject::new(object.clone(), Arc::new(lighting.with_sides(sides)));
        let seen = drawn(&frame, &view, &[lit], Some(&room), LayerDetail::Exact(1));
        let errors = seen.picture.pixels.iter().zip(&expected).filter_map(|(found, expected)| {
            expected
                .filter(|radiance| *radiance > SKY)
                .map(|radiance| f64::from((found[1] - radiance).abs()))
        });
        errors.sum::<f64>() / behind as f64
    };
    let sides = places.iter().map(|&place| probe(&raycaster, place)).collect();
    let (without, with) = (wrong(Vec::new()), wrong(sides));
    assert!(with < 0.2 && without > 3.0 * with, "{without}, with places {with}");
}

#[test]
fn no_further_place_is_needed_where_the_middle_sees_all_or_nothing_mirrors() {
    let floor = boxes(&[([-50.0, -50.0, -1.0], [50.0, 50.0, 0.0], grey(0.5))]);
    let floor = Room::new(Arc::new(Raycaster::build(Arc::new(floor)).unwrap()));
    assert!(side_places(&mirror(), &floor, 3).is_empty());
    let matt = pedestal(0.4, 0.8, grey(0.5));
    let pose = ObjectPose::at(DVec3::new(0.0, 0.0, 0.7501));
    let matt = LocalObject::new(matt, pose, DVec3::Z).unwrap();
    assert!(side_places(&matt, &Room::new(table()), 3).is_empty());
}

/// Paths of each pixel that the tracer traces.
const PATHS: u64 = 256;

/// Returns what the tracer finds of boxes below an even sky, in all pixels of a view.
fn traced(view: &View, size: (u32, u32), what: &[([f64; 3], [f64; 3], Bsdf)]) -> Vec<f32> {
    let mut scene = boxes(what);
    scene.sky = Sky::from([1.0; 3]);
    let tracer = Tracer::new(Arc::new(scene), Settings::default()).unwrap();
    let pixel = |pixel: u32| {
        let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
        let (origin, direction) = view.ray(x, y);
        tracer.trace_paths(origin, direction, u64::from(pixel), 0..PATHS).radiance[1]
    };
    (0..size.0 * size.1).map(pixel).collect()
}

#[test]
fn metals_coats_and_glass_of_the_room_show_an_object_at_rest_as_the_tracer_does() {
    const SMALL: (u32, u32) = (40, 40);
    let object = ([-0.5, -0.5, 0.3], [0.5, 0.5, 1.3], grey(0.0));
    let model = boxes(&[object]);
    let model = Arc::new(ObjectModel::new(model, DVec3::Z, 1.0).unwrap());
    let pose = ObjectPose::at(DVec3::new(0.0, 0.0, 0.3));
    let object_at = LocalObject::new(Arc::clone(&model), pose, DVec3::Z).unwrap();
    let lit = [lit(&model, pose, LIGHTS, |_| 1.0)];
    let eye = DVec3::new(0.3, -5.0, 1.6);
    let view = View::new(eye, DVec3::new(0.0, -0.8, 0.1) - eye, DVec3::Z, Some(30.0), None, SMALL);
    let view = view.unwrap();
    let (ks, ior) = ([0.8; 3], 1.5);
    let pane = Bsdf::ThinGlass { ior, transmittance: [0.8; 3] };
    let solid = Bsdf::Dielectric { ior, transmittance: [1.0; 3], alpha: 0.0 };
    // The far face of solid glass shows the object too, and only the near one is drawn.
    for (name, bsdf, least, most) in [
        ("smooth metal", Bsdf::Conductor { ks, alpha: 0.02 }, 0.05, 0.25),
        ("rough metal", Bsdf::Conductor { ks, alpha: 0.25 }, 0.05, 0.25),
        ("coat", Bsdf::Coated { kd: [0.1; 3], ks: [1.0; 3], ior, alpha: 0.05 }, 0.03, 0.25),
        ("panes", pane, 0.03, 0.25),
        ("solid glass", solid, 0.03, 0.6),
    ] {
        let plate = ([-9.0, -9.0, -0.1], [9.0, 9.0, 0.0], bsdf);
        let room = Room::new(Arc::new(Raycaster::build(Arc::new(boxes(&[plate]))).unwrap()));
        let before = traced(&view, SMALL, &[plate]);
        let truth = traced(&view, SMALL, &[plate, object]);
        let mut frame = Frame::black(SMALL);
        frame.depth = room.depth(&view, SMALL);
        frame.picture.pixels = before.iter().map(|&radiance| [radiance; 3]).collect();
        let seen = drawn(&frame, &view, &lit, Some(&room), LayerDetail::Exact(64));
        let (mut count, mut errors) = (0, [0.0; 2]);
        for pixel in 0..truth.len() {
            let (column, row) = (pixel as u32 % SMALL.0, pixel as u32 / SMALL.0);
            let (x, y) = View::pixel_centre(SMALL, column, row);
            let (origin, direction) = view.ray(x, y);
            let at = origin - direction * (origin.z / direction.z);
            let is_plate = direction.z < 0.0
                && at.x.abs().max(at.y.abs()) < 9.0
                && object_at.distance(origin, direction).is_none();
            if is_plate && (truth[pixel] - before[pixel]).abs() > least {
                count += 1;
                errors[0] += f64::from((before[pixel] - truth[pixel]).powi(2));
                errors[1] += f64::from((seen.picture.pixels[pixel][1] - truth[pixel]).powi(2));
            }
        }
        let [without, with] = errors.map(|error| (error / f64::from(count)).sqrt());
        println!("{name}: rms {without:.4} before, {with:.4} with the object, {count} pixels");
        assert!(count > 100 && with < most * without, "{name}: {with} of {without}, {count}");
    }
}
