//! Rays that leave the object beside the centre.

use crate::{Numbers, fill, light};
use glam::{Quat, Vec3};
use holo_reflection_cube::{ReflectionCube, ReflectionSample};

const CENTRE: Vec3 = Vec3::new(0.4, 0.2, -0.3);

/// A room with flat walls around the origin, which may be turned.
struct Room {
    half: Vec3,
    turn: Quat,
}

impl Room {
    /// The distance to the walls along a ray.
    fn distance(&self, origin: Vec3, direction: Vec3) -> f32 {
        let (origin, direction) = (self.turn.inverse() * origin, self.turn.inverse() * direction);
        let to_wall = |axis: usize| {
            let wall = self.half[axis].copysign(direction[axis]);
            (wall - origin[axis]) / direction[axis]
        };
        (0..3).map(to_wall).fold(f32::INFINITY, f32::min)
    }
}

/// Light of a point, which grows along a line.
fn shine(point: Vec3) -> f32 {
    10.0 + point.dot(Vec3::new(1.0, 0.7, -0.4))
}

/// The root mean square and the greatest error of light, and the greatest relative error of
/// distance, of rays from a ball in a room.
fn errors(cube: &ReflectionCube, radius: f32, truth: impl Fn(Vec3, Vec3) -> f32) -> [f32; 3] {
    let (mut numbers, rays) = (Numbers(6), 20_000);
    let [mut square, mut most, mut of_distance] = [0.0f32; 3];
    for _ in 0..rays {
        let normal = numbers.direction();
        let direction = numbers.direction();
        let direction = if direction.dot(normal) < 0.0 { -direction } else { direction };
        let origin = CENTRE + radius * normal;
        let distance = truth(origin, direction);
        let found = light(cube.look_up(origin, direction, 0.0..=0.0));
        let error = found.radiance[0] - shine(origin + distance * direction);
        square += error * error / rays as f32;
        most = most.max(error.abs());
        of_distance = of_distance.max((found.distance / distance - 1.0).abs());
    }
    [square.sqrt(), most, of_distance]
}

#[test]
fn in_a_convex_room_rays_beside_the_centre_find_what_they_hit() {
    for turn in [Quat::IDENTITY, Quat::from_euler(glam::EulerRot::XYZ, 0.4, 0.7, 0.2)] {
        let room = Room { half: Vec3::new(2.0, 1.5, 2.5), turn };
        let mut cube = ReflectionCube::new(CENTRE, 128);
        fill(&mut cube, |direction| {
            let distance = room.distance(CENTRE, direction);
            (distance, shine(CENTRE + distance * direction))
        });
        let [rms, most, of_distance] =
            errors(&cube, 0.5, |origin, direction| room.distance(origin, direction));
        // A texel is up to 0.05 wide at 3 from the centre, and light changes by 1.3 per unit.
        assert!(rms < 2e-3 && most < 0.07, "{rms} {most}");
        assert!(of_distance < 0.05, "{of_distance}");
        let without = |origin: Vec3, direction: Vec3| {
            let seen = light(cube.look_up(CENTRE, direction, 0.0..=0.0)).radiance[0];
            seen - shine(origin + room.distance(origin, direction) * direction)
        };
        // Without parallax, light is that of a point about half a unit away.
        let mut numbers = Numbers(6);
        let rays = 5000;
        let square: f32 = (0..rays)
            .map(|_| {
                let origin = CENTRE + 0.5 * numbers.direction();
                without(origin, numbers.direction()).powi(2) / rays as f32
            })
            .sum();
        assert!(square.sqrt() > 100.0 * rms, "{}", square.sqrt());
    }
}

#[test]
fn errors_in_a_round_room_fall_with_the_resolution() {
    let distance = |origin: Vec3, direction: Vec3| {
        let along = origin.dot(direction);
        (along * along - origin.length_squared() + 9.0).sqrt() - along
    };
    let of_resolution = [16, 32, 64, 128].map(|resolution| {
        let mut cube = ReflectionCube::new(CENTRE, resolution);
        fill(&mut cube, |direction| {
            let distance = distance(CENTRE, direction);
            (distance, shine(CENTRE + distance * direction))
        });
        errors(&cube, 0.6, distance)[0]
    });
    for pair in of_resolution.windows(2) {
        assert!(pair[1] < 0.55 * pair[0], "{of_resolution:?}");
    }
}

#[test]
fn samples_from_the_surface_serve_rays_from_elsewhere() {
    let room = Room { half: Vec3::splat(2.0), turn: Quat::IDENTITY };
    let mut cube = ReflectionCube::new(CENTRE, 32);
    let mut numbers = Numbers(7);
    for _ in 0..400_000 {
        let normal = numbers.direction();
        let direction = numbers.direction();
        let direction = if direction.dot(normal) < 0.0 { -direction } else { direction };
        let origin = CENTRE + 0.5 * normal;
        let distance = room.distance(origin, direction);
        let radiance = [shine(origin + distance * direction); 3];
        let sample =
            ReflectionSample { origin, direction, distance, radiance, count: 1, generation: 0 };
        assert!(cube.insert(&sample));
    }
    cube.refresh_levels();
    assert_eq!(cube.statistics().valid, cube.grid().len());
    let [rms, ..] = errors(&cube, 0.3, |origin, direction| room.distance(origin, direction));
    assert!(rms < 0.02, "{rms}");
}

#[test]
fn the_sky_does_not_shift() {
    let mut cube = ReflectionCube::new(CENTRE, 64);
    fill(&mut cube, |direction| (f32::INFINITY, 2.0 + direction.x));
    let mut numbers = Numbers(8);
    for _ in 0..2000 {
        let direction = numbers.direction();
        let beside = cube.look_up(CENTRE + 3.0 * numbers.direction(), direction, 0.0..=0.0);
        assert_eq!(beside, cube.look_up(CENTRE, direction, 0.0..=0.0));
        let seen = light(beside);
        assert!((seen.radiance[0] - 2.0 - direction.x).abs() < 0.01);
        assert_eq!(seen.distance, f32::INFINITY);
    }
}

#[test]
fn a_texel_states_the_distance_of_what_it_shows() {
    let room = Room { half: Vec3::new(2.0, 1.5, 2.5), turn: Quat::IDENTITY };
    let mut cube = ReflectionCube::new(CENTRE, 16);
    fill(&mut cube, |direction| (room.distance(CENTRE, direction), 1.0));
    for texel in 0..cube.grid().len() {
        let distance = room.distance(CENTRE, cube.grid().direction_of(texel));
        let known = cube.light_of(texel).expect("valid");
        assert!((known.distance / distance - 1.0).abs() < 1e-5);
    }
}

/// A cube around zero over a floor at this height, under the sky. The floor ends at `end`.
fn floor(height: f32, end: f32) -> ReflectionCube {
    let mut cube = ReflectionCube::new(Vec3::ZERO, 64);
    fill(&mut cube, |direction| {
        let distance = height / direction.z;
        let is_floor = direction.z < 0.0 && direction.x * distance < end;
        if is_floor { (distance, 1.0) } else { (f32::INFINITY, 5.0) }
    });
    cube
}

#[test]
fn a_floor_is_seen_in_its_place_from_points_before_the_sky() {
    let cube = floor(-1.0, f32::INFINITY);
    let direction = Vec3::new(0.6, 0.0, -0.8);
    for point in [Vec3::new(0.3, 0.2, 0.25), Vec3::new(0.3, 0.2, -0.25)] {
        let distance = (point.z + 1.0) / 0.8;
        let seen = light(cube.look_up(point, direction, 0.0..=0.0));
        assert!((seen.distance / distance - 1.0).abs() < 0.01, "{point}: {seen:?}");
        let hit = point + distance * direction;
        let apart = cube.direction_seen(point, direction).angle_between(hit);
        assert!(apart < 0.03, "{point}: {apart}");
    }
}

#[test]
fn a_ray_that_passes_behind_an_edge_sees_what_is_beyond() {
    let cube = floor(-0.4, 1.2);
    let point = Vec3::new(0.4, 0.0, 0.4);
    for (down, passes) in [(0.2, true), (0.5, true), (0.7, true), (1.4, false), (3.0, false)] {
        let direction = Vec3::new(1.0, 0.0, -down).normalize();
        let texel = cube.grid().texel_of(cube.direction_seen(point, direction));
        let seen = cube.light_of(texel).expect("all texels are valid");
        assert_eq!(seen.radiance[0], if passes { 5.0 } else { 1.0 }, "{down}");
    }
}

#[test]
fn nothing_is_seen_between_two_surfaces_at_different_distances() {
    // A plane at x = 5, and one before its left half at x = 1.
    let mut cube = ReflectionCube::new(Vec3::ZERO, 64);
    fill(&mut cube, |direction| {
        let depth = if direction.y > 0.0 { 1.0 } else { 5.0 };
        (if direction.x > 0.0 { depth / direction.x } else { f32::INFINITY }, 1.0)
    });
    let mut numbers = Numbers(11);
    for _ in 0..10_000 {
        let point = 0.4 * numbers.direction();
        let direction = (Vec3::X + 0.5 * numbers.direction()).normalize();
        let seen = light(cube.look_up(point, direction, 0.0..=0.0));
        let depth = (point + seen.distance * direction).x;
        // A ray that passes behind the border has about the distance from the centre.
        assert!(!(1.5..4.0).contains(&depth), "{point} {direction}: {depth}");
    }
}
