//! A packed scene, as a worker gets it: bytes that are one have one meaning and one packing.
#![no_main]

use holo_scene::Scene;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(scene) = Scene::unpack(bytes) {
        assert!(scene.pack() == bytes, "another packing");
    }
});
