//! A picture of the sky: what is decoded shines in every direction, and survives packing.
#![no_main]

use glam::DVec3;
use holo_fuzz::survives;
use holo_scene::{Material, Scene, Sky, SkyAxes, SkyPicture};
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    let Ok(picture) = SkyPicture::decode(bytes) else { return };
    let sky = Sky::of_picture(picture, 1.0, SkyAxes::new(DVec3::Z, 30.0));
    let is_sound = |light: [f32; 3]| light.iter().all(|c| c.is_finite() && *c >= 0.0);
    assert!(is_sound(sky.horizontal()), "{:?}", sky.horizontal());
    for direction in [DVec3::X, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z, DVec3::ONE.normalize()] {
        assert!(is_sound(sky.radiance(direction)), "{direction}: {:?}", sky.radiance(direction));
    }
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let grey = vec![Material::grey("grey")];
    let made = Scene::from_world(&corners, &[[0, 1, 2]], &[0], grey, [0.0; 3]);
    let (mut scene, _) = made.expect("a triangle is a scene");
    scene.sky = sky;
    survives(&scene);
});
