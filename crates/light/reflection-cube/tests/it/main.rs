//! Behaviour of reflection cubes, compared with closed forms.

mod directions;
mod levels;
mod means;
mod parallax;

use glam::Vec3;
use holo_reflection_cube::{CubeAnswer, CubeLight, ReflectionCube, ReflectionSample};

/// Numbers that look random, from 0 to 1.
struct Numbers(u64);

impl Numbers {
    fn uniform(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 40) as f32 / (1u64 << 24) as f32
    }

    /// A direction, uniform over the sphere.
    fn direction(&mut self) -> Vec3 {
        let (height, angle) = (2.0 * self.uniform() - 1.0, std::f32::consts::TAU * self.uniform());
        let radius = (1.0 - height * height).max(0.0).sqrt();
        Vec3::new(radius * angle.cos(), radius * angle.sin(), height).normalize()
    }
}

/// A sample from the centre, of the first generation.
fn sample(cube: &ReflectionCube, direction: Vec3, distance: f32, light: f32) -> ReflectionSample {
    let origin = cube.centre();
    let radiance = [light, 2.0 * light, 3.0 * light];
    ReflectionSample { origin, direction, distance, radiance, count: 1, generation: 0 }
}

/// Fills all texels: `seen` returns distance and light in a direction from the centre.
fn fill(cube: &mut ReflectionCube, seen: impl Fn(Vec3) -> (f32, f32)) {
    for texel in 0..cube.grid().len() {
        let direction = cube.grid().direction_of(texel);
        let (distance, light) = seen(direction);
        assert!(cube.insert(&sample(cube, direction, distance, light)));
    }
    cube.refresh_levels();
}

/// The light of an answer.
#[track_caller]
fn light(answer: CubeAnswer) -> CubeLight {
    let CubeAnswer::Light(light) = answer else { unreachable!("no light: {answer:?}") };
    light
}
