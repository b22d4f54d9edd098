//! Tests that a scene is the same after it was taken apart into arrays and frame, and joined again.

#![allow(clippy::unwrap_used)]

use glam::Vec3;
use holo_scene::{Scene, SceneArrays, SceneError};

use crate::common::{arrays_of, instanced};

fn joined(scene: &Scene, change: impl Fn(&mut SceneArrays)) -> Result<Scene, SceneError> {
    let mut arrays = arrays_of(scene);
    change(&mut arrays);
    Scene::from_frame(&scene.pack_frame().unwrap(), arrays)
}

fn plain() -> Scene {
    let mut scene = instanced::scene().flattened();
    scene.shading = None;
    scene
}

#[test]
fn a_scene_that_was_taken_apart_is_joined_again() {
    let textured = instanced::textured().flattened();
    for scene in [plain(), instanced::shaded().flattened(), textured] {
        let joined = joined(&scene, |_| {}).unwrap();
        assert!(joined == scene && joined.pack() == scene.pack());
        let looks = |scene: &Scene| scene.reflectance(1, 0.3, 0.2, 0.0);
        assert_eq!(looks(&joined), looks(&scene));
    }
}

#[test]
fn a_scene_with_instances_has_no_frame() {
    assert!(instanced::shaded().pack_frame().is_none());
}

#[test]
fn indices_out_of_range_and_other_lengths_are_refused() {
    let scene = instanced::textured().flattened();
    let refused = |change: &dyn Fn(&mut SceneArrays)| joined(&scene, change).unwrap_err();
    assert!(matches!(
        refused(&|arrays| arrays.triangles.to_mut()[1][2] = 1000),
        SceneError::PositionIndex { triangle: 1, .. }
    ));
    assert!(matches!(
        refused(&|arrays| arrays.material_ids.to_mut()[1] = 1000),
        SceneError::MaterialIndex { triangle: 1, .. }
    ));
    let shorter = refused(&|arrays| arrays.material_ids.to_mut().truncate(1));
    assert!(matches!(shorter, SceneError::MaterialIdCount { .. }));
    let shorter = refused(&|arrays| arrays.normals.to_mut().truncate(1));
    assert!(matches!(shorter, SceneError::Shading { .. }));
    let without = refused(&|arrays| arrays.uvs.to_mut().clear());
    assert!(matches!(without, SceneError::Shading { .. }));
    let instances = Scene::from_frame(&instanced::scene().pack(), arrays_of(&plain()));
    assert!(matches!(instances, Err(SceneError::Shading { .. })));
    assert!(Scene::from_frame(b"no frame", arrays_of(&plain())).is_err());
}

#[test]
fn only_the_same_geometry_is_shared() {
    let mut scene = plain();
    let SceneArrays { positions, triangles, .. } = arrays_of(&scene);
    assert!(scene.share_geometry(&positions, &triangles));
    let mut other = triangles.clone();
    other.to_mut()[0].swap(0, 1);
    assert!(!scene.share_geometry(&positions, &other));
    let mut moved = positions.clone();
    moved.to_mut()[0] = Vec3::splat(7.0).to_array();
    assert!(!scene.share_geometry(&moved, &triangles));
    assert_eq!(scene, plain());
}
