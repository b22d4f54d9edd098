//! Shadows of objects on what is around them.

use glam::DVec3;
use holo_local_objects::LayerDetail;

use crate::common::{drawn, floor, floor_room, grey, lit_here, pedestal, pixel_of, view};

const SIZE: (u32, u32) = (160, 120);

/// Half of a lamp's angle, as a cosine.
const LAMP: f64 = 0.995;

/// Direction of the lamp.
fn towards() -> DVec3 {
    DVec3::new(-0.6, 0.0, 0.8)
}

fn lamp(direction: DVec3) -> f32 {
    if direction.dot(towards()) > LAMP { 100.0 } else { 0.5 }
}

/// A point in the shadow of a pedestal of width 1 and height 1, and one beside it.
const POINTS: [DVec3; 2] = [DVec3::new(0.8, 0.0, 0.0), DVec3::new(0.4, -1.6, 0.0)];

#[test]
fn the_floor_loses_the_share_that_the_object_hides_with_and_without_the_room_s_model() {
    let view = view(DVec3::ZERO, SIZE);
    // The floor's irradiance, and its radiance at an albedo of 0.5.
    let direct = 2.0 * std::f64::consts::PI * (1.0 - LAMP) * 100.0 * towards().z;
    let rest = 0.5 * std::f64::consts::PI;
    let lit = (0.5 / std::f64::consts::PI * (direct + rest)) as f32;
    let frame = floor(&view, SIZE, lit);
    let object = [lit_here(&pedestal(1.0, 1.0, grey(0.0)), lamp)];
    let room = floor_room(0.5);
    for room in [None, Some(&room)] {
        for detail in [LayerDetail::Quick(1), LayerDetail::Exact(64)] {
            let seen = drawn(&frame, &view, &object, room, detail);
            let [dark, bright] =
                POINTS.map(|point| seen.picture.pixels[pixel_of(&view, SIZE, point)][1] / lit);
            // In the shadow, at most the light from other sides is left.
            let left = (rest / (rest + direct)) as f32;
            assert!(dark < 1.1 * left && dark > 0.6 * left, "{detail:?}: {dark} of {left}");
            assert!(bright > 0.97, "{detail:?}: {bright}");
        }
    }
}

#[test]
fn the_shadow_s_edge_is_soft_at_rest() {
    let view = view(DVec3::ZERO, SIZE);
    let frame = floor(&view, SIZE, 1.0);
    let object = [lit_here(&pedestal(1.0, 1.0, grey(0.0)), lamp)];
    // Across the end of the shadow, which is 0.75 long from the pedestal's top edge.
    let share = |detail| {
        let seen = drawn(&frame, &view, &object, None, detail);
        let at = |x: f64| seen.picture.pixels[pixel_of(&view, SIZE, DVec3::new(x, 0.0, 0.0))][0];
        let (full, none) = (at(0.8), at(1.9));
        (at(1.25) - full) / (none - full)
    };
    let soft = share(LayerDetail::Exact(64));
    assert!((0.15..0.85).contains(&soft), "{soft}");
}

#[test]
fn an_object_above_a_floor_takes_light_from_all_sides_as_its_solid_angle_says() {
    let view = view(DVec3::ZERO, SIZE);
    let frame = floor(&view, SIZE, 1.0);
    let object = [lit_here(&pedestal(1.0, 1.0, grey(0.0)), |_| 1.0)];
    let seen = drawn(&frame, &view, &object, None, LayerDetail::Exact(256));
    // In front of a face's middle, by the form factor of a rectangle at a right angle to a small
    // surface: 1 / 2π (atan(1 / y) - y / sqrt(y² + h²) atan(1 / sqrt(y² + h²))), for each half.
    let (y, h, half) = (0.5_f64, 1.0_f64, 0.5_f64);
    let s = (y * y + h * h).sqrt();
    let factor = 2.0 / std::f64::consts::TAU * ((half / y).atan() - y / s * (half / s).atan());
    let pixel = pixel_of(&view, SIZE, DVec3::new(0.5 + y, 0.0, 0.0));
    let found = 1.0 - f64::from(seen.picture.pixels[pixel][0]);
    assert!((found - factor).abs() < 0.02, "{found}, not {factor}");
}
