//! What is seen of objects.

use std::sync::Arc;

use glam::DVec3;
use holo_display::Interrupt;
use holo_local_objects::{LayerDetail, ObjectLayer, ObjectPose, Room};
use holo_optics::{Ggx, reflect};
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_scene::Bsdf;

use crate::common::{FAR, boxes, drawn, floor, grey, lit, lit_here, pedestal, pixel_of, view};

const SIZE: (u32, u32) = (160, 120);

/// A sample of the top and of the two sides that the view sees, of a pedestal of width 1 and
/// height 1.
const FACES: [(DVec3, DVec3); 3] = [
    (DVec3::new(0.1, -0.1, 1.0), DVec3::Z),
    (DVec3::new(0.5, 0.1, 0.6), DVec3::X),
    (DVec3::new(-0.1, -0.5, 0.6), DVec3::NEG_Y),
];

#[test]
fn in_even_light_a_convex_object_has_the_radiance_times_its_albedo() {
    let view = view(DVec3::new(0.0, 0.0, 0.5), SIZE);
    let mut frame = floor(&view, SIZE, 2.0);
    // Without a floor, nothing darkens the surroundings.
    frame.depth.fill(f32::INFINITY);
    let mut object = lit_here(&pedestal(1.0, 1.0, grey(0.6)), |_| 2.0);
    for detail in [LayerDetail::Quick(1), LayerDetail::Exact(16)] {
        let seen = drawn(&frame, &view, std::slice::from_ref(&object), None, detail);
        for (point, _) in FACES {
            let found = seen.picture.pixels[pixel_of(&view, SIZE, point)][1];
            assert!((found - 1.2).abs() < 0.03, "{detail:?} at {point}: {found}, not 1.2");
        }
        // Each number of lights gives the same.
        object = lit(&pedestal(1.0, 1.0, grey(0.6)), ObjectPose::at(DVec3::ZERO), 1, |_| 2.0);
    }
}

#[test]
fn a_small_lamp_lights_faces_by_the_cosine() {
    let view = view(DVec3::new(0.0, 0.0, 0.5), SIZE);
    let frame = floor(&view, SIZE, 0.0);
    let towards = DVec3::new(0.5, -0.4, 0.8).normalize();
    // A cone of 8° around the lamp's direction.
    let (least, radiance) = (8.0_f64.to_radians().cos(), 100.0);
    let lamp = |direction: DVec3| if direction.dot(towards) > least { radiance } else { 0.01 };
    let object = lit_here(&pedestal(1.0, 1.0, grey(0.5)), lamp);
    for detail in [LayerDetail::Quick(1), LayerDetail::Exact(64)] {
        let seen = drawn(&frame, &view, std::slice::from_ref(&object), None, detail);
        for (point, normal) in FACES {
            // The lamp is on a sphere of radius 10 around the object, and the face nearer to it.
            let centre = DVec3::new(0.0, 0.0, 0.5);
            let way = towards * 10.0 - (point - centre);
            let nearer = 100.0 / way.length_squared();
            let cosine = way.normalize().dot(normal).max(0.0) * nearer;
            let irradiance = 2.0 * std::f64::consts::PI * (1.0 - least) * f64::from(radiance);
            let rest = 0.01 * std::f64::consts::PI;
            let expected = 0.5 / std::f64::consts::PI * (irradiance * cosine + rest);
            let found = f64::from(seen.picture.pixels[pixel_of(&view, SIZE, point)][0]);
            let error = (found / expected - 1.0).abs();
            assert!(error < 0.06, "{detail:?} at {point}: {found}, not {expected}");
        }
    }
}

#[test]
fn what_is_nearer_hides_the_other() {
    let view = view(DVec3::new(0.0, 0.0, 0.5), SIZE);
    let frame = floor(&view, SIZE, 2.0);
    let object = [lit_here(&pedestal(1.0, 1.0, grey(0.1)), |_| 2.0)];
    let pixel = pixel_of(&view, SIZE, DVec3::new(0.1, -0.1, 1.0));
    let seen = drawn(&frame, &view, &object, None, LayerDetail::Quick(1));
    assert!((seen.picture.pixels[pixel][0] - 0.2).abs() < 0.02, "in front of the floor");
    let distance = view.vp.distance(DVec3::new(0.1, -0.1, 1.0)) as f32;
    assert!((seen.depth[pixel] - distance).abs() < 0.05, "its distance is that of the frame");
    let mut wall = frame.clone();
    wall.depth.fill(2.0);
    let hidden = drawn(&wall, &view, &object, None, LayerDetail::Quick(1));
    assert_eq!(hidden.picture.pixels[pixel], wall.picture.pixels[pixel], "behind a wall");
    assert_eq!(hidden.depth, wall.depth);
}

#[test]
fn pixels_beside_objects_and_shadows_stay_and_a_frame_without_objects_is_the_same() {
    let view = view(DVec3::new(0.0, 0.0, 0.5), SIZE);
    let frame = floor(&view, SIZE, 2.0);
    assert_eq!(drawn(&frame, &view, &[], None, LayerDetail::Quick(1)).picture, frame.picture);
    let aside = ObjectPose { at: DVec3::new(-30.0, 40.0, 0.0), turn: 0.0, scale: 1.0 };
    let object = [lit(&pedestal(0.1, 0.1, grey(0.1)), aside, 8, |_| 2.0)];
    let seen = drawn(&frame, &view, &object, None, LayerDetail::Quick(1));
    let near = pixel_of(&view, SIZE, DVec3::ZERO);
    assert_eq!(seen.picture.pixels[near], frame.picture.pixels[near]);
}

#[test]
fn passes_add_up_however_many_are_drawn_at_a_time() {
    let view = view(DVec3::new(0.0, 0.0, 0.5), SIZE);
    let frame = floor(&view, SIZE, 2.0);
    let above = |direction: DVec3| if direction.z > 0.9 { 20.0 } else { 1.0 };
    let objects = [lit_here(&pedestal(1.0, 1.0, grey(0.6)), above)];
    let at_once = drawn(&frame, &view, &objects, None, LayerDetail::Exact(6));
    let mut layer = ObjectLayer::new(&frame, &view, &objects, None, LayerDetail::Exact(6));
    let interrupt = Interrupt::default();
    interrupt.set();
    layer.draw(&frame, &objects, None, 4, &interrupt);
    assert!(!layer.is_drawn(), "it is interrupted");
    interrupt.clear();
    let mut calls = 0;
    while layer.is_unfinished() {
        layer.draw(&frame, &objects, None, 1, &interrupt);
        calls += 1;
    }
    let mut one_by_one = frame.clone();
    layer.compose(&mut one_by_one);
    assert_eq!(calls, 6);
    assert_eq!(one_by_one.picture.pixels, at_once.picture.pixels);
    assert!(layer.visible_share() > 0.01);
}

#[test]
fn a_mirror_shows_its_surroundings_and_a_pane_what_is_behind() {
    let view = view(DVec3::new(0.0, 0.0, 0.5), SIZE);
    let frame = floor(&view, SIZE, 3.0);
    let above = |direction: DVec3| if direction.z > 0.0 { 5.0 } else { 1.0 };
    let top = pixel_of(&view, SIZE, DVec3::new(0.1, -0.1, 1.0));
    let mirror = [lit_here(&pedestal(1.0, 1.0, Bsdf::Mirror { ks: [0.9; 3] }), above)];
    for detail in [LayerDetail::Quick(1), LayerDetail::Exact(8)] {
        let seen = drawn(&frame, &view, &mirror, None, detail);
        assert!((seen.picture.pixels[top][0] - 4.5).abs() < 0.1, "{detail:?}");
    }
    let bsdf = Bsdf::ThinGlass { ior: 1.0, transmittance: [0.5; 3] };
    let pane = [lit_here(&pedestal(1.0, 1.0, bsdf), above)];
    let seen = drawn(&frame, &view, &pane, None, LayerDetail::Exact(8));
    // A ray passes two panes, or three where it also leaves through the bottom.
    assert!((seen.picture.pixels[top][0] - 0.75).abs() < 0.05, "{:?}", seen.picture.pixels[top]);
}

#[test]
fn mirrors_of_the_room_show_the_object_and_coarse_cells_show_what_fine_ones_do() {
    // A mirror at y = 2, behind a pedestal of radiance 1.2.
    let mirror = Bsdf::Mirror { ks: [0.9; 3] };
    let scene = boxes(&[([-20.0, 2.0, -20.0], [20.0, 2.1, 20.0], mirror)]);
    let room = Room::new(Arc::new(Raycaster::build(Arc::new(scene)).unwrap()));
    let eye = DVec3::new(3.0, -3.0, 0.6);
    let image = DVec3::new(0.0, 3.5, 0.5);
    let view = View::new(eye, image - eye, DVec3::Z, Some(50.0), None, SIZE).unwrap();
    let mut frame = floor(&view, SIZE, 3.0);
    frame.picture.pixels.fill([3.0; 3]);
    frame.depth = room.depth(&view, SIZE);
    let object = [lit_here(&pedestal(1.0, 1.0, grey(0.6)), |_| 2.0)];
    for detail in [LayerDetail::Quick(1), LayerDetail::Quick(3), LayerDetail::Exact(8)] {
        let seen = drawn(&frame, &view, &object, Some(&room), detail);
        let at = |point| seen.picture.pixels[pixel_of(&view, SIZE, point)][1];
        assert!((at(image) - 0.9 * 1.2).abs() < 0.03, "{detail:?}: {}", at(image));
        let direct = DVec3::new(0.2, -0.5, 0.5);
        assert!((at(direct) - 1.2).abs() < 0.03, "{detail:?}: {}", at(direct));
        let beside = DVec3::new(2.5, 3.5, 0.5);
        assert!((at(beside) - 3.0).abs() < 1e-3, "{detail:?}: {}", at(beside));
    }
}

#[test]
fn glass_before_an_object_dims_it_directly_and_in_a_mirror_and_goes_on_reflecting() {
    let eye = DVec3::new(3.0, -3.0, 0.6);
    let image = DVec3::new(0.0, 3.5, 0.5);
    let view = View::new(eye, image - eye, DVec3::Z, Some(50.0), None, SIZE).unwrap();
    // A mirror at y = 2, behind a pedestal of radiance 1.2, and a glass wall of two faces before
    // both.
    let pane = |ior: f32| Bsdf::ThinGlass { ior, transmittance: [0.5; 3] };
    let solid = Bsdf::Dielectric { ior: 1.5, transmittance: [0.5; 3], alpha: 0.0 };
    let room = |glass: Bsdf| {
        let scene = boxes(&[
            ([-20.0, 2.0, -20.0], [20.0, 2.1, 20.0], Bsdf::Mirror { ks: [0.9; 3] }),
            ([-20.0, -1.1, -20.0], [20.0, -1.0, 20.0], glass),
        ]);
        Room::new(Arc::new(Raycaster::build(Arc::new(scene)).unwrap()))
    };
    let object = [lit_here(&pedestal(1.0, 1.0, grey(0.6)), |_| 2.0)];
    for detail in [LayerDetail::Quick(1), LayerDetail::Exact(8)] {
        let shown = |glass: Bsdf, point: DVec3| {
            let room = room(glass);
            let mut frame = floor(&view, SIZE, 3.0);
            frame.picture.pixels.fill([3.0; 3]);
            frame.depth = room.depth(&view, SIZE);
            let seen = drawn(&frame, &view, &object, Some(&room), detail);
            seen.picture.pixels[pixel_of(&view, SIZE, point)][1]
        };
        let direct = DVec3::new(0.2, -0.5, 0.5);
        let near = |found: f32, expected: f32, what: &str| {
            assert!((found - expected).abs() < 0.03, "{what}, {detail:?}: {found}, {expected}");
        };
        near(shown(pane(1.0), direct), 0.25 * 1.2, "without reflection");
        near(shown(pane(1.0), image), 0.25 * 0.9 * 1.2, "in the mirror");
        let to = (direct - eye).normalize();
        let share = holo_optics::pane(to.y as f32, 1.5);
        let left = 0.5 * (1.0 - share);
        // Both faces go on reflecting the room, of radiance 2.
        let expected = left * left * 1.2 + (share + left * share) * 2.0;
        near(shown(pane(1.5), direct), expected, "with reflections");
        let face = holo_optics::dielectric(to.y as f32, 1.5).0;
        let expected = (0.5 * (1.0 - face)).powi(2) * 1.2 + share * 2.0;
        near(shown(solid, direct), expected, "through solid glass");
    }
}

/// Returns the mean light that facets of a metal mirror to the eye, by many facets: a smooth
/// environment on the sphere of light around `centre`, seen from a point of a face.
fn mirrored_by_metal(
    alpha: f32,
    (eye, centre, point, normal): (DVec3, DVec3, DVec3, DVec3),
    radiance: impl Fn(DVec3) -> f32,
) -> f32 {
    const SIDE: usize = 128;
    let (right, ahead) = normal.any_orthonormal_pair();
    let towards_eye = (eye - point).normalize();
    let local = |v: DVec3| DVec3::new(v.dot(right), v.dot(ahead), v.dot(normal)).as_vec3();
    let (view, ggx) = (local(towards_eye), Ggx::new(alpha));
    let place = |at: usize| (at as f32 + 0.5) / SIDE as f32;
    let light = |number: usize| {
        let facet = ggx.sample(view, [place(number % SIDE), place(number / SIDE)]);
        let towards = reflect(view, facet);
        if towards.z <= 0.0 {
            return 0.0;
        }
        let share = ggx.shadowing(view, towards);
        let towards = towards.as_dvec3();
        let towards = right * towards.x + ahead * towards.y + normal * towards.z;
        // Where the ray leaves the sphere.
        let from = point - centre;
        let along = from.dot(towards);
        let far = -along + (along * along - from.length_squared() + FAR * FAR).sqrt();
        share * radiance((from + towards * far).normalize())
    };
    (0..SIDE * SIDE).map(light).sum::<f32>() / (SIDE * SIDE) as f32
}

#[test]
fn rough_metal_mirrors_the_mean_of_its_lobe_while_it_moves_and_at_rest() {
    let view = view(DVec3::new(0.0, 0.0, 0.5), SIZE);
    let mut frame = floor(&view, SIZE, 0.0);
    frame.depth.fill(f32::INFINITY);
    let radiance = |direction: DVec3| 1.0 + (3.0 * direction.x + 2.0 * direction.z).sin() as f32;
    let ks = 0.9;
    for alpha in [0.1, 0.2, 0.4] {
        let model = pedestal(1.0, 1.0, Bsdf::Conductor { ks: [ks; 3], alpha });
        let object = lit_here(&model, radiance);
        // Eight facets leave errors of some percent of the light around, which has mean 1.
        for (detail, most) in [(LayerDetail::Quick(1), 0.16), (LayerDetail::Exact(256), 0.02)] {
            let seen = drawn(&frame, &view, std::slice::from_ref(&object), None, detail);
            for (point, normal) in FACES {
                let centre = DVec3::new(0.0, 0.0, 0.5);
                let places = (view.eye(), centre, point, normal);
                let expected = ks * mirrored_by_metal(alpha, places, radiance);
                let found = seen.picture.pixels[pixel_of(&view, SIZE, point)][1];
                assert!(
                    (found - expected).abs() < most,
                    "{alpha} {detail:?} at {point}: {found}, not {expected}"
                );
            }
        }
    }
}
