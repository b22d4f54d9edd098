//! The light of a texel of a reflection cube: its ray is followed from the object's centre to what
//! it shows, and takes the light that is stored there. Nothing is traced.

use crate::known::LightMemory;
use crate::light_store::{AtPanes, FaceClass, Follower, LightStore, RayContent, Trail, TrailEnd};
use glam::Vec3;
use holo_raycast::{NO_TRIANGLE, Ray};

/// Surfaces of the object itself that a ray from its centre passes.
const MOST_PASSED: usize = 32;

/// The light that is known of a scene.
#[derive(Clone, Copy)]
pub(crate) struct LightSources<'a> {
    pub follower: Follower<'a>,
    pub store: &'a LightStore,
    pub known: &'a LightMemory,
}

impl LightSources<'_> {
    /// Returns the radiance along a ray and the distance to what it shows. `width` is that of the
    /// texel at distance 1. The ray passes the triangles for which `own` is true. `None` if nothing
    /// is known, or if a mirror shows only a part of it.
    pub fn along(
        &self,
        mut ray: Ray,
        width: f32,
        own: &dyn Fn(u32) -> bool,
    ) -> Option<(Vec3, f32)> {
        let Follower { raycaster, materials, .. } = self.follower;
        let mut left = NO_TRIANGLE;
        for _ in 0..MOST_PASSED {
            let Some(hit) = raycaster.nearest_from(&ray, left) else {
                return Some((materials.sky_seen(ray.direction).into(), f32::INFINITY));
            };
            if own(hit.triangle) {
                (left, ray.t_min) = (hit.triangle, hit.t);
                continue;
            }
            let mut trail = Trail::new(ray, hit, AtPanes::Pass);
            let shown = self.follower.follow_to_end(&mut trail);
            if trail.passes_mirror() {
                return None;
            }
            let mut radiance = Vec3::ZERO;
            for end in trail.take_covers() {
                radiance += self.of_end(&end, width)?;
            }
            let (behind, distance) = match &shown {
                RayContent::Surface(end) if end.is_mirrored => (self.of_end(end, width)?, hit.t),
                RayContent::Surface(end) => (self.of_end(end, width)?, end.length),
                RayContent::Sky(share, direction) => {
                    let sky = Vec3::from(materials.sky_seen(*direction)) * Vec3::from(*share);
                    (sky, if trail.turns() { hit.t } else { f32::INFINITY })
                }
                RayContent::Light(..) | RayContent::Unknown => return None,
            };
            return Some((radiance + behind, distance));
        }
        None
    }

    /// Returns the radiance that comes back from the surface at the end of a way.
    fn of_end(&self, end: &TrailEnd, width: f32) -> Option<Vec3> {
        let finish = self.follower.finish(end.material);
        let (share, width) = (Vec3::from(end.share), width * end.length);
        if finish.shines(end.front) {
            let glow = Vec3::from(self.follower.glow(end, width));
            return Some(share * Vec3::from(finish.emission) * glow);
        }
        let found = self.known.on(finish, end, width);
        let light = found.or_else(|| {
            let serves = |face: FaceClass| face.serves(end.normal, end.material, end.direction);
            let sums = self.store.around(end.point, serves);
            (sums.count > 0).then(|| sums.mean())
        })?;
        let reflectance = finish.reflectance_by(self.follower.texture(end, width));
        Some(share * Vec3::from(reflectance) * light * self.follower.materials.unit)
    }
}
