//! The small spheres that stand for punctual lights where mirrors and glass throw their light onto
//! surfaces.
//!
//! Invariant: a sphere counts only after a path has been scattered with a density, and only if
//! nothing but this path can find its light. Eyes do not see it, directly or in mirrors, and it
//! hides nothing.

use std::f32::consts::PI;

use glam::Vec3;

use super::Lights;
use super::point::PreparedPoint;

/// The first part of a ray.
#[derive(Clone, Copy)]
struct Segment {
    origin: Vec3,
    direction: Vec3,
    t_max: f32,
}

impl Segment {
    /// Returns whether a sphere may reach the ray's line.
    fn is_near(&self, center: Vec3, radius: f32) -> bool {
        (center - self.origin).cross(self.direction).length_squared() <= radius * radius
    }

    /// Returns the light of a sphere. It is a disc that faces the ray's origin.
    fn light(&self, point: &PreparedPoint) -> Vec3 {
        let along = (point.position - self.origin).dot(self.direction);
        if along <= 0.0 || along >= self.t_max || !self.is_near(point.position, point.radius) {
            return Vec3::ZERO;
        }
        point.intensity(-self.direction) / (PI * point.radius * point.radius)
    }
}

impl Lights {
    /// Returns the light of spheres on the first `t_max` of a ray.
    pub(crate) fn spheres_along(&self, origin: Vec3, direction: Vec3, t_max: f32) -> Vec3 {
        match self.tree.points.is_empty() {
            true => Vec3::ZERO,
            false => self.spheres_below(0, &Segment { origin, direction, t_max }),
        }
    }

    /// Returns the light of the spheres below a node. The tree has at most about 60 levels.
    fn spheres_below(&self, node: usize, segment: &Segment) -> Vec3 {
        let node = &self.tree.nodes[node];
        let mut light = Vec3::ZERO;
        for slot in 0..node.used() {
            let (center, radius) = node.sphere(slot);
            // Nodes contain the lights' places, and spheres reach beyond.
            if segment.is_near(center, radius + self.tree.greatest_radius) {
                light += match node.child(slot) {
                    Ok(next) => self.spheres_below(next, segment),
                    Err(emitter) => {
                        self.tree.point(emitter).map_or(Vec3::ZERO, |point| segment.light(point))
                    }
                };
            }
        }
        light
    }
}
