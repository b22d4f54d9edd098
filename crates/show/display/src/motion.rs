//! Objects that have moved in the scene (Walter et al. 1999, §4.2), as drivers learn of them.

use std::{fmt, sync::Arc};

use glam::{DAffine3, DVec3};

/// A change of an object's place in the scene, between two generations of samples.
#[derive(Clone)]
pub struct ObjectMotion {
    /// The object's name.
    pub name: String,
    /// Returns whether a point of the scene lay on the object before.
    pub lay_on: Arc<dyn Fn(DVec3) -> bool + Send + Sync>,
    /// The map of the scene onto itself that moves the object. `None` if the object is gone.
    pub to_now: Option<DAffine3>,
    /// The sphere around the object before: middle, and radius in scene units.
    pub sphere: (DVec3, f64),
}

impl fmt::Debug for ObjectMotion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ObjectMotion { name, to_now, sphere, .. } = self;
        let fields = &mut f.debug_struct("ObjectMotion");
        fields.field("name", name).field("to_now", to_now).field("sphere", sphere).finish()
    }
}

impl ObjectMotion {
    /// Returns the sphere around the object now. `None` if it is gone.
    #[must_use]
    pub fn sphere_now(&self) -> Option<(DVec3, f64)> {
        let ((centre, radius), to_now) = (self.sphere, self.to_now?);
        // A change of size is the same along all axes.
        Some((to_now.transform_point3(centre), radius * to_now.matrix3.x_axis.length()))
    }
}

/// Returns where a point is that was seen at some time before or between these motions, which are
/// in the order of time. `None` if its object is gone.
///
/// The time at which it was seen is not known. A point that was seen where its object also was
/// before moves too far, but only along the object.
#[must_use]
pub fn moved_along(motions: &[ObjectMotion], point: DVec3) -> Option<DVec3> {
    motions.iter().try_fold(point, |at, motion| match (motion.lay_on)(at) {
        true => motion.to_now.map(|to_now| to_now.transform_point3(at)),
        false => Some(at),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cube of side 1 around a place, which moves by so much.
    fn motion(name: &str, at: DVec3, by: Option<DVec3>) -> ObjectMotion {
        let lay_on = move |point: DVec3| {
            let farthest = (point - at).abs().max_element();
            (farthest - 0.5).abs() < 0.01
        };
        let to_now = by.map(DAffine3::from_translation);
        let (name, lay_on) = (name.to_owned(), Arc::new(lay_on) as Arc<_>);
        ObjectMotion { name, lay_on, to_now, sphere: (at, 0.75f64.sqrt()) }
    }

    #[test]
    fn points_follow_their_object_through_all_its_motions_from_any_time() {
        let by = DVec3::new(2.0, 0.0, 0.0);
        let motions = [motion("a", DVec3::ZERO, Some(by)), motion("a", by, Some(by))];
        let point = DVec3::new(0.5, 0.2, 0.1);
        assert_eq!(moved_along(&motions, point), Some(point + 2.0 * by), "before both");
        assert_eq!(moved_along(&motions, point + by), Some(point + 2.0 * by), "between them");
        assert_eq!(moved_along(&motions, point + 2.0 * by), Some(point + 2.0 * by), "after them");
        let elsewhere = DVec3::new(0.0, 7.0, 0.0);
        assert_eq!(moved_along(&motions, elsewhere), Some(elsewhere));
        assert_eq!(motions[1].sphere_now().map(|sphere| sphere.0), Some(2.0 * by));
    }

    #[test]
    fn points_stay_on_an_object_that_slides_along_itself_and_go_with_one_that_is_gone() {
        // It slides along its own top by a quarter, so tops have points in common.
        let by = DVec3::new(0.25, 0.0, 0.0);
        let slid = [motion("a", DVec3::ZERO, Some(by)), motion("a", by, Some(by))];
        for seen_at in -3..=3 {
            let point = DVec3::new(0.15 * f64::from(seen_at), 0.0, 0.5);
            for before in [point, point + by] {
                let now = moved_along(&slid, before).unwrap();
                assert!((now - 2.0 * by).abs().max_element() <= 0.51, "{before} {now}");
            }
        }
        let gone = [motion("a", DVec3::ZERO, None)];
        assert_eq!(moved_along(&gone, DVec3::new(0.1, 0.0, 0.5)), None);
        assert_eq!(gone[0].sphere_now(), None);
        let grown = ObjectMotion {
            to_now: Some(DAffine3::from_scale(DVec3::splat(2.0))),
            ..motion("a", DVec3::X, None)
        };
        assert_eq!(grown.sphere_now(), Some((2.0 * DVec3::X, 2.0 * 0.75f64.sqrt())));
    }
}
