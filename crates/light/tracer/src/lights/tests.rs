//! Compares the light tree with exhaustive sums over all lights.

use glam::{DVec3, Vec3};
use holo_scene::{Bsdf, Material, Scene};

use super::*;

use crate::sampler::Sampler;

fn lights_of(scene: &Scene) -> Lights {
    Lights::new(scene, &Arc::new(PreparedSky::new(scene)))
}

/// Returns emitters in clusters, turned at random, of three sizes; a third of them are two-sided.
fn scene(count: usize, sky: f32) -> Scene {
    let mut s = Sampler::new(5, 0);
    let mut point = || DVec3::from_array([0, 1, 2].map(|_| f64::from(s.one()) - 0.5));
    let (mut positions, mut triangles, mut ids) = (Vec::new(), Vec::new(), Vec::new());
    let mut center = DVec3::ZERO;
    for i in 0..count {
        if i % 40 == 0 {
            center = point() * 20.0;
        }
        let (base, size) = (positions.len() as u32, [0.03, 0.3, 3.0][i % 3]);
        let middle = center + point();
        positions.extend([point(), point(), point()].map(|p| middle + p * size));
        triangles.push([base, base + 1, base + 2]);
        ids.push(u32::from(i % 7 < 2));
    }
    let material = |two_sided_emission| Material {
        name: "m".into(),
        bsdf: Bsdf::Diffuse { kd: [0.0; 3] },
        emission: [3.0, 2.0, 1.0],
        two_sided_emission,
    };
    let materials = vec![material(false), material(true)];
    Scene::from_world(&positions, &triangles, &ids, materials, [sky; 3]).expect("a valid scene").0
}

/// Returns a set of panes that lets nothing through.
fn closed() -> Arc<Panes> {
    Arc::new(Panes::closed())
}

/// Returns points among the emitters and far from them, with and without a normal.
fn vertices() -> Vec<(Vec3, Vec3)> {
    let mut s = Sampler::new(6, 0);
    let mut vector = || Vec3::new(s.one() - 0.5, s.one() - 0.5, s.one() - 0.5);
    (0..24)
        .map(|i| {
            let distance = [5.0, 20.0, 60.0, 4000.0][i % 4];
            let normal = if i % 3 == 0 { Vec3::ZERO } else { vector().normalize() };
            (vector() * distance, normal)
        })
        .collect()
}

#[test]
fn choices_follow_the_stated_probabilities_which_sum_to_one() {
    for (count, sky) in [(1, 0.0), (2, 0.3), (9, 0.0), (3000, 0.0), (3000, 2.0)] {
        let scene = Arc::new(scene(count, sky));
        let plain = lights_of(&scene);
        // Enough lights for cells.
        let celled = lights_of(&scene).with_cells(
            &GRIDS,
            &Arc::new(Raycaster::build(scene.clone()).expect("built")),
            &closed(),
        );
        assert_eq!(celled.cells.len(), if count > 8 { 2 } else { 0 });
        let mut s = Sampler::new(7, 0);
        let cases = vertices()
            .into_iter()
            .flat_map(|v| [(v, &plain, 1), (v, &celled, 1), (v, &celled, LATER)]);
        for ((point, normal), lights, scatterings) in cases {
            let seen = lights.at_vertex(point, normal, scatterings);
            let probabilities: Vec<f64> =
                (0..count as u32).map(|t| f64::from(lights.probability(&seen, t))).collect();
            let emitters: f64 = probabilities.iter().sum();
            // The rest of the probability belongs to descents that end without a light. They occur
            // because the bounds of a group may promise more light than any of its emitters gives.
            let lost = 1.0 - emitters - f64::from(seen.sky);
            assert!(lost > -1e-4, "{count} {point} {normal}: {lost}");
            let n = 40_000;
            // Chosen emitters, then the sky, then nothing.
            let mut counts = vec![0_u32; count + 2];
            for _ in 0..n {
                match lights
                    .choose(&seen, f64::from(s.one()) + f64::from(s.one()) * 2.0_f64.powi(-24))
                {
                    Some(ChosenLight::Triangle { triangle, probability, rest }) => {
                        assert!(
                            (f64::from(probability) / probabilities[triangle as usize] - 1.0).abs()
                                < 1e-4
                        );
                        assert!((0.0..1.0).contains(&rest));
                        counts[triangle as usize] += 1;
                    }
                    Some(ChosenLight::Sky { .. }) => counts[count] += 1,
                    Some(ChosenLight::Point { .. }) => panic!("there are none"),
                    None => counts[count + 1] += 1,
                }
            }
            let expected: Vec<f64> = probabilities
                .iter()
                .copied()
                .chain([f64::from(seen.sky), lost.max(0.0)])
                .map(|p| p * f64::from(n))
                .collect();
            let (mut chi2, mut cells, mut few) = (0.0, 0.0, (0.0, 0.0));
            for (&c, &e) in counts.iter().zip(&expected) {
                if e >= 8.0 {
                    chi2 += (f64::from(c) - e).powi(2) / e;
                    cells += 1.0;
                } else {
                    few = (few.0 + f64::from(c), few.1 + e);
                }
            }
            if few.1 >= 8.0 {
                chi2 += (few.0 - few.1).powi(2) / few.1;
                cells += 1.0;
            }
            if cells > 1.0 {
                // Wilson and Hilferty 1931. 360 tests at 4.5 sigma: by chance once in 800 sets of
                // seeds.
                let v = 2.0 / (9.0 * (cells - 1.0));
                let z = ((chi2 / (cells - 1.0)).cbrt() - (1.0 - v)) / v.sqrt();
                assert!(z < 4.5, "{count} {sky} {point} {normal}: chi² {chi2} of {cells}");
            }
        }
    }
}

#[test]
fn only_lights_that_can_contribute_have_a_probability() {
    let scene = scene(3000, 0.0);
    let lights = lights_of(&scene);
    let (mut lit, mut skipped) = (0, 0);
    for (point, normal) in vertices() {
        let seen = lights.at_vertex(point, normal, 1);
        for t in 0..3000 {
            let [a, b, c] = scene.corners(t);
            let facing = scene.normal(t).dot(point - a);
            let front =
                scene.materials[scene.material_id(t) as usize].two_sided_emission || facing > 0.0;
            let height = [a, b, c].iter().map(|v| normal.dot(v - point)).fold(f32::MIN, f32::max);
            let probability = lights.probability(&seen, t);
            let clear = 1e-3 * (1.0 + point.length());
            if front && facing.abs() > clear && (normal == Vec3::ZERO || height > clear) {
                assert!(probability > 0.0, "{t} from {point} {normal}");
                lit += 1;
            }
            // The sphere around the triangle is below the horizon, so its box is too.
            let size = (a - b).length() + (b - c).length() + (c - a).length();
            if (!front && facing.abs() > clear) || (normal != Vec3::ZERO && height < -2.0 * size) {
                assert!(probability == 0.0, "{t} from {point} {normal}: {probability}");
                skipped += 1;
            }
        }
    }
    assert!(lit > 10_000 && skipped > 10_000, "{lit} {skipped}");
}

#[test]
fn choices_follow_the_irradiance_of_lights() {
    // Uses irradiance without obstacles, by centroids. The error of one sample is the variance of
    // irradiance over probability, relative to the square of the whole. By power alone it is in the
    // hundreds here.
    let scene = scene(3000, 0.0);
    let lights = lights_of(&scene);
    let power: f64 = (0..3000).map(|t| scene.area(t)).sum();
    let (mut tree, mut table) = (0.0, 0.0);
    for (point, normal) in
        vertices().into_iter().filter(|v| v.1 != Vec3::ZERO && v.0.length() > 8.0)
    {
        let seen = lights.at_vertex(point, normal, 1);
        let (mut by_tree, mut by_power, mut whole) = (0.0, 0.0, 0.0);
        for t in 0..3000 {
            let [a, b, c] = scene.corners(t);
            let towards = ((a + b + c) / 3.0 - point).as_dvec3();
            let cosine = -scene.normal(t).as_dvec3().dot(towards.normalize());
            let two_sided = scene.material_id(t) == 1;
            let emitted = if two_sided { cosine.abs() } else { cosine.max(0.0) };
            let received = normal.as_dvec3().dot(towards.normalize()).max(0.0);
            let e = scene.area(t) * emitted * received / towards.length_squared();
            whole += e;
            if e > 0.0 {
                by_tree += e * e / f64::from(lights.probability(&seen, t));
                by_power += e * e * power / scene.area(t);
            }
        }
        if whole > 0.0 {
            tree += by_tree / (whole * whole) - 1.0;
            table += by_power / (whole * whole) - 1.0;
        }
    }
    println!("relative variance of one sample: {tree:.2} by the tree, {table:.2} by power");
    assert!(tree < 0.25 * table, "{tree} {table}");
}

/// Two rooms on the two sides of a wall: one lamp of eight small triangles in the first, fifty such
/// lamps in the second.
fn rooms() -> Arc<Raycaster> {
    let (mut positions, mut triangles, mut ids) = (Vec::new(), Vec::new(), Vec::new());
    let mut add = |corners: [[f64; 3]; 3], id: u32| {
        let base = positions.len() as u32;
        positions.extend(corners.map(DVec3::from_array));
        triangles.push([base, base + 1, base + 2]);
        ids.push(id);
    };
    // The wall at x = 0 reaches far beyond the lamps.
    add([[0.0, -60.0, -60.0], [0.0, 60.0, -60.0], [0.0, 0.0, 90.0]], 0);
    // A floor in both rooms.
    for x in [-10.0, 0.0] {
        add([[x, -5.0, 0.0], [x + 10.0, -5.0, 0.0], [x, 5.0, 0.0]], 0);
        add([[x + 10.0, -5.0, 0.0], [x + 10.0, 5.0, 0.0], [x, 5.0, 0.0]], 0);
    }
    let centers = std::iter::once([-6.0, 1.0])
        .chain((0..50).map(|i| [0.5 + f64::from(i % 10), f64::from(i / 10) - 2.5]));
    for [x, y] in centers {
        for k in 0..8 {
            // Faces down.
            let x = x + 0.02 * f64::from(k);
            add([[x, y, 3.0], [x, y + 0.02, 3.0], [x + 0.02, y, 3.0]], 1);
        }
    }
    let material = |emission| Material { emission, ..Material::grey("m") };
    let materials = vec![material([0.0; 3]), material([1.0; 3])];
    let scene = Scene::from_world(&positions, &triangles, &ids, materials, [0.0; 3])
        .expect("a valid scene")
        .0;
    Arc::new(Raycaster::build(Arc::new(scene)).expect("built"))
}

#[test]
fn lights_behind_a_wall_are_seldom_chosen_but_can_be() {
    let raycaster = rooms();
    let scene = raycaster.scene();
    let (plain, celled) =
        (lights_of(scene), lights_of(scene).with_cells(&GRIDS, &raycaster, &closed()));
    for (x, y) in [(-0.3, 0.1), (-2.0, 2.2), (-1.1, -4.0)] {
        let point = (DVec3::new(x, y, 0.0) - scene.origin).as_vec3();
        let visible = |lights: &Lights| {
            let seen = lights.at_vertex(point, Vec3::Z, 1);
            (5..13).map(|t| lights.probability(&seen, t)).sum::<f32>()
        };
        assert!(visible(&plain) < 0.25, "{}", visible(&plain));
        // The rest is the share for lights that no probe saw; part of that goes to these lamps too.
        assert!(visible(&celled) > 0.74, "{}", visible(&celled));
        // Cells of the coarse grid may reach through the wall, but no light is forgotten.
        for scatterings in [1, LATER] {
            let seen = celled.at_vertex(point, Vec3::Z, scatterings);
            assert!((5..413).all(|t| celled.probability(&seen, t) > 0.0));
        }
    }
}

#[test]
fn a_cell_does_not_depend_on_the_order_of_visits() {
    let raycaster = rooms();
    let lights =
        [0, 1].map(|_| lights_of(raycaster.scene()).with_cells(&GRIDS, &raycaster, &closed()));
    let mut s = Sampler::new(8, 0);
    let points: Vec<Vec3> = (0..300)
        .map(|_| Vec3::new(s.one() - 0.5, s.one() - 0.5, 0.0) * Vec3::new(20.0, 10.0, 1.0))
        .collect();
    let of = |lights: &Lights, point: &Vec3| {
        let seen = [1, LATER].map(|scatterings| lights.at_vertex(*point, Vec3::Z, scatterings));
        let probability = |(seen, t)| lights.probability(seen, t).to_bits();
        seen.iter()
            .flat_map(|seen| (5..413).map(move |t| (seen, t)))
            .map(probability)
            .collect::<Vec<_>>()
    };
    let forth: Vec<_> = points.iter().map(|p| of(&lights[0], p)).collect();
    let mut back: Vec<_> = std::thread::scope(|scope| {
        let both = points.chunks(150).map(|half| {
            let lights = &lights[1];
            scope.spawn(move || half.iter().rev().map(|p| of(lights, p)).collect::<Vec<_>>())
        });
        let both: Vec<_> = both.collect();
        both.into_iter().map(|thread| thread.join().expect("a thread")).rev().flatten().collect()
    });
    back.reverse();
    assert_eq!(forth, back);
}
