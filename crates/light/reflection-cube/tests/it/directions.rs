//! Texels, their directions and solid angles.

use crate::Numbers;
use glam::Vec3;
use holo_reflection_cube::{FACE_AXES, ReflectionCube, bytes_of, resolution};
use std::f32::consts::{PI, SQRT_2};

fn cube(resolution: u32) -> ReflectionCube {
    ReflectionCube::new(Vec3::new(1.0, -2.0, 0.5), resolution)
}

#[test]
fn each_texel_is_that_of_its_own_direction() {
    for resolution in [8, 32, 128] {
        let cube = cube(resolution);
        assert_eq!(cube.grid().len(), 6 * (resolution * resolution) as usize);
        for texel in 0..cube.grid().len() {
            assert_eq!(cube.grid().texel_of(cube.grid().direction_of(texel)), texel);
        }
    }
}

#[test]
fn a_direction_lies_within_half_a_diagonal_of_its_texel() {
    let mut numbers = Numbers(1);
    for resolution in [8, 64, 512] {
        let cube = cube(resolution);
        let most = (SQRT_2 / resolution as f32).atan() + 1e-3 / resolution as f32;
        for _ in 0..20_000 {
            let direction = numbers.direction();
            let middle = cube.grid().direction_of(cube.grid().texel_of(direction));
            assert!(direction.cross(middle).length().asin() <= most, "{direction}");
            assert!(direction.dot(middle) > 0.0);
        }
    }
}

#[test]
fn faces_are_views_from_the_centre_row_by_row_from_the_top() {
    let cube = cube(512);
    for (face, [outward, right, down]) in FACE_AXES.into_iter().enumerate() {
        // An eye that looks outward has its right hand there.
        assert_eq!(outward.cross(-down), right, "{face}");
        for (texel, corner) in [(0, outward - right - down), (511, outward + right - down)] {
            let direction = cube.grid().direction_of(face * 512 * 512 + texel);
            assert!(direction.dot(corner.normalize()) > 1.0 - 1e-5, "{face}");
        }
    }
}

#[test]
fn solid_angles_are_those_of_rectangles_seen_from_the_centre() {
    // The solid angle of the rectangle from the middle of a face to (x, y).
    let until = |x: f64, y: f64| (x * y).atan2((x * x + y * y + 1.0).sqrt());
    for (resolution, error) in [(8, 3e-4), (16, 2e-5), (64, 2e-6)] {
        let cube = cube(resolution);
        let at = |number: u32| 2.0 * f64::from(number) / f64::from(resolution) - 1.0;
        for number in 0..resolution * resolution {
            let (column, row) = (number % resolution, number / resolution);
            let (left, right, top, bottom) = (at(column), at(column + 1), at(row), at(row + 1));
            let exact =
                until(right, bottom) - until(left, bottom) - until(right, top) + until(left, top);
            let found = f64::from(cube.grid().solid_angle_of(number as usize));
            assert!((found / exact - 1.0).abs() < error, "{resolution}: {found} {exact}");
        }
    }
}

#[test]
fn solid_angles_sum_to_the_sphere_and_share_it_as_directions_do() {
    let cube = cube(8);
    let whole: f32 = (0..cube.grid().len()).map(|texel| cube.grid().solid_angle_of(texel)).sum();
    assert!((whole - 4.0 * PI).abs() < 1e-4, "{whole}");
    let (mut numbers, rays) = (Numbers(2), 400_000);
    let mut found = vec![0u32; cube.grid().len()];
    (0..rays).for_each(|_| found[cube.grid().texel_of(numbers.direction())] += 1);
    // Chi-square with 383 degrees of freedom: mean 383, standard deviation 27.7.
    let chi: f32 = (0..cube.grid().len())
        .map(|texel| {
            let expected = rays as f32 * cube.grid().solid_angle_of(texel) / (4.0 * PI);
            (found[texel] as f32 - expected).powi(2) / expected
        })
        .sum();
    assert!((chi - 383.0).abs() < 5.0 * 27.7, "{chi}");
}

#[test]
fn a_resolution_is_a_power_of_two_within_bounds_and_states_its_memory() {
    for (asked, given) in [(0, 8), (8, 8), (9, 16), (100, 128), (512, 512), (u32::MAX, 512)] {
        let cube = cube(asked);
        assert_eq!(cube.grid().resolution(), given);
        assert_eq!(cube.statistics().bytes, bytes_of(asked));
    }
    // 20 bytes for a texel of any level, and a bit.
    let texels = |side: usize| 6 * side * side;
    let levels: usize = [16, 8, 4, 2, 1].into_iter().map(texels).sum();
    assert_eq!(bytes_of(16), 20 * levels + texels(16) / 8);
    assert!(bytes_of(512) < 43_000_000);
    for (pixels, chosen) in [(0.0, 8), (30.0, 32), (200.0, 256), (1e9, 512), (f32::NAN, 8)] {
        assert_eq!(resolution(pixels), chosen, "{pixels}");
    }
}

#[test]
fn values_that_are_linear_on_faces_are_interpolated_exactly() {
    let (cube, slope) = (cube(16), Vec3::new(0.3, -0.8, 0.5));
    // The value of the point where a direction meets the cube of side 2.
    let value = |direction: Vec3| direction.dot(slope) / direction.abs().max_element();
    let mut numbers = Numbers(3);
    for _ in 0..20_000 {
        let direction = numbers.direction();
        let around = cube.grid().texels_around(direction);
        let sum: f32 = around.iter().map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-5 && around.iter().all(|(_, weight)| *weight >= 0.0));
        let found: f32 = around
            .iter()
            .map(|(texel, weight)| weight * value(cube.grid().direction_of(*texel)))
            .sum();
        // Beyond the edges of a face, texels are those of others, about a texel away.
        let second = direction.abs() / direction.abs().max_element();
        let is_inside = second.to_array().iter().filter(|c| **c > 15.0 / 16.0).count() == 1;
        let error = if is_inside { 1e-4 } else { 1.0 / 8.0 };
        assert!((found - value(direction)).abs() < error, "{direction}: {found}");
    }
}
