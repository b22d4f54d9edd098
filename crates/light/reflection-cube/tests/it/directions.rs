//! Texels, their directions and solid angles.

use crate::Numbers;
use glam::Vec3;
use holo_reflection_cube::{ReflectionCube, bytes_of, resolution};
use std::f32::consts::{PI, SQRT_2};

fn cube(resolution: u32) -> ReflectionCube {
    ReflectionCube::new(Vec3::new(1.0, -2.0, 0.5), resolution)
}

#[test]
fn each_texel_is_that_of_its_own_direction() {
    for resolution in [8, 32, 128] {
        let cube = cube(resolution);
        assert_eq!(cube.len(), 6 * (resolution * resolution) as usize);
        for texel in 0..cube.len() {
            assert_eq!(cube.texel_of(cube.direction_of(texel)), texel);
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
            let middle = cube.direction_of(cube.texel_of(direction));
            assert!(direction.cross(middle).length().asin() <= most, "{direction}");
            assert!(direction.dot(middle) > 0.0);
        }
    }
}

#[test]
fn faces_and_axes_are_those_of_opengl() {
    // Each face's first texel lies at the start of its columns and rows.
    let cube = cube(512);
    let starts = [
        Vec3::new(1.0, 1.0, 1.0),
        Vec3::new(-1.0, 1.0, -1.0),
        Vec3::new(-1.0, 1.0, -1.0),
        Vec3::new(-1.0, -1.0, 1.0),
        Vec3::new(-1.0, 1.0, 1.0),
        Vec3::new(1.0, 1.0, -1.0),
    ];
    let row_ends = [
        Vec3::new(1.0, 1.0, -1.0),
        Vec3::new(-1.0, 1.0, 1.0),
        Vec3::new(1.0, 1.0, -1.0),
        Vec3::new(1.0, -1.0, 1.0),
        Vec3::new(1.0, 1.0, 1.0),
        Vec3::new(-1.0, 1.0, -1.0),
    ];
    for (face, (start, end)) in starts.into_iter().zip(row_ends).enumerate() {
        let first = face * 512 * 512;
        for (texel, corner) in [(first, start), (first + 511, end)] {
            assert!(cube.direction_of(texel).dot(corner.normalize()) > 1.0 - 1e-5, "{face}");
        }
    }
}

#[test]
fn solid_angles_sum_to_the_sphere_and_share_it_as_directions_do() {
    let cube = cube(8);
    let whole: f32 = (0..cube.len()).map(|texel| cube.solid_angle_of(texel)).sum();
    assert!((whole - 4.0 * PI).abs() < 1e-4, "{whole}");
    let (mut numbers, rays) = (Numbers(2), 400_000);
    let mut found = vec![0u32; cube.len()];
    (0..rays).for_each(|_| found[cube.texel_of(numbers.direction())] += 1);
    // Chi-square with 383 degrees of freedom: mean 383, standard deviation 27.7.
    let chi: f32 = (0..cube.len())
        .map(|texel| {
            let expected = rays as f32 * cube.solid_angle_of(texel) / (4.0 * PI);
            (found[texel] as f32 - expected).powi(2) / expected
        })
        .sum();
    assert!((chi - 383.0).abs() < 5.0 * 27.7, "{chi}");
}

#[test]
fn a_resolution_is_a_power_of_two_within_bounds_and_states_its_memory() {
    for (asked, given) in [(0, 8), (8, 8), (9, 16), (100, 128), (512, 512), (u32::MAX, 512)] {
        let cube = cube(asked);
        assert_eq!(cube.resolution(), given);
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
