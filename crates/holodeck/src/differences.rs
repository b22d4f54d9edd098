//! Names the differences between a holodeck file and the scene and options given now, for people.

use holo_proto::control::RenderSettings;
use holo_scene::{Material, Scene};

/// Returns the differences between two scenes, in words that name the option or the part.
pub fn of_scenes(file: &Scene, now: &Scene) -> Vec<String> {
    let mut found = Vec::new();
    if file.sky != now.sky {
        found.push(format!("the sky is {} in the file, and {} now (--sky)", sky(file), sky(now)));
    }
    if file.triangles().len() != now.triangles().len() {
        let (before, after) = (file.triangles().len(), now.triangles().len());
        found.push(format!("the file's scene has {before} triangles, and this one {after}"));
    } else if !file.has_same_geometry(now) {
        found.push("triangles have moved".to_owned());
    }
    if file.materials != now.materials {
        found.push(of_materials(&file.materials, &now.materials));
    } else if !file.material_ids().eq(now.material_ids()) {
        found.push("triangles have other materials".to_owned());
    }
    found
}

fn sky(scene: &Scene) -> String {
    scene.sky.to_string()
}

fn of_materials(file: &[Material], now: &[Material]) -> String {
    let one_sided = |materials: &[Material]| {
        let one_sided = |m: &Material| Material { two_sided_emission: false, ..m.clone() };
        materials.iter().map(one_sided).collect::<Vec<_>>()
    };
    if one_sided(file) == one_sided(now) {
        return "lights shine from one side in one of them, and from both sides in the other \
                (--two-sided-lights)"
            .to_owned();
    }
    let changed = now.iter().find(|material| !file.contains(material));
    changed.map_or_else(
        || "there are other materials".to_owned(),
        |material| format!("material `{}` differs", material.name),
    )
}

/// Returns the differences between two settings, in words that name the option.
pub fn of_settings(file: &RenderSettings, now: &RenderSettings) -> Vec<String> {
    let bounces = |settings: &RenderSettings| {
        settings.bounces.map_or_else(|| "unlimited".to_owned(), |bounces| bounces.to_string())
    };
    let engine = |settings: &RenderSettings| settings.engine.name().to_owned();
    let on =
        |settings: &RenderSettings| if settings.virtual_distance { "on" } else { "off" }.to_owned();
    [
        ("--engine", engine(file), engine(now)),
        ("--bounces", bounces(file), bounces(now)),
        ("--paths-per-sample", file.paths_per_sample.to_string(), now.paths_per_sample.to_string()),
        ("--seed", file.seed.to_string(), now.seed.to_string()),
        ("--virtual-distance", on(file), on(now)),
    ]
    .into_iter()
    .filter(|(_, before, after)| before != after)
    .map(|(option, before, after)| format!("{option} is {before} in the file, and {after} now"))
    .collect()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn scene(size: f64, material: Material, sky: [f32; 3]) -> Scene {
        let corners = [DVec3::ZERO, DVec3::X * size, DVec3::Y];
        Scene::from_world(&corners, &[[0, 1, 2]], &[0], vec![material], sky).unwrap().0
    }

    #[test]
    fn the_part_of_a_scene_that_differs_is_named() {
        let grey = || Material::grey("wall");
        let file = scene(1.0, grey(), [0.0; 3]);
        let only = |now: &Scene| match &of_scenes(&file, now)[..] {
            [one] => one.clone(),
            other => panic!("{other:?}"),
        };
        assert_eq!(of_scenes(&file, &file), [""; 0]);
        let sky = only(&scene(1.0, grey(), [1.0, 1.0, 0.5]));
        assert_eq!(sky, "the sky is 0,0,0 in the file, and 1,1,0.5 now (--sky)");
        assert_eq!(only(&scene(2.0, grey(), [0.0; 3])), "triangles have moved");
        let bright = Material { emission: [1.0; 3], ..grey() };
        assert_eq!(only(&scene(1.0, bright, [0.0; 3])), "material `wall` differs");
        let two_sided = Material { two_sided_emission: true, ..grey() };
        assert!(only(&scene(1.0, two_sided, [0.0; 3])).contains("--two-sided-lights"));
    }

    #[test]
    fn settings_that_differ_are_named_by_their_options() {
        let file = RenderSettings::default();
        assert_eq!(of_settings(&file, &file), [""; 0]);
        let now = RenderSettings { bounces: Some(0), seed: 5, ..file };
        let words = of_settings(&file, &now).join("; ");
        assert_eq!(
            words,
            "--bounces is unlimited in the file, and 0 now; --seed is 0 in the file, and 5 now"
        );
    }
}
