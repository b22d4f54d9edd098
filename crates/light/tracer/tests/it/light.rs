//! Tests emission and direct light against closed forms.

use crate::common::{BLACK, Model, estimate, expect, form_factor};
use glam::DVec3;
use holo_scene::Bsdf;

const KD: [f32; 3] = [0.8, 0.5, 0.2];
const LE: [f32; 3] = [3.0, 5.0, 7.0];
/// An off-centre rectangle above the floor that faces down.
const PANEL: [[f64; 3]; 4] =
    [[-1.0, 2.0, 2.0], [1.5, 2.0, 2.0], [1.5, -0.5, 2.0], [-1.0, -0.5, 2.0]];

fn lit(factor: f64) -> [f64; 3] {
    [0, 1, 2].map(|c| f64::from(KD[c]) * f64::from(LE[c]) * factor)
}

fn panel_over_floor(two_sided: bool, floor: Bsdf) -> Model {
    let mut model = Model::default();
    let floor = model.material(floor, [0.0; 3]);
    let light = model.material(BLACK, LE);
    if two_sided {
        model.two_sided(light);
    }
    model.square(0.0, 50.0, true, floor);
    model.polygon(&PANEL, light);
    model
}

#[test]
fn a_panel_lights_a_floor_by_its_form_factor() {
    for bounces in [Some(0), None] {
        let tracer = panel_over_floor(false, Bsdf::Diffuse { kd: KD }).tracer(bounces);
        for (x, y) in [(0.0, 0.0), (3.0, 1.0), (-0.9, 1.9), (-20.0, 5.0)] {
            let point = DVec3::new(x, y, 0.0);
            let eye = point + DVec3::new(0.3, -0.4, 1.0);
            expect(
                estimate(&tracer, eye, point - eye, 20_000),
                lit(form_factor(&PANEL, point, DVec3::Z)),
            );
        }
    }
}

#[test]
fn a_panel_emits_from_its_front_only_unless_it_is_two_sided() {
    for (two_sided, seen) in [(false, 0.0), (true, 1.0)] {
        let tracer = panel_over_floor(two_sided, BLACK).tracer(None);
        let below = tracer.trace(DVec3::new(0.0, 0.0, 1.0), DVec3::Z, 0);
        assert_eq!((below.radiance, below.distance), (LE, 1.0));
        let above = tracer.trace(DVec3::new(0.0, 0.0, 3.0), -DVec3::Z, 0);
        assert_eq!(above.radiance, LE.map(|c| c * seen));

        // The ceiling above sees the panel's back.
        let mut model = panel_over_floor(two_sided, BLACK);
        let ceiling = model.material(Bsdf::Diffuse { kd: KD }, [0.0; 3]);
        model.square(5.0, 50.0, false, ceiling);
        let point = DVec3::new(1.0, 2.0, 5.0);
        let factor = form_factor(&PANEL, point, -DVec3::Z) * f64::from(seen);
        let eye = point - DVec3::new(3.0, 0.0, 1.0);
        expect(estimate(&model.tracer(None), eye, point - eye, 20_000), lit(factor));
    }
}

#[test]
fn both_sides_of_a_diffuse_surface_reflect() {
    // The floor faces down: its lit side is its back.
    let mut model = Model::default();
    let floor = model.material(Bsdf::Diffuse { kd: KD }, [0.0; 3]);
    let light = model.material(BLACK, LE);
    model.square(0.0, 50.0, false, floor);
    model.polygon(&PANEL, light);
    let eye = DVec3::new(1.0, 1.0, 1.0);
    expect(
        estimate(&model.tracer(None), eye, -eye, 20_000),
        lit(form_factor(&PANEL, DVec3::ZERO, DVec3::Z)),
    );
}

#[test]
fn an_obstacle_hides_the_sky_that_it_covers() {
    let sky = [0.5, 1.0, 2.0];
    let mut model = Model { sky, ..Model::default() };
    let floor = model.material(Bsdf::Diffuse { kd: KD }, [0.0; 3]);
    let black = model.material(BLACK, [0.0; 3]);
    model.square(0.0, 50.0, true, floor);
    model.polygon(&PANEL, black);
    let tracer = model.tracer(None);
    for (x, y) in [(0.0, 0.0), (3.0, 1.0)] {
        let point = DVec3::new(x, y, 0.0);
        let open = 1.0 - form_factor(&PANEL, point, DVec3::Z);
        let expected = [0, 1, 2].map(|c| f64::from(KD[c]) * f64::from(sky[c]) * open);
        let eye = point + DVec3::new(0.3, -0.4, 1.0);
        expect(estimate(&tracer, eye, point - eye, 20_000), expected);
    }
    let past = tracer.trace(DVec3::new(0.0, 0.0, 5.0), DVec3::new(0.0, 0.6, 0.8), 0);
    assert_eq!((past.radiance, past.distance), (sky, f64::INFINITY));
}

#[test]
fn sky_and_panel_add_up() {
    let mut model = panel_over_floor(false, Bsdf::Diffuse { kd: KD });
    model.sky = [0.5, 1.0, 2.0];
    let point = DVec3::new(0.5, 0.0, 0.0);
    let factor = form_factor(&PANEL, point, DVec3::Z);
    let expected = [0, 1, 2]
        .map(|c| lit(factor)[c] + f64::from(KD[c]) * f64::from(model.sky[c]) * (1.0 - factor));
    let eye = point + DVec3::new(0.3, -0.4, 1.0);
    expect(estimate(&model.tracer(None), eye, point - eye, 40_000), expected);
}

#[test]
fn a_white_furnace_glows_with_its_geometric_series() {
    // Every wall emits LE and reflects KD, so radiance is LE (1 + KD + KD² + ...), truncated as
    // `bounces` says. Direct light alone has two terms: the wall's emission, and its reflection of
    // other walls.
    let mut model = Model::default();
    let wall = model.material(Bsdf::Diffuse { kd: KD }, LE);
    model.cuboid([-1.0, -2.0, -1.5], [1.0, 2.0, 1.5], false, wall);
    let (eye, direction) = (DVec3::new(0.1, 0.2, 0.3), DVec3::new(0.5, 0.3, -0.8));
    for bounces in [Some(0), Some(1), Some(2), Some(7), None] {
        let terms = bounces.map_or(400, |n| n as i32 + 2);
        let expected = [0, 1, 2]
            .map(|c| f64::from(LE[c]) * (0..terms).map(|k| f64::from(KD[c]).powi(k)).sum::<f64>());
        expect(estimate(&model.tracer(bounces), eye, direction, 20_000), expected);
    }
}

#[test]
fn one_bounce_carries_light_around_a_corner_and_none_does_not() {
    // A panel that faces a wall lights it. The floor sees the wall, but only the panel's black
    // back.
    let mut model = Model::default();
    let diffuse = model.material(Bsdf::Diffuse { kd: KD }, [0.0; 3]);
    let light = model.material(BLACK, LE);
    model.square(0.0, 10.0, true, diffuse);
    // The panel just below the ceiling faces up and stays clear of its edge.
    model.square(3.0, 4.0, false, diffuse);
    model.square(2.9, 1.0, true, light);
    let (eye, direction) = (DVec3::new(0.0, 0.0, 1.0), DVec3::new(0.2, 0.1, -1.0));
    assert_eq!(estimate(&model.tracer(Some(0)), eye, direction, 2_000).mean, [0.0; 3]);
    let [one, two, three] =
        [1, 2, 3].map(|n| estimate(&model.tracer(Some(n)), eye, direction, 40_000));
    // Paths alternate between floor and ceiling, and only the ceiling is lit. So odd numbers of
    // bounces add light and even ones add none. 4 comparisons at 4.5 sigma.
    for c in 0..3 {
        assert!(one.mean[c] > 0.0);
        let error = one.error[c].hypot(two.error[c]);
        assert!((one.mean[c] - two.mean[c]).abs() < 4.5 * error, "{one:?} {two:?}");
    }
    // Red light, which surfaces reflect most.
    let error = two.error[0].hypot(three.error[0]);
    assert!(three.mean[0] - two.mean[0] > 4.5 * error, "{two:?} {three:?}");
}
