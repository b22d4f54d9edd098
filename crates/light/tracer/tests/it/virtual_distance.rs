//! Tests distances along straightened rays against closed forms.

use crate::common::{BLACK, Model};
use glam::DVec3;
use holo_scene::Bsdf;
use holo_tracer::Tracer;

const GLASS: [f32; 3] = [0.9, 0.8, 0.7];

fn both(model: &Model) -> [Tracer; 2] {
    [model.tracer(None), model.tracer(None).with_virtual_distance()]
}

#[track_caller]
fn expect_distance(tracer: &Tracer, eye: DVec3, direction: DVec3, expected: f64) {
    let found = tracer.trace(eye, direction.normalize(), 3).distance;
    let right = found == expected || (found - expected).abs() < 2e-6 * expected;
    assert!(right, "from {eye} to {direction}: {found}, not {expected}");
}

/// A room from -1 to 1 whose walls at x = ±1 are mirrors.
fn hall() -> Model {
    let mut model = Model::default();
    let wall = model.material(Bsdf::Diffuse { kd: [0.5; 3] }, [1.0; 3]);
    let mirror = model.material(Bsdf::Mirror { ks: GLASS }, [0.0; 3]);
    model.cuboid([-1.0; 3], [1.0; 3], false, wall);
    model.ids[..4].fill(mirror);
    model
}

#[test]
fn mirror_images_are_as_far_behind_the_mirror_as_objects_are_in_front() {
    let [plain, virtual_] = both(&hall());
    let eye = DVec3::new(0.2, -0.3, 0.1);
    // Unfolded at the mirrors, the hall is an infinite slab: the ray goes straight to y = ±1 or z =
    // ±1.
    for direction in [
        DVec3::new(1.0, 0.7, 0.2),
        DVec3::new(-3.0, 0.4, -0.5),
        DVec3::new(20.0, -0.3, 0.5),
        DVec3::new(0.2, 0.3, 1.0),
    ] {
        let d = direction.normalize();
        let until = |axis: usize| (d[axis].signum() - eye[axis]) / d[axis];
        let (first, straight) =
            ((0..3).map(until).fold(f64::INFINITY, f64::min), until(1).min(until(2)));
        expect_distance(&plain, eye, d, first);
        expect_distance(&virtual_, eye, d, straight);
        // The image stands where the object mirrored at the walls stands; all eyes see it there.
        assert!(straight >= first);
    }
    // The ray runs back and forth between the mirrors without end, but its distance ends.
    let endless = virtual_.trace(eye, DVec3::X, 0).distance;
    assert!(endless > 60.0 && endless.is_finite(), "{endless}");
    let (a, b) = (
        plain.trace(eye, DVec3::new(0.6, 0.8, 0.0), 5),
        virtual_.trace(eye, DVec3::new(0.6, 0.8, 0.0), 5),
    );
    assert_eq!(a.radiance, b.radiance, "the light is the same");
}

#[test]
fn all_eyes_see_an_image_at_one_place() {
    let [_, tracer] = both(&hall());
    let object = DVec3::new(0.3, 1.0, 0.4);
    let image = DVec3::new(2.0 - 0.3, 1.0, 0.4);
    for eye in [DVec3::new(0.5, 0.0, 0.0), DVec3::new(-0.9, -0.8, 0.9), DVec3::new(0.0, 0.9, -0.5)]
    {
        let direction = (image - eye).normalize();
        let found = eye + direction * tracer.trace(eye, direction, 0).distance;
        assert!(found.distance(image) < 1e-6 * eye.distance(object) + 1e-6, "{found}");
    }
}

#[test]
fn glass_shows_what_is_behind_it_and_at_grazing_angles_its_reflection() {
    let mut model = Model { sky: [1.0; 3], ..Model::default() };
    let pane = model.material(Bsdf::ThinGlass { ior: 1.5, transmittance: GLASS }, [0.0; 3]);
    let wall = model.material(Bsdf::Diffuse { kd: [0.5; 3] }, [0.0; 3]);
    model.square(0.0, 100.0, true, pane);
    model.square(-3.0, 100.0, true, wall);
    let [plain, virtual_] = both(&model);
    let eye = DVec3::new(0.0, 0.0, 2.0);
    for slant in [0.0, 0.4, 2.0] {
        let down = DVec3::new(slant, 0.1 * slant, -1.0);
        expect_distance(&plain, eye, down, 2.0 * down.length());
        expect_distance(&virtual_, eye, down, 5.0 * down.length());
    }
    // At 3° more than half is reflected: the sky.
    expect_distance(&virtual_, eye, DVec3::new(20.0, 0.0, -1.0), f64::INFINITY);
    expect_distance(&plain, eye, DVec3::new(20.0, 0.0, -1.0), 2.0 * 401.0_f64.sqrt());
}

#[test]
fn through_a_slab_of_glass_the_bent_ray_s_length_counts() {
    let mut model = Model::default();
    let glass =
        model.material(Bsdf::Dielectric { ior: 1.5, transmittance: GLASS, alpha: 0.0 }, [0.0; 3]);
    let wall = model.material(Bsdf::Diffuse { kd: [0.5; 3] }, [0.0; 3]);
    model.cuboid([-50.0, -50.0, -0.5], [50.0, 50.0, 0.0], true, glass);
    model.square(-3.0, 50.0, true, wall);
    let [plain, virtual_] = both(&model);
    let eye = DVec3::new(0.0, 0.0, 2.0);
    for angle in [0.0_f64, 0.5, 1.0] {
        let inside = (angle.sin() / 1.5).asin();
        let down = DVec3::new(angle.sin(), 0.0, -angle.cos());
        expect_distance(&plain, eye, down, 2.0 / angle.cos());
        expect_distance(&virtual_, eye, down, 4.5 / angle.cos() + 0.5 / inside.cos());
    }
}

#[test]
fn curved_rough_and_emitting_surfaces_have_their_own_distance() {
    // A column of 24 sides, 15° apart, and a prism of 3 sides, 120° apart.
    for (sides, curved) in [(24, true), (3, false)] {
        let mut model = Model::default();
        let wall = model.material(Bsdf::Diffuse { kd: [0.5; 3] }, [0.0; 3]);
        let mirror = model.material(Bsdf::Mirror { ks: GLASS }, [0.0; 3]);
        model.cuboid([-9.0; 3], [9.0; 3], false, wall);
        let corner = |i: i32, z: f64| {
            let angle = std::f64::consts::TAU * (f64::from(i) + 0.5) / f64::from(sides);
            [angle.cos(), angle.sin(), z]
        };
        for i in 0..sides {
            model.polygon(
                &[corner(i, -9.0), corner(i + 1, -9.0), corner(i + 1, 9.0), corner(i, 9.0)],
                mirror,
            );
        }
        let [plain, virtual_] = both(&model);
        let eye = DVec3::new(-5.0, 0.1, 0.2);
        let direction = DVec3::new(1.0, 0.02, 0.03).normalize();
        let (a, b) =
            (plain.trace(eye, direction, 0).distance, virtual_.trace(eye, direction, 0).distance);
        assert_eq!(a == b, curved, "{sides} sides: {a} {b}");
    }
    for (bsdf, emission) in [
        (Bsdf::Conductor { ks: GLASS, alpha: 0.1 }, [0.0; 3]),
        (Bsdf::Coated { kd: GLASS, ks: GLASS, ior: 1.5, alpha: 0.1 }, [0.0; 3]),
        (Bsdf::Mirror { ks: GLASS }, [1.0; 3]),
        (BLACK, [0.0; 3]),
    ] {
        let mut model = hall();
        model.materials[1].bsdf = bsdf;
        model.materials[1].emission = emission;
        let [_, virtual_] = both(&model);
        expect_distance(&virtual_, DVec3::ZERO, DVec3::X, 1.0);
    }
}
