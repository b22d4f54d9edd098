//! Stated light: what is made of it, and what is refused.

#![allow(clippy::unwrap_used, reason = "tests")]

use super::*;
use holo_scene::{Bsdf, Material};

fn scene() -> Scene {
    let corners = [DVec3::ZERO, DVec3::X, DVec3::Y];
    let lamp = Material {
        emission: [4.0; 3],
        bsdf: Bsdf::Diffuse { kd: [0.0; 3] },
        ..Material::grey("ceiling")
    };
    Scene::from_world(&corners, &[[0, 1, 2]], &[0], vec![lamp], [1.0; 3]).unwrap().0
}

fn stated(options: &[(&str, &str)]) -> StatedLight {
    let own = |(name, value): &(&str, &str)| ((*name).to_owned(), (*value).to_owned());
    StatedLight::from_options(&options.iter().map(own).collect::<Vec<_>>()).unwrap()
}

fn applied(options: &[(&str, &str)]) -> Result<Scene> {
    let mut scene = scene();
    stated(options).apply_sky(&mut scene, DVec3::Z)?;
    stated(options).dim_lamps(&mut scene)?;
    scene.clone().with_suns(scene.suns.clone()).map_err(Into::into)
}

const NOON: [(&str, &str); 2] = [("place", "52.37,4.9"), ("at", "2026-06-21T13:42+02:00")];

#[test]
fn stated_light_is_stored_as_options_and_read_again() {
    let light = stated(&[
        ("sky", "cie:12"),
        ("place", "52.37,-4.9"),
        ("at", "2026-06-21T15:30+02:00"),
        ("north", "-30"),
        ("ground", "0.1"),
        ("illuminance", "12000"),
        ("lamp", "a=b=0.5"),
        ("lamp", "sun=0"),
    ]);
    assert_eq!(StatedLight::from_options(&light.to_options().unwrap()).unwrap(), light);
    let words = StatedLight { sky: Some(SkyChoice::Radiance([1.0; 3])), ..light };
    assert_eq!(words.to_options().unwrap().len(), 7, "a radiance has a place of its own");
    let error = StatedLight::from_options(&[("moon".into(), "1".into())]).unwrap_err();
    assert!(error.to_string().contains("--moon"), "{error}");
}

#[test]
fn place_and_hour_give_a_clear_sky_whose_sun_stands_in_the_south() {
    let scene = applied(&NOON).unwrap();
    let sun = scene.sky.sun().unwrap();
    assert!(sun.towards[1] < -0.4 && sun.towards[2] > 0.85, "{sun:?}");
    assert!(scene.sky.horizontal()[0] * 179.0 > 5000.0);
    let dark = applied(&[NOON[0], NOON[1], ("lamp", "sun=0")]).unwrap();
    assert_eq!(dark.sky.sun(), None);
    let below = DVec3::NEG_Z;
    assert!(dark.sky.radiance(below)[0] < 0.5 * scene.sky.radiance(below)[0], "the ground");
}

#[test]
fn skies_bring_the_stated_illuminance() {
    for sky in ["overcast", "uniform"] {
        let scene = applied(&[("sky", sky), ("illuminance", "12000")]).unwrap();
        let found = holo_color::luminance(scene.sky.horizontal());
        assert!((found / 12_000.0 - 1.0).abs() < 5e-3, "{sky}: {found}");
    }
    let measured = [NOON[0], NOON[1], ("sky", "perez"), ("direct", "0"), ("diffuse", "5")];
    let scene = applied(&measured).unwrap();
    assert_eq!(scene.sky.sun(), None);
    let found = holo_color::luminance(scene.sky.horizontal());
    assert!((400.0..900.0).contains(&found), "{found}");
}

#[test]
fn missing_and_useless_options_are_named() {
    let error = |options: &[(&str, &str)]| format!("{:#}", applied(options).unwrap_err());
    assert!(error(&[("sky", "clear")]).contains("--place"));
    assert!(error(&[("sky", "perez"), NOON[0]]).contains("--at"));
    assert!(error(&[("sky", "perez"), NOON[1]]).contains("--place"));
    assert!(error(&[("sky", "perez"), NOON[0], NOON[1]]).contains("--diffuse"));
    assert!(error(&[("direct", "100")]).contains("--sky perez"));
    assert!(error(&[("illuminance", "100")]).contains("--illuminance"));
    for (option, also) in [(NOON[0], "--at"), (NOON[1], "--place")] {
        assert!(error(&[option]).contains(also), "{}", error(&[option]));
    }
    assert!(error(&[("north", "30")]).contains("--sky"));
    assert!(error(&[("ground", "0.1")]).contains("--sky"));
    let zoneless = [NOON[0], ("at", "2026-06-21T13:42")];
    assert!(error(&zoneless).contains("+02:00"), "{}", error(&zoneless));
    assert!(error(&[("sky", "missing.hdr")]).contains("missing.hdr"));
    assert!(error(&[("weather", "missing.epw"), NOON[1]]).contains("missing.epw"));
    for bad in ["cie:16", "cloudy", "1,2", "1,-1,1", "sky.png"] {
        assert!(bad.parse::<SkyChoice>().is_err(), "{bad}");
    }
    assert!("cloudy".parse::<SkyChoice>().unwrap_err().contains("overcast"));
}

#[test]
fn lamps_are_dimmed_by_name_and_unknown_names_list_the_others() {
    let scene = applied(&[("lamp", "ceiling=0.25"), ("lamp", "sky=2")]).unwrap();
    assert_eq!(scene.materials[0].emission, [1.0; 3]);
    assert_eq!(scene.sky.as_even(), Some([2.0; 3]));
    let error = applied(&[("lamp", "lantern=0")]).unwrap_err().to_string();
    assert!(error.contains("lantern") && error.contains("ceiling, sky"), "{error}");
    for bad in ["ceiling", "ceiling=-1", "ceiling=nan", "ceiling=1e9"] {
        assert!(parse_lamp(bad).is_err(), "{bad}");
    }
    assert_eq!(parse_lamp("a=b=0.5"), Ok(("a=b".to_owned(), 0.5)));
}

#[test]
fn a_change_of_light_states_some_options_and_takes_others_back() {
    let change = |light: &StatedLight, options: &[(&str, &str)]| {
        let own = |(name, value): &(&str, &str)| ((*name).to_owned(), (*value).to_owned());
        light.changed(&options.iter().map(own).collect::<Vec<_>>())
    };
    let file = stated(&[("sky", "1,1,1"), ("lamp", "a=0")]);
    let noon = change(&file, &NOON).unwrap();
    assert_eq!((noon.sky.clone(), noon.lamps.len()), (None, 1), "place and hour make a clear sky");
    assert!(noon.place.is_some() && noon.at.is_some());
    let none = change(&noon, &[("place", "none"), ("at", "none"), ("lamp", "a=1")]).unwrap();
    assert_eq!((none.place, none.at, &*none.lamps), (None, None, &[("a".to_owned(), 1.0)][..]));
    let dim = change(&noon, &[("sky", "overcast"), ("illuminance", "9000")]).unwrap();
    let perez = [("sky", "perez"), ("direct", "800"), ("diffuse", "90")];
    let perez = change(&dim, &perez).unwrap();
    assert_eq!((perez.illuminance, perez.direct), (None, Some(800.0)));
    assert_eq!(change(&perez, &[("sky", "clear")]).unwrap().direct, None);
    for bad in [("sky", "cloudy"), ("at", "noon"), ("moon", "none"), ("lamp", "a=none")] {
        assert!(change(&noon, &[bad]).is_err(), "{bad:?}");
    }
}

#[test]
fn later_light_overrides_earlier_light_option_by_option() {
    let file = stated(&[("sky", "clear"), NOON[0], ("lamp", "sun=0"), ("lamp", "a=1")]);
    let now = stated(&[("sky", "overcast"), ("lamp", "sun=0.5")]);
    let both = file.overridden_by(&now);
    assert_eq!((both.sky, both.place), (Some(SkyChoice::Overcast), file.place));
    assert_eq!(both.lamps, [("a".to_owned(), 1.0), ("sun".to_owned(), 0.5)]);
}

/// Writes a photometric file of 100 cd in every direction.
fn even_lamp(folder: &Path) -> PathBuf {
    let path = folder.join("even.ies");
    let text = "IESNA:LM-63-2002\nTILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 1 10\n0 180\n0\n100 100\n";
    std::fs::write(&path, text).unwrap();
    path
}

#[test]
fn stated_luminaires_are_hung_dimmed_by_group_and_read_again() {
    let folder = tempfile::tempdir().unwrap();
    let lamp = StatedLuminaire {
        file: even_lamp(folder.path()),
        name: Some("bulb".to_owned()),
        at: Some(StatedPlaces::Several(vec![[0.0, 0.0, 2.0], [1.0, 0.0, 2.0]])),
        lumens: Some(800.0),
        kelvin: Some(2700.0),
        ..StatedLuminaire::default()
    };
    let light = StatedLight { luminaires: vec![lamp], ..StatedLight::default() };
    assert_eq!(StatedLight::from_options(&light.to_options().unwrap()).unwrap(), light);
    let hung = |unit| hang(&light.luminaires, &[], scene(), DVec3::Z, unit);
    let (mut scene, said) = hung(Some(1.0)).unwrap();
    assert!(said[0].contains("bulb: 2, each of 800 lm"), "{said:?}");
    let names: Vec<&str> = scene.luminaires().iter().map(|lamp| lamp.name.as_str()).collect();
    assert_eq!(names, ["bulb 1", "bulb 2"]);
    let emission = |scene: &Scene, at: usize| {
        scene.materials[scene.luminaires()[at].material as usize].emission
    };
    let [red, _, blue] = emission(&scene, 0);
    assert!(red > 2.0 * blue);
    // The whole group, and one of it again.
    let dim = stated(&[("lamp", "bulb=0.5"), ("lamp", "bulb 2=0.5")]);
    let before = emission(&scene, 0)[0];
    dim.dim_lamps(&mut scene).unwrap();
    let after = [0, 1].map(|at| emission(&scene, at)[0] / before);
    assert!((after[0] - 0.5).abs() < 1e-6 && (after[1] - 0.25).abs() < 1e-6, "{after:?}");
    let error = hung(None).unwrap_err().to_string();
    assert!(error.contains("--unit"), "{error}");
}

#[test]
fn broken_photometric_files_are_named_with_their_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("short.ies");
    std::fs::write(&file, "TILT=NONE\n1 -1 1 2 1 1 2 0 0 0\n1 1 10\n0 180\n").unwrap();
    let at = Some(StatedPlaces::One([0.0; 3]));
    let lamp = StatedLuminaire { file, at, ..StatedLuminaire::default() };
    let error = hang(std::slice::from_ref(&lamp), &[], scene(), DVec3::Z, Some(1.0)).unwrap_err();
    let error = format!("{error:#}");
    assert!(error.contains("short.ies") && error.contains("line 4"), "{error}");
    let gone = StatedLuminaire { file: "gone.ies".into(), ..lamp };
    let error = hang(&[gone], &[], scene(), DVec3::Z, Some(1.0)).unwrap_err();
    assert!(format!("{error:#}").contains("gone.ies"), "{error:#}");
}
