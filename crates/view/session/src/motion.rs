//! How objects of the scene have moved from one session to the next, for drivers whose points
//! outlive a session.

use std::sync::Arc;

use glam::DVec3;
use holo_display::ObjectMotion;
use holo_raycast::{Ray, Raycaster};
use holo_section::{Section, distance::LINEAR_CODES};

use super::scene_change::{PlacedModel, map_of};

/// Steps of distance codes by which a stored point may lie beside its surface. Half a step is the
/// greatest error of a code.
const STEPS: f64 = 1.0;

/// Directions of the short rays that look for a surface. Whatever its normal is, one of them meets
/// it at an angle of at least 50 degrees.
const ALONG: [DVec3; 7] = [
    DVec3::X,
    DVec3::Y,
    DVec3::Z,
    DVec3::new(1.0, 1.0, 1.0),
    DVec3::new(1.0, 1.0, -1.0),
    DVec3::new(1.0, -1.0, 1.0),
    DVec3::new(-1.0, 1.0, 1.0),
];

/// An object of the scene that was moved or taken out.
#[derive(Clone, Debug)]
pub struct MovedObject {
    /// The object as it was.
    pub before: PlacedModel,
    /// The rows of the map from its model to the scene now. `None` if it is no longer there.
    pub now: Option<[[f64; 4]; 3]>,
}

impl MovedObject {
    /// Returns the motion of points that were seen through these sections. `None` if the model
    /// cannot be traced.
    pub(super) fn motion(&self, sections: &[Section]) -> Option<ObjectMotion> {
        let PlacedModel { name, place, model, .. } = &self.before;
        let (to_scene, raycaster) = (map_of(place), Raycaster::build(Arc::clone(model)).ok()?);
        let (to_model, scale) = (to_scene.inverse(), to_scene.matrix3.x_axis.length());
        let (low, high) = model.bounds();
        let longest = sections.iter().map(Section::diagonal).fold(0.0, f64::max);
        let margin = STEPS * longest / LINEAR_CODES / scale;
        let lay_on = move |point: DVec3| {
            let point = to_model.transform_point3(point);
            let is_near = point.cmpge(low - margin).all() && point.cmple(high + margin).all();
            is_near && touches(&raycaster, point, margin)
        };
        let to_now = self.now.map(|now| map_of(&now) * to_model);
        let middle = to_scene.transform_point3((low + high) * 0.5);
        let sphere = (middle, (high - low).length() * 0.5 * scale);
        Some(ObjectMotion { name: name.clone(), lay_on: Arc::new(lay_on), to_now, sphere })
    }
}

/// Returns whether a surface is about as near to a point as a distance.
fn touches(raycaster: &Raycaster, point: DVec3, distance: f64) -> bool {
    ALONG.iter().any(|along| {
        let along = along.normalize();
        let ray = raycaster.localize(point - along * distance, along);
        ray.is_some_and(|(ray, skipped)| {
            raycaster.occluded(&Ray { t_max: (2.0 * distance - skipped) as f32, ..ray })
        })
    })
}

#[cfg(test)]
mod tests {
    use glam::DAffine3;
    use holo_local_objects::ObjectPose;
    use holo_scene::{Material, Scene};
    use holo_section::{SectionSpec, ViewClass};

    use super::*;

    #[test]
    fn points_near_the_surface_of_a_moved_object_lie_on_it_and_no_others() {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.3], [0.2, 0.2, 1.0]];
        let corners = corners.map(DVec3::from_array);
        let faces = [[0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
        let material = vec![Material::grey("grey")];
        let model = Scene::from_world(&corners, &faces, &[0; 4], material, [0.0; 3]).unwrap().0;
        let place = [[0.0, -2.0, 0.0, 5.0], [2.0, 0.0, 0.0, 6.0], [0.0, 0.0, 2.0, 7.0]];
        let now = [[2.0, 0.0, 0.0, 1.0], [0.0, 2.0, 0.0, 1.0], [0.0, 0.0, 2.0, 1.0]];
        let pose = ObjectPose::at(DVec3::ZERO);
        let before = PlacedModel { name: "a".into(), place, pose, model: Arc::new(model) };
        let axes = [[8.0, 0.0, 0.0], [0.0, 8.0, 0.0], [0.0, 0.0, 8.0]];
        let (grid, class) = ([4; 3], ViewClass::Interior);
        let spec = SectionSpec { origin: [0.0; 3], axes, grid, class, obstructions: true };
        let sections = [Section::new(spec).unwrap()];
        let step = sections[0].diagonal() / LINEAR_CODES;
        let motion = MovedObject { before, now: Some(now) }.motion(&sections).unwrap();
        for face in faces {
            let [a, b, c] =
                face.map(|corner: u32| map_of(&place).transform_point3(corners[corner as usize]));
            let normal = (b - a).cross(c - a).normalize();
            for (u, v) in [(0.1, 0.1), (0.3, 0.3), (0.1, 0.7), (0.8, 0.1)] {
                let point = a + (b - a) * u + (c - a) * v;
                for (side, is_on) in [(0.0, true), (0.6, true), (-0.6, true), (1.2, false)] {
                    let outward = normal * normal.dot(a - motion.sphere.0).signum();
                    let beside = point + outward * (side * step);
                    assert_eq!((motion.lay_on)(beside), is_on, "{face:?} {u} {v} {side}");
                }
            }
        }
        assert!(!(motion.lay_on)(motion.sphere.0), "inside it");
        let moved = motion.to_now.unwrap();
        let corner = |rows: &[[f64; 4]; 3]| -> DVec3 { map_of(rows).transform_point3(corners[3]) };
        assert!((moved.transform_point3(corner(&place)) - corner(&now)).length() < 1e-12);
        assert!((moved.matrix3.determinant() - 1.0).abs() < 1e-12);
        assert_ne!(moved, DAffine3::IDENTITY);
    }
}
