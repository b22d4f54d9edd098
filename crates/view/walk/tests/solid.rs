//! Solid surroundings: a house of boxes, whose rays are cast by the test itself.

#![allow(clippy::expect_used, clippy::panic, clippy::unwrap_used)]

use std::sync::Arc;

use glam::DVec3;
use holo_picture::ViewSpec;
use holo_walk::{Controls, Surface, Surroundings, Walker};

/// Boxes, given by two corners.
#[derive(Debug)]
struct Boxes(Vec<(DVec3, DVec3)>);

impl Surroundings for Boxes {
    fn surface(&self, from: DVec3, towards: DVec3) -> Option<Surface> {
        let of_box = |&(low, high): &(DVec3, DVec3)| {
            let mut nearest: Option<Surface> = None;
            for axis in 0..3 {
                for (plane, sign) in [(low[axis], -1.0), (high[axis], 1.0)] {
                    let distance = (plane - from[axis]) / towards[axis];
                    let at = from + towards * distance;
                    let is_in = |other: usize| {
                        other == axis || (low[other]..=high[other]).contains(&at[other])
                    };
                    let is_nearer = nearest.is_none_or(|before| distance < before.distance);
                    if distance > 1e-9 && distance.is_finite() && (0..3).all(is_in) && is_nearer {
                        let mut normal = DVec3::ZERO;
                        normal[axis] = sign;
                        let normal = if normal.dot(towards) > 0.0 { -normal } else { normal };
                        nearest = Some(Surface { distance, normal });
                    }
                }
            }
            nearest
        };
        let all = self.0.iter().filter_map(of_box);
        all.min_by(|a, b| a.distance.total_cmp(&b.distance))
    }

    fn is_in_house(&self, point: DVec3) -> bool {
        (-5.0..5.0).contains(&point.x) && (-5.0..5.0).contains(&point.y)
    }
}

fn boxed(low: [f64; 3], high: [f64; 3]) -> (DVec3, DVec3) {
    (DVec3::from_array(low), DVec3::from_array(high))
}

/// A room of 10 m by 10 m with a floor, walls with an open door in the far one, a table, and a
/// stair of steps of 17 cm to the right.
fn room() -> Vec<(DVec3, DVec3)> {
    let mut boxes = vec![
        boxed([-20.0, -20.0, -0.1], [20.0, 20.0, 0.0]),
        boxed([-5.2, -5.0, 0.0], [-5.0, 5.0, 3.0]),
        boxed([5.0, -5.0, 0.0], [5.2, 5.0, 3.0]),
        boxed([-5.0, -5.2, 0.0], [5.0, -5.0, 3.0]),
        boxed([-5.0, 5.0, 0.0], [-0.6, 5.2, 3.0]),
        boxed([0.6, 5.0, 0.0], [5.0, 5.2, 3.0]),
        boxed([-3.0, 1.0, 0.7], [-2.0, 2.0, 0.75]),
    ];
    boxes.extend((0..6).map(|step| {
        let (x, height) = (2.0 + 0.27 * f64::from(step), 0.17 * f64::from(step + 1));
        boxed([x, -2.0, 0.0], [5.0, -1.0, height])
    }));
    boxes
}

fn walker(eye: [f64; 3], direction: [f64; 3]) -> Walker {
    let spec = ViewSpec {
        vp: Some(DVec3::from_array(eye)),
        vd: Some(DVec3::from_array(direction)),
        vu: Some(DVec3::Z),
        ..ViewSpec::default()
    };
    let mut walker = Walker::new(spec, 1.0).unwrap();
    walker.surroundings = Some(Arc::new(Boxes(room())));
    walker
}

fn walk(walker: &mut Walker, seconds: f64) -> DVec3 {
    walker.controls = Controls { ahead: 1.0, ..Controls::default() };
    for _ in 0..(seconds / 0.02) as usize {
        walker.advance(0.02, None, walker.pose().direction);
    }
    walker.pose().eye
}

#[test]
fn walls_and_furniture_stop_a_walk_and_bend_it() {
    let eye = walk(&mut walker([0.0, 0.0, 1.6], [-1.0, 0.0, 0.0]), 10.0);
    assert!((eye.x + 4.8).abs() < 0.02 && (eye.z - 1.6).abs() < 1e-6, "{eye}");
    // Obliquely, it slides along the wall, into the corner.
    let eye = walk(&mut walker([0.0, 0.0, 1.6], [-1.0, -0.5, 0.0]), 20.0);
    assert!((eye.x + 4.8).abs() < 0.05 && (eye.y + 4.8).abs() < 0.05, "{eye}");
    // The table is below the eye, and stops the body.
    let eye = walk(&mut walker([-2.5, -1.0, 1.6], [0.0, 1.0, 0.0]), 10.0);
    let is_on_table = |eye: DVec3| (-3.0..-2.0).contains(&eye.x) && (1.0..2.0).contains(&eye.y);
    assert!(!is_on_table(eye) && eye.y > 0.5, "{eye}");
    let mut around = walker([-2.5, -1.0, 1.6], [0.0, 1.0, 0.0]);
    for _ in 0..100 {
        assert!(!is_on_table(walk(&mut around, 0.1)), "{:?}", around.pose());
    }
    // Seen from high above, nothing is in the way.
    let eye = walk(&mut walker([-2.5, -1.0, 2.9], [0.0, 1.0, 0.0]), 3.0);
    assert!(eye.y > 2.0, "{eye}");
    // Surfaces can be switched off.
    let mut ghost = walker([0.0, 0.0, 1.6], [-1.0, 0.0, 0.0]);
    ghost.is_solid = false;
    assert!(walk(&mut ghost, 10.0).x < -10.0);
}

#[test]
fn stairs_and_floors_carry() {
    let mut up = walker([0.0, -1.5, 1.6], [1.0, 0.0, 0.0]);
    let eye = walk(&mut up, 10.0);
    assert!((eye.z - 1.6 - 6.0 * 0.17).abs() < 1e-6 && eye.x > 4.5, "{eye}");
    let mut down = walker([4.5, -1.5, 1.6 + 1.02], [-1.0, 0.0, 0.0]);
    let eye = walk(&mut down, 3.5);
    assert!((eye.z - 1.6).abs() < 1e-6 && eye.x < 2.0, "{eye}");
    // A locked height stays.
    let mut locked = walker([0.0, -1.5, 1.6], [1.0, 0.0, 0.0]);
    locked.height_is_locked = true;
    assert!((walk(&mut locked, 10.0).z - 1.6).abs() < 1e-9);
}

#[test]
fn the_house_is_left_only_with_permission_and_back_returns() {
    let mut walker = walker([0.0, 0.0, 1.6], [0.0, 1.0, 0.0]);
    let home = *walker.view();
    walker.stay();
    assert!(walk(&mut walker, 10.0).y < 5.0);
    assert!(walker.take_exit() && !walker.take_exit());
    walker.may_leave = true;
    assert!(walk(&mut walker, 5.0).y > 6.0, "through the open door");
    assert!(walker.back());
    assert_eq!(walker.view().vp, home.vp);
}

#[test]
fn approaches_keep_a_distance_and_orbits_stop_at_walls() {
    let mut approaching = walker([0.0, 0.0, 1.6], [-1.0, 0.0, 0.0]);
    let point = DVec3::new(-5.0, 0.0, 1.6);
    for _ in 0..100 {
        approaching.wheel(1.0, Some(point), DVec3::NEG_X);
    }
    assert!((approaching.pose().eye.x + 4.75).abs() < 1e-6, "{:?}", approaching.pose());
    // Without a point, the wall stops it too.
    let mut blind = walker([0.0, 0.0, 1.6], [-1.0, 0.0, 0.0]);
    (0..100).for_each(|_| _ = blind.wheel(1.0, None, DVec3::NEG_X));
    assert!((blind.pose().eye.x + 4.75).abs() < 1e-6, "{:?}", blind.pose());
    // And the wall behind, if it backs off.
    (0..200).for_each(|_| _ = blind.wheel(-1.0, None, DVec3::NEG_X));
    assert!((blind.pose().eye.x - 4.75).abs() < 1e-6, "{:?}", blind.pose());
    let mut orbiting = walker([0.0, 0.0, 1.6], [-1.0, 0.0, 0.0]);
    (0..50).for_each(|_| _ = orbiting.orbit(0.4, 0.0, Some(point), DVec3::NEG_X));
    let eye = orbiting.pose().eye;
    assert!(eye.x > -4.8 && eye.x < 4.8 && eye.y.abs() < 4.8, "{eye}");
    assert!((eye.distance(point) - 5.0).abs() < 1e-6, "the distance stays");
}
