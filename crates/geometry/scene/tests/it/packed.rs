//! Tests packed scenes: exact, canonical, and never trusted.

#![allow(clippy::unwrap_used)]

use glam::DVec3;
use holo_scene::{Bsdf, HEADER_BYTES, Material, PackedError, Rgb, Scene, SceneError};
use proptest::prelude::*;

fn colour() -> impl Strategy<Value = Rgb> {
    prop::array::uniform3(prop_oneof![Just(0.0f32), Just(1.0), 0.0..1.0f32])
}

fn bsdf() -> impl Strategy<Value = Bsdf> {
    let alpha = 1e-3..=1.0f32;
    let ior = 0.1..=10.0f32;
    (0..6, colour(), colour(), ior, alpha, any::<bool>()).prop_map(
        |(kind, kd, ks, ior, alpha, smooth)| match kind {
            0 => Bsdf::Diffuse { kd },
            1 => Bsdf::Mirror { ks },
            2 => Bsdf::Conductor { ks, alpha },
            3 => Bsdf::ThinGlass { ior, transmittance: ks },
            4 => {
                Bsdf::Dielectric { ior, transmittance: ks, alpha: if smooth { 0.0 } else { alpha } }
            }
            _ => Bsdf::Coated { kd, ks, ior, alpha },
        },
    )
}

fn material() -> impl Strategy<Value = Material> {
    let emission = prop::array::uniform3(prop_oneof![Just(0.0f32), 0.0..1e6f32]);
    (".{0,12}", bsdf(), emission, any::<bool>()).prop_map(
        |(name, bsdf, emission, two_sided_emission)| Material {
            name,
            bsdf,
            emission,
            two_sided_emission,
        },
    )
}

fn scene() -> impl Strategy<Value = Scene> {
    let materials = prop::collection::vec(material(), 1..6);
    let corner = || prop::array::uniform3(-50.0..50.0f64);
    let triangles = prop::collection::vec((prop::array::uniform3(corner()), any::<u32>()), 0..20);
    (materials, triangles, colour()).prop_map(|(materials, triangles, sky)| {
        let positions: Vec<DVec3> =
            triangles.iter().flat_map(|(c, _)| *c).map(DVec3::from_array).collect();
        let corners: Vec<[u32; 3]> =
            (0..triangles.len() as u32).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        let ids: Vec<u32> = triangles.iter().map(|(_, m)| m % materials.len() as u32).collect();
        Scene::from_world(&positions, &corners, &ids, materials, sky).unwrap().0
    })
}

fn one_triangle() -> Scene {
    Scene::new(
        DVec3::new(1.0, 2.0, 3.0),
        vec![[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
        vec![[0, 1, 2]],
        vec![0],
        vec![Material {
            name: "ab".into(),
            bsdf: Bsdf::Conductor { ks: [0.25, 0.5, 1.0], alpha: 0.125 },
            emission: [3.0, 0.0, 0.0],
            two_sided_emission: true,
        }],
        [0.0, 0.5, 1.0],
    )
    .unwrap()
}

#[test]
fn the_bytes_are_those_of_the_format() {
    let mut expected = b"holoscn\n".to_vec();
    let mut put = |bytes: &[u8]| expected.extend_from_slice(bytes);
    put(&[1, 0, 0, 0, 0, 0, 0, 0]);
    [3u64, 1, 1, 38].iter().for_each(|n| put(&n.to_le_bytes()));
    [1.0f64, 2.0, 3.0].iter().for_each(|x| put(&x.to_le_bytes()));
    [0.0f32, 0.5, 1.0, 0.0].iter().for_each(|x| put(&x.to_le_bytes()));
    [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0].iter().for_each(|x| put(&x.to_le_bytes()));
    [0u32, 1, 2, 0].iter().for_each(|x| put(&x.to_le_bytes()));
    put(&[2, 0, 0, 0, 2, 1, 0, 0]);
    [3.0f32, 0.0, 0.0, 0.25, 0.5, 1.0, 0.125].iter().for_each(|x| put(&x.to_le_bytes()));
    put(b"ab");
    assert_eq!(one_triangle().pack(), expected);
    assert_eq!(expected.len(), HEADER_BYTES + 12 * 3 + 16 + 38);
}

#[test]
fn the_hash_is_blake3_of_the_bytes() {
    let empty = "af1349b9f5f9a1a6a0404dea36dcc9499bcb25c9adc112b7cc9a93cae41f3262";
    let hex: String = Scene::content_hash(b"").iter().map(|b| format!("{b:02x}")).collect();
    assert_eq!(hex, empty);
}

#[test]
fn false_counts_allocate_no_memory_and_errors_say_what_is_wrong() {
    let packed = one_triangle().pack();
    let with = |at: usize, bytes: &[u8]| {
        let mut changed = packed.clone();
        changed[at..at + bytes.len()].copy_from_slice(bytes);
        Scene::unpack(&changed).unwrap_err().to_string()
    };
    let huge = u64::MAX.to_le_bytes();
    assert_eq!(with(0, b"x"), SceneError::Packed(PackedError::Magic).to_string());
    assert_eq!(with(8, &[9]), "not a packed scene: its version is 9, this program reads 1");
    assert_eq!(with(12, &[1]), "not a packed scene: reserved bytes are not zero");
    assert_eq!(with(84, &[1]), "not a packed scene: its sky is malformed");
    assert_eq!(with(84, &[255; 4]), "not a packed scene: its sky is malformed");
    assert_eq!(
        with(16, &huge),
        format!("{} positions are more than the limit of {}", u64::MAX, 1 << 28)
    );
    assert_eq!(
        with(24, &huge),
        format!("{} triangles are more than the limit of {}", u64::MAX, 1 << 28)
    );
    assert_eq!(
        with(32, &huge),
        format!("{} materials are more than the limit of {}", u64::MAX, 1 << 16)
    );
    assert_eq!(
        with(16, &[0, 0, 0, 16]),
        format!("not a packed scene: 178 bytes, its header says {}", 12u64 * (1 << 28) + 142)
    );
    assert_eq!(with(32, &[2]), "not a packed scene: material 1 is malformed");
    assert_eq!(
        with(88, &f32::NAN.to_le_bytes()),
        "position 0 is not finite or beyond 1000000000000 units"
    );
    assert_eq!(with(124, &[3]), "triangle 0 names position 3 of 3");
    assert_eq!(with(124, &[1]), "triangle 0 has no area");
    assert_eq!(with(136, &[1]), "triangle 0 names material 1 of 1");
    assert_eq!(
        with(172, &2f32.to_le_bytes()),
        "material `ab`: its roughness is outside [0, 1], or 0 where it must be positive"
    );
    assert_eq!(with(160, &(-1f32).to_le_bytes()), "material `ab`: a colour is outside [0, 1]");
    assert_eq!(with(144, &[6]), "not a packed scene: material 0 is malformed");
    assert_eq!(with(145, &[2]), "not a packed scene: material 0 is malformed");
    assert_eq!(with(176, &[0xff]), "not a packed scene: material 0 is malformed");
    assert_eq!(with(72, &f32::INFINITY.to_le_bytes()), SceneError::Sky.to_string());
    assert_eq!(with(48, &f64::NAN.to_le_bytes()), SceneError::Origin.to_string());
}

#[test]
fn every_truncation_and_any_tail_is_refused() {
    let packed = one_triangle().pack();
    for length in 0..packed.len() {
        assert!(Scene::unpack(&packed[..length]).is_err(), "{length}");
    }
    assert!(Scene::unpack(&[packed.as_slice(), &[0]].concat()).is_err());
}

/// The arguments of [`Scene::new`].
struct Parts {
    origin: DVec3,
    positions: Vec<[f32; 3]>,
    triangles: Vec<[u32; 3]>,
    material_ids: Vec<u32>,
    materials: Vec<Material>,
    sky: [f32; 3],
}

impl Parts {
    fn of(scene: &Scene) -> Parts {
        let own = scene.own();
        Parts {
            origin: scene.origin,
            positions: own.positions.to_vec(),
            triangles: own.triangles.to_vec(),
            material_ids: own.material_ids.to_vec(),
            materials: scene.materials.clone(),
            sky: scene.sky.as_even().unwrap(),
        }
    }

    fn scene(self) -> Result<Scene, SceneError> {
        let Parts { origin, positions, triangles, material_ids, materials, sky } = self;
        Scene::new(origin, positions, triangles, material_ids, materials, sky)
    }
}

#[test]
fn new_refuses_what_is_not_a_scene() {
    let good = one_triangle();
    let with = |change: &dyn Fn(&mut Parts)| {
        let mut parts = Parts::of(&good);
        change(&mut parts);
        parts.scene()
    };
    assert_eq!(with(&|_| {}).unwrap(), good);
    assert!(matches!(with(&|s| s.material_ids.clear()), Err(SceneError::MaterialIdCount { .. })));
    assert!(matches!(with(&|s| s.materials.clear()), Err(SceneError::MaterialIndex { .. })));
    assert!(matches!(with(&|s| s.positions[0][1] = 2e12), Err(SceneError::Position(0))));
    assert!(matches!(with(&|s| s.triangles[0] = [0, 1, 1]), Err(SceneError::NoArea(0))));
    assert!(matches!(
        with(&|s| s.materials[0].name = "x".repeat(2000)),
        Err(SceneError::Material { .. })
    ));
    assert!(matches!(
        with(&|s| s.materials[0].emission = [f32::NAN; 3]),
        Err(SceneError::Material { .. })
    ));
    for bsdf in [
        Bsdf::Diffuse { kd: [0.5, 1.1, 0.0] },
        Bsdf::Mirror { ks: [0.5, f32::NAN, 0.0] },
        Bsdf::Conductor { ks: [0.5; 3], alpha: 0.0 },
        Bsdf::ThinGlass { ior: 0.0, transmittance: [0.5; 3] },
        Bsdf::ThinGlass { ior: f32::INFINITY, transmittance: [0.5; 3] },
        Bsdf::Dielectric { ior: 1.5, transmittance: [0.5; 3], alpha: -0.1 },
        Bsdf::Dielectric { ior: 1.5, transmittance: [2.0; 3], alpha: 0.0 },
        Bsdf::Coated { kd: [0.5; 3], ks: [-0.5; 3], ior: 1.5, alpha: 0.1 },
        Bsdf::Coated { kd: [0.5; 3], ks: [0.5; 3], ior: 1.5, alpha: f32::NAN },
    ] {
        assert!(
            matches!(with(&|s| s.materials[0].bsdf = bsdf), Err(SceneError::Material { .. })),
            "{bsdf:?}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_scene_survives_packing(scene in scene()) {
        prop_assert_eq!(Scene::unpack(&scene.pack()).unwrap(), scene);
    }

    /// Accepted bytes are canonical and valid: the scene packs to the same bytes and passes all
    /// checks again.
    #[test]
    fn changed_bytes_give_a_valid_scene_or_an_error(
        scene in scene(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 1..4),
        flips in any::<bool>(),
    ) {
        let mut packed = scene.pack();
        for (at, value) in changes {
            let byte = at.get_mut(&mut packed);
            *byte = if flips { *byte ^ (1 << (value % 8)) } else { value };
        }
        if let Ok(s) = Scene::unpack(&packed) {
            prop_assert_eq!(s.pack(), packed);
            prop_assert!(Parts::of(&s).scene().is_ok());
        }
    }

    #[test]
    fn random_bytes_do_not_panic(head in any::<bool>(), bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let start: &[u8] = if head { b"holoscn\n\x01\0\0\0\0\0\0\0" } else { b"" };
        prop_assert!(Scene::unpack(&[start, &bytes].concat()).is_err());
    }
}
