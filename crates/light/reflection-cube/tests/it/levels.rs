//! Blurrier levels, and smooth look-ups.

use crate::{Numbers, fill, light, sample};
use glam::Vec3;
use holo_reflection_cube::{CubeAnswer, ReflectionCube};

/// An angle that is wider than any level.
const WIDEST: f32 = 100.0;

#[test]
fn equal_light_is_equal_at_every_blur() {
    let mut cube = ReflectionCube::new(Vec3::ZERO, 64);
    fill(&mut cube, |_| (5.0, 0.7));
    let mut numbers = Numbers(9);
    for spread in [0.0, 0.04, 0.1, 0.35, 1.0, 3.0, WIDEST] {
        for _ in 0..500 {
            let found = light(cube.look_up(Vec3::ZERO, numbers.direction(), spread..=spread));
            assert!((found.radiance[0] - 0.7).abs() < 1e-5);
        }
    }
}

#[test]
fn levels_average_valid_texels_only_by_their_solid_angle() {
    let mut cube = ReflectionCube::new(Vec3::ZERO, 32);
    let (mut sum, mut whole) = (0.0, 0.0);
    // A third of the texels of the first face.
    for texel in (0..32 * 32).step_by(3) {
        let value = texel as f32;
        cube.insert(&sample(&cube, cube.grid().direction_of(texel), 1.0, value));
        sum += cube.grid().solid_angle_of(texel) * value;
        whole += cube.grid().solid_angle_of(texel);
    }
    assert_eq!(cube.look_up(Vec3::ZERO, Vec3::X, WIDEST..=WIDEST), CubeAnswer::Unknown);
    cube.refresh_levels();
    let mean = light(cube.look_up(Vec3::ZERO, Vec3::X, WIDEST..=WIDEST)).radiance[0];
    assert!((mean / (sum / whole) - 1.0).abs() < 1e-4, "{mean} {}", sum / whole);
    assert_eq!(cube.look_up(Vec3::ZERO, Vec3::NEG_X, 0.0..=WIDEST), CubeAnswer::Unknown);
}

#[test]
fn a_texel_whose_light_is_replaced_stays_where_it_is() {
    let mut cube = ReflectionCube::new(Vec3::ZERO, 16);
    cube.insert(&sample(&cube, cube.grid().direction_of(3), 2.0, 1.0));
    assert!(!cube.set_radiance(4, [1.0; 3]) && !cube.set_radiance(3, [1.0, f32::NAN, 1.0]));
    assert!(cube.set_radiance(3, [0.5; 3]));
    cube.refresh_levels();
    let known = cube.light_of(3).expect("valid");
    assert!(known.radiance == [0.5; 3] && (known.distance - 2.0).abs() < 1e-4);
    let mean = light(cube.look_up(Vec3::ZERO, cube.grid().direction_of(3), WIDEST..=WIDEST));
    assert_eq!(mean.radiance, [0.5; 3]);
}

#[test]
fn an_unknown_texel_takes_the_least_blur_that_knows_something() {
    let mut cube = ReflectionCube::new(Vec3::ZERO, 64);
    for texel in 0..cube.grid().len() {
        let direction = cube.grid().direction_of(texel);
        if direction.dot(Vec3::X) < 0.995 {
            cube.insert(&sample(&cube, direction, 5.0, 1.0));
        }
    }
    cube.refresh_levels();
    assert_eq!(cube.look_up(Vec3::ZERO, Vec3::X, 0.0..=0.0), CubeAnswer::Unknown);
    let found = light(cube.look_up(Vec3::ZERO, Vec3::X, 0.0..=0.5));
    assert!(found.spread > 0.03 && found.spread <= 0.5, "{}", found.spread);
    assert!((found.radiance[0] - 1.0).abs() < 1e-5);
}

#[test]
fn smooth_light_is_smooth_across_the_edges_of_faces() {
    let mut cube = ReflectionCube::new(Vec3::ZERO, 32);
    fill(&mut cube, |direction| (4.0, 2.0 + direction.x + direction.y * direction.z));
    let mut numbers = Numbers(10);
    for _ in 0..20_000 {
        let direction = numbers.direction();
        // Most of these lie near an edge.
        let size = direction.abs().max_element();
        let near = (direction / size).clamp(Vec3::splat(-1.0), Vec3::splat(1.0));
        let edge = (1.5 * near).clamp(Vec3::splat(-1.0), Vec3::splat(1.0)).normalize();
        let found = light(cube.look_up(Vec3::ZERO, edge, 0.0..=0.0)).radiance[0];
        assert!((found - 2.0 - edge.x - edge.y * edge.z).abs() < 0.05, "{edge} {found}");
    }
}

#[test]
fn a_wider_blur_has_the_mean_of_a_wider_place() {
    // One half of the sphere is bright: far inside it, narrow blurs see no dark.
    let mut cube = ReflectionCube::new(Vec3::ZERO, 64);
    fill(&mut cube, |direction| (4.0, if direction.y > 0.0 { 1.0 } else { 0.0 }));
    let at = |spread: f32| {
        let direction = Vec3::new(1.0, 0.2, 0.0).normalize();
        light(cube.look_up(Vec3::ZERO, direction, spread..=spread)).radiance[0]
    };
    assert!([0.0, 0.05].iter().all(|&spread| (at(spread) - 1.0).abs() < 1e-5));
    // Exactly between the halves, the widest level has their mean.
    let middle = light(cube.look_up(Vec3::ZERO, Vec3::X, WIDEST..=WIDEST)).radiance[0];
    assert!((middle - 0.5).abs() < 1e-4 && (0.5..0.7).contains(&at(WIDEST)), "{middle}");
    let widening = [0.05, 0.2, 0.5, 1.0, 2.0].map(at);
    assert!(widening.windows(2).all(|pair| pair[1] <= pair[0] + 1e-6), "{widening:?}");
}
