//! Models and poses.

use std::sync::Arc;

use glam::DVec3;
use holo_local_objects::{
    LocalObject, MOST_TRIANGLES, ObjectError, ObjectModel, ObjectPose, probe_views,
};
use holo_scene::{Material, Scene};

use crate::common::{boxes, grey, pedestal};

#[test]
fn an_object_stands_where_its_pose_says_upright_turned_and_scaled() {
    // A model with y up: 2 wide along x, 1 along z, 3 high.
    let scene = boxes(&[([5.0, 1.0, 7.0], [7.0, 4.0, 8.0], grey(0.5))]);
    let model = Arc::new(ObjectModel::new(scene, DVec3::Y, 0.5).unwrap());
    let pose = ObjectPose { at: DVec3::new(1.0, 2.0, 3.0), turn: 90.0, scale: 2.0 };
    let object = LocalObject::new(model, pose, DVec3::Z).unwrap();
    // The unit halves it and the scale doubles it.
    assert!(object.centre().distance(DVec3::new(1.0, 2.0, 4.5)) < 1e-6);
    let hits = |origin: [f64; 3], towards: DVec3| object.distance(origin.into(), towards);
    let near = |found: Option<f64>, expected: f64| (found.unwrap() - expected).abs() < 1e-5;
    assert!(near(hits([1.0, 2.0, 10.0], DVec3::NEG_Z), 4.0), "its top is 3 above its base");
    assert!(near(hits([-9.0, 2.0, 4.0], DVec3::X), 9.5), "turned by a right angle, it is 1 wide");
    assert!(near(hits([1.0, -8.0, 4.0], DVec3::Y), 9.0), "and 2 deep");
    assert_eq!(hits([1.0, 2.0, 10.0], DVec3::Z), None);
}

#[test]
fn impossible_poses_are_refused_with_the_value() {
    let model = pedestal(1.0, 1.0, grey(0.5));
    let here = ObjectPose::at(DVec3::ZERO);
    let refused = |pose| LocalObject::new(Arc::clone(&model), pose, DVec3::Z).err().unwrap();
    for (pose, reason) in [
        (ObjectPose { at: DVec3::new(f64::NAN, 0.0, 0.0), ..here }, "NaN 0 0 is no place"),
        (ObjectPose { at: DVec3::new(0.0, f64::INFINITY, 0.0), ..here }, "is no place"),
        (ObjectPose { turn: f64::NAN, ..here }, "NaN is no angle"),
        (ObjectPose { scale: 0.0, ..here }, "0 is no scale"),
        (ObjectPose { scale: -1.0, ..here }, "-1 is no scale"),
        (ObjectPose { scale: f64::NAN, ..here }, "NaN is no scale"),
    ] {
        let error = refused(pose).to_string();
        assert!(error.contains(reason), "{error}");
    }
    assert!(probe_views(DVec3::NAN).is_none());
}

#[test]
fn a_model_without_triangles_or_with_two_million_is_refused_in_words() {
    let none =
        Scene::new(DVec3::ZERO, Vec::new(), Vec::new(), Vec::new(), Vec::new(), [0.0; 3]).unwrap();
    let error = ObjectModel::new(none, DVec3::Z, 1.0).err().unwrap();
    assert_eq!(error, ObjectError::Empty);
    let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let count = 2 * MOST_TRIANGLES;
    let materials = vec![Material::grey("grey")];
    let many = Scene::new(
        DVec3::ZERO,
        corners,
        vec![[0, 1, 2]; count],
        vec![0; count],
        materials,
        [0.0; 3],
    );
    let error = ObjectModel::new(many.unwrap(), DVec3::Z, 1.0).err().unwrap();
    assert_eq!(error, ObjectError::TooLarge(count));
    assert!(error.to_string().contains("2000000 triangles"), "{error}");
    let scene = boxes(&[([0.0; 3], [1.0; 3], grey(0.5))]);
    assert_eq!(ObjectModel::new(scene, DVec3::ZERO, 1.0).err(), Some(ObjectError::Axes));
}
