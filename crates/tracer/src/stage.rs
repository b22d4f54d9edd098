//! Where lights stand as a vertex sees them, and how much of their light arrives there.

use std::fmt::Debug;
use std::sync::Arc;

use glam::Vec3;
use holo_raycast::{Raycaster, SurfacePoint};

use crate::panes::Panes;

/// Lights by number, those that a tree of lights chooses among. Each is a triangle.
pub(crate) trait Stage: Debug + Send + Sync {
    /// How many places of a cell look for them.
    fn probes(&self) -> usize;

    /// The triangle of the scene that shines.
    fn triangle(&self, light: u32) -> u32;

    /// Its vertices as they are seen, counter-clockwise from its front.
    fn vertices(&self, light: u32) -> [Vec3; 3];

    /// Point at barycentrics as it is seen, and its normal.
    fn point(&self, light: u32, barycentrics: [f32; 2]) -> (Vec3, Vec3);

    /// Whether that point may be seen from a place, as far as can be told without rays.
    fn may_show(&self, at: Vec3, light: u32, barycentrics: [f32; 2]) -> bool;

    /// The share of the light from there that arrives `at` a surface.
    fn arriving(&self, at: &SurfacePoint, light: u32, barycentrics: [f32; 2]) -> Vec3;
}

/// The lamps of a scene, where they are; numbered as triangles are.
#[derive(Debug)]
pub(crate) struct Lamps {
    pub raycaster: Arc<Raycaster>,
    /// What their light goes through.
    pub panes: Panes,
}

impl Stage for Lamps {
    #[inline]
    fn probes(&self) -> usize {
        4
    }

    #[inline]
    fn triangle(&self, light: u32) -> u32 {
        light
    }

    #[inline]
    fn vertices(&self, light: u32) -> [Vec3; 3] {
        self.raycaster.vertices(light)
    }

    #[inline]
    fn point(&self, light: u32, [u, v]: [f32; 2]) -> (Vec3, Vec3) {
        // The point itself and not the one that `surface` keeps off the edges, which is another one on small triangles far from the
        // scene's origin: light in a glowing box of 5 mm, 250 m from there, was 2 to 3 % too bright.
        (self.raycaster.point(light, u, v), self.raycaster.geometric_normal(light))
    }

    #[inline]
    fn may_show(&self, _: Vec3, _: u32, _: [f32; 2]) -> bool {
        true
    }

    #[inline]
    fn arriving(&self, at: &SurfacePoint, light: u32, [u, v]: [f32; 2]) -> Vec3 {
        if light == at.triangle {
            return Vec3::ZERO;
        }
        self.panes.between(&self.raycaster, at, &self.raycaster.surface(light, u, v))
    }
}
