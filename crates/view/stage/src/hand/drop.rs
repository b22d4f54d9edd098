//! Models that a person drops on the picture.

use std::path::PathBuf;

use glam::DVec3;
use holo_picture::View;
use holo_raycast::Raycaster;
use holo_session::{ObjectOrder, ObjectPose};

use super::Hand;

/// Least cosine between a surface's normal and the up axis at which things stand on it.
const LEVEL: f64 = 0.7;

/// Distance from a steep surface at which a model that is dropped on it falls, metres.
const BEFORE_WALL: f64 = 0.3;

impl Hand {
    /// Carries a model into the scene, to where the picture shows this place.
    pub(super) fn drop_model(&mut self, path: PathBuf, at: [f64; 2]) {
        let Some((scene, shown)) = self.scene.as_ref().zip(self.last.as_ref()) else {
            return self.refuse(format!(
                "the scene's model is not here, so nobody knows what the picture shows there: \
                 type `object add {} at X Y Z`",
                path.display()
            ));
        };
        let (up, metre) = (DVec3::from_array(self.facts.up), 1.0 / self.facts.unit);
        match place(scene, &shown.view, at, up, metre) {
            Some(at) => {
                let pose = ObjectPose { at, turn: 0.0, scale: 1.0 };
                self.follow(ObjectOrder::Add { path, name: None, pose });
            }
            None => self.refuse("nothing is there to put it on: drop it on a surface".to_owned()),
        }
    }
}

/// Returns the place to stand on that a view shows at shares of the picture from its left and top.
/// Below a steep surface it is what lies below a point before it.
fn place(
    scene: &Raycaster,
    view: &View,
    [across, down]: [f64; 2],
    up: DVec3,
    metre: f64,
) -> Option<DVec3> {
    let (eye, towards, _) = view.clipped_ray(across, 1.0 - down)?;
    let (point, normal) = surface(scene, eye, towards)?;
    if normal.dot(up) >= LEVEL {
        return Some(point);
    }
    let before = point + normal * (BEFORE_WALL * metre);
    Some(surface(scene, before, -up)?.0)
}

/// Returns the first point along a ray, and its normal on the side that is seen.
fn surface(scene: &Raycaster, origin: DVec3, direction: DVec3) -> Option<(DVec3, DVec3)> {
    let (ray, _) = scene.localize(origin, direction)?;
    let hit = scene.nearest(&ray)?;
    let point = scene.scene().origin + scene.point(hit.triangle, hit.u, hit.v).as_dvec3();
    let normal = scene.geometric_normal(hit.triangle).as_dvec3();
    Some((point, if normal.dot(direction) > 0.0 { -normal } else { normal }))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use holo_scene::{Material, Scene};

    use super::*;

    #[test]
    fn a_model_stands_on_the_floor_that_is_seen_or_below_the_wall_that_is_seen() {
        // A floor of 10 x 10 at z = 0 and a wall at y = 5.
        let corner = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
        let corners = [
            corner(-5.0, -5.0, 0.0),
            corner(5.0, -5.0, 0.0),
            corner(5.0, 5.0, 0.0),
            corner(-5.0, 5.0, 0.0),
            corner(5.0, 5.0, 4.0),
            corner(-5.0, 5.0, 4.0),
        ];
        let triangles = [[0, 1, 2], [0, 2, 3], [3, 2, 4], [3, 4, 5]];
        let materials = vec![Material::grey("plaster")];
        let made = Scene::from_world(&corners, &triangles, &[0; 4], materials, [0.0; 3]).unwrap();
        let scene = Raycaster::build(Arc::new(made.0)).unwrap();
        let view = |towards: DVec3| {
            let eye = DVec3::new(0.0, 0.0, 1.6);
            View::new(eye, towards - eye, DVec3::Z, Some(50.0), None, (100, 100)).unwrap()
        };
        let dropped = |towards| place(&scene, &view(towards), [0.5, 0.5], DVec3::Z, 1.0);
        let floor = dropped(DVec3::new(1.0, 2.0, 0.0)).unwrap();
        assert!(floor.distance(DVec3::new(1.0, 2.0, 0.0)) < 1e-4, "{floor}");
        let below_wall = dropped(DVec3::new(1.0, 5.0, 2.0)).unwrap();
        assert!(below_wall.distance(DVec3::new(1.0, 4.7, 0.0)) < 1e-4, "{below_wall}");
        assert_eq!(dropped(DVec3::new(0.0, 1.0, 9.0)), None, "the sky");
    }
}
