//! Compares the samples that the real tracer stores, ray by ray, with a plain reading of the scene
//! file: walls, axes, channels and units.

use std::collections::HashMap;

use holo_section::{DVec3, Section};
use holo_tests::{Place, stored};

/// A four-sided face with its material.
struct Face {
    material: String,
    corners: [DVec3; 4],
}

/// The bundled box's OBJ file, which has nothing but `v`, `usemtl` and four-sided `f` lines of
/// three decimals.
fn faces(text: &str) -> Vec<Face> {
    let (mut vertices, mut faces, mut material) = (Vec::new(), Vec::new(), String::new());
    for line in text.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let numbers =
            || words[1..].iter().map(|word| word.parse::<f64>().unwrap()).collect::<Vec<_>>();
        match words.first() {
            Some(&"v") => vertices.push(DVec3::from_slice(&numbers())),
            Some(&"usemtl") => material = words[1].to_owned(),
            Some(&"f") => {
                let corners: Vec<DVec3> =
                    numbers().iter().map(|&index| vertices[index as usize - 1]).collect();
                faces.push(Face {
                    material: material.clone(),
                    corners: corners.try_into().unwrap(),
                });
            }
            _ => {}
        }
    }
    faces
}

/// Distance to a triangle, in lengths of `direction`.
fn triangle([a, b, c]: [DVec3; 3], origin: DVec3, direction: DVec3) -> Option<f64> {
    let (u, v) = (b - a, c - a);
    let normal = u.cross(v);
    let t = (a - origin).dot(normal) / direction.dot(normal);
    let p = origin + direction * t - a;
    let (s, r) = (
        p.cross(v).dot(normal) / normal.length_squared(),
        u.cross(p).dot(normal) / normal.length_squared(),
    );
    (t > 0.0 && s >= 0.0 && r >= 0.0 && s + r <= 1.0).then_some(t)
}

/// The nearest face, with its faces split along one diagonal or the other: not all of the box's are
/// quite flat.
fn nearest(
    faces: &[Face],
    origin: DVec3,
    direction: DVec3,
    other_diagonal: bool,
) -> Option<(f64, &Face)> {
    let hits = faces.iter().flat_map(|face| {
        let [a, b, c, d] = face.corners;
        let halves = if other_diagonal { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] };
        halves.into_iter().filter_map(move |half| Some((triangle(half, origin, direction)?, face)))
    });
    hits.min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Diffuse reflectances and the lamp's radiance, as in the bundled material file.
const LAMP: [f64; 3] = [17.0, 12.0, 4.0];

fn reflectance(material: &str) -> [f64; 3] {
    match material {
        "white" => [0.73; 3],
        "red" => [0.63, 0.065, 0.05],
        "green" => [0.14, 0.45, 0.091],
        _ => [0.78; 3],
    }
}

/// With direct light alone, all that a sample can show is the lamp itself, or some share of the
/// lamp's colour times the surface's reflectance. RGBE rounds each channel by less than a step of
/// the largest (1/128 of it or less).
fn is_colour_of(rgb: [f64; 3], material: &str, from_front: bool) -> bool {
    let largest = rgb.into_iter().fold(0.0, f64::max);
    let step = largest / 128.0;
    let like =
        |expected: [f64; 3], slack: f64| (0..3).all(|c| (rgb[c] - expected[c]).abs() <= slack);
    if material == "light" && from_front {
        return like(LAMP, step);
    }
    let kd = reflectance(material);
    let full = [0, 1, 2].map(|c| kd[c] * LAMP[c]);
    let share = largest / full.into_iter().fold(0.0, f64::max);
    // The share comes from a rounded channel, too.
    largest == 0.0 || like(full.map(|channel| channel * share), 2.0 * step)
}

#[test]
fn every_stored_sample_shows_the_first_surface_on_its_ray() {
    let place = Place::new();
    let sections = "scene = \"cornell.obj\"\n\
        [[section]]\norigin = [0.6, 0.6, -4]\naxes = [[4.3, 0, 0], [0, 4.2, 0], [0, 0, 5]]\ngrid = [3, 2, 4]\n\
        [[section]]\norigin = [0.5, 3.6, 0.5]\naxes = [[4.5, 0, 0.3], [0.2, 1.2, 0], [0, 0.1, 4.5]]\ngrid = [4, 2, 3]\n";
    place.write("two.toml", sections);
    let words = [
        "fill",
        "--config",
        "{}/two.toml",
        "-o",
        "{}/two.holo",
        "--bounces",
        "0",
        "--samples",
        "60k",
    ];
    place.run(&words).ok();

    let holodeck = holo_server::Holodeck::open_read_only(&place.path("two.holo"), 0).unwrap();
    assert!(holodeck.about.sections[0].obstructions, "the box's walls reach into it");
    assert!(
        !holodeck.about.sections[1].obstructions,
        "nothing stands between the blocks and the ceiling"
    );
    let faces = faces(&std::fs::read_to_string(place.path("cornell.obj")).unwrap());
    assert_eq!(faces.len(), 16);
    let stored = stored(&place.path("two.holo"));
    let (mut lit, mut samples, mut nothing) = (HashMap::<(u16, &str), u32>::new(), 0, 0);
    for ((key, _), numbered) in &stored.beams {
        let section: &Section = &holodeck.sections[usize::from(key.section)];
        let cells = section.cells(key.beam).unwrap();
        for (_, sample) in numbered.iter().take(20) {
            samples += 1;
            let ray = section.ray(cells, sample.coords);
            let skipped = if key.section == 0 { 0.0 } else { ray.length };
            let start = ray.origin + ray.direction * skipped;
            let distance = sample.distance(section.diagonal());
            // Half a step of the distance code (Table 1: 2¹¹ steps to the diagonal, then 2⁻¹¹ of
            // it), and single precision.
            let slack = (section.diagonal().max(distance) / 4096.0) * 1.001 + 1e-4;
            let fits = [false, true].into_iter().any(|diagonal| {
                match nearest(&faces, start, ray.direction, diagonal) {
                    None => distance.is_infinite() && sample.rgb() == [0.0; 3],
                    Some((expected, face)) => {
                        let [a, b, c, _] = face.corners;
                        let front = (b - a).cross(c - a).dot(ray.direction) < 0.0;
                        let rgb = sample.rgb().map(f64::from);
                        if rgb != [0.0; 3] {
                            *lit.entry((key.section, &face.material)).or_default() += 1;
                        }
                        (skipped + expected - distance).abs() <= slack
                            && is_colour_of(rgb, &face.material, front)
                    }
                }
            });
            nothing += u32::from(distance.is_infinite());
            assert!(fits, "{key:?}: {sample:?} at {distance} along {ray:?}");
        }
    }
    assert!(samples > 10_000 && nothing > 100, "{samples} samples, {nothing} of nothing");
    for material in ["white", "red", "green", "light"] {
        for section in [0, 1] {
            let seen = lit.get(&(section, material)).copied().unwrap_or_default();
            assert!(seen > 20, "section {section} shows {material} {seen} times");
        }
    }
}
