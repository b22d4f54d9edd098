//! Rays that pass near an eye (Larson & Simmons 1999, Appendix A).
// Clippy allows these in tests, but not in the tests' helpers.
#![allow(clippy::unwrap_used, clippy::panic)]

use crate::common::{Rng, UNIT, cornell, living_room, section};
use holo_section::{
    BeamId, BeamSampler, CellIndex, CellPair, DVec3, RayCoords, Section, Viewpoint,
    ray_eye_distance,
};
use std::collections::BTreeSet;

/// The width of a pixel at distance 3, in a picture 320 pixels wide over 60°.
fn footprint() -> f64 {
    2.0 * 3.0 * 30f64.to_radians().tan() / 320.0
}

/// The beams that view rays from the eye cross, in all directions, forwards and backwards.
fn crossed(section: &Section, eye: DVec3, rays: u32) -> BTreeSet<BeamId> {
    let mut rng = Rng(30);
    (0..rays)
        .filter_map(|_| section.line(eye, rng.direction()))
        .map(|hit| section.beam(hit.pair))
        .collect()
}

/// Returns the share of these beams' first samples that pass within the radius, and the share of
/// beams whose rays are uniform.
fn shares(section: &Section, beams: &BTreeSet<BeamId>, viewpoint: &Viewpoint) -> (f64, f64) {
    let eye = DVec3::from_array(viewpoint.eye);
    let (mut near, mut all, mut uniform) = (0, 0, 0);
    for &beam in beams {
        let sampler = section.beam_sampler(0, beam, Some(viewpoint)).unwrap();
        uniform += u32::from(!sampler.is_limited());
        for number in 0..21 {
            near += u32::from(
                ray_eye_distance(&sampler.ray(sampler.coords(number)), eye) <= viewpoint.radius,
            );
            all += 1;
        }
    }
    (f64::from(near) / f64::from(all), f64::from(uniform) / beams.len() as f64)
}

#[test]
fn nearly_all_rays_pass_within_a_pixel_footprint_of_the_eye() {
    for (name, section) in [("cornell", cornell()), ("living room", living_room())] {
        for (place, local) in [
            ("centre", [0.5, 0.5, 0.5]),
            ("off centre", [0.31, 0.62, 0.43]),
            ("near a wall", [0.02, 0.45, 0.55]),
            ("near a corner", [0.013, 0.021, 0.974]),
            ("outside, beside a wall", [-0.1, 0.4, 0.6]),
            ("far outside", [-1.5, 0.4, 0.6]),
            ("exactly on a wall", [0.0, 0.4, 0.6]),
        ] {
            let eye = section.local_to_world(DVec3::from_array(local));
            let viewpoint = Viewpoint { eye: eye.to_array(), radius: footprint() };
            let beams = crossed(&section, eye, 20_000);
            let (near, uniform) = shares(&section, &beams, &viewpoint);
            println!(
                "{name} {:?}, {place}: {:.2} % of rays within the radius, \
                 {:.2} % of {} beams uniform",
                section.spec().grid,
                near * 100.0,
                uniform * 100.0,
                beams.len()
            );
            assert!(near >= 0.99, "{name}, {place}: {near}");
            assert!(uniform <= 0.001, "{name}, {place}: {uniform}");
        }
    }
}

/// The eye of the scene's own view of the living room lies outside every section.
#[test]
fn an_eye_beside_the_section_is_served_like_one_inside() {
    let section = living_room();
    let viewpoint = Viewpoint { eye: [12.5, 0.5, 5.0], radius: footprint() };
    let beams = crossed(&section, DVec3::from_array(viewpoint.eye), 20_000);
    let (near, uniform) = shares(&section, &beams, &viewpoint);
    println!(
        "living view: {:.2} % within the radius, {:.2} % of {} beams uniform",
        near * 100.0,
        uniform * 100.0,
        beams.len()
    );
    assert!(near >= 0.99 && uniform <= 0.001);
}

/// Returns whether two cells have a point in common.
fn touch(section: &Section, pair: CellPair) -> bool {
    let ends = [0u8, 255];
    let cell = |c: CellIndex, u: u8, v: u8| {
        let n = section.spec().grid.map(f64::from);
        let (du, dv) = c.directions();
        let mut local = DVec3::ZERO;
        local[c.axis()] = f64::from(c.side());
        local[du] = (f64::from(c.u) + f64::from(u) / 255.0) / n[du];
        local[dv] = (f64::from(c.v) + f64::from(v) / 255.0) / n[dv];
        local
    };
    let corners = |c| {
        ends.into_iter()
            .flat_map(move |u| ends.into_iter().map(move |v| (u, v)))
            .map(move |(u, v)| cell(c, u, v))
    };
    corners(pair.entry).any(|p| corners(pair.exit).any(|q| p.distance(q) < 1e-9))
}

#[test]
fn limited_rays_are_spread_evenly_over_all_that_the_eye_sees_through_the_beam() {
    // The far cell is split into 16×16 boxes of 16×16 positions. `line`, an independent
    // computation, says which boxes the eye sees through the beam. A box is open if the line from
    // each of its positions through the eye is in the beam. It is closed if no such line from it or
    // its neighbours is.
    let section = cornell();
    let radius = 0.005;
    let samples = 8192;
    let (mut open_boxes, mut closed_boxes) = (0, 0);
    for local in [[0.5, 0.5, 0.5], [0.1, 0.6, 0.4], [0.03, 0.6, 0.4], [-0.2, 0.5, 0.5]] {
        let eye = section.local_to_world(DVec3::from_array(local));
        for beam in crossed(&section, eye, 40) {
            let pair = section.cells(beam).unwrap();
            let ends = |coords| {
                let ray = section.ray(pair, RayCoords(coords));
                (ray.origin, ray.origin + ray.direction * ray.length)
            };
            if touch(&section, pair) {
                // Beside the common edge the two ends are too near each other to aim, so samples
                // move elsewhere.
                continue;
            }
            let (entry, exit) = ends([128; 4]);
            let entry_is_far = entry.distance(eye) >= exit.distance(eye);
            let mut seen = [0u32; 256];
            for u in 0..=255u8 {
                for v in 0..=255u8 {
                    let (entry, exit) = ends([u, v, u, v]);
                    let towards = if entry_is_far { eye - entry } else { exit - eye };
                    // An eye outside may be in front of the near cell or behind it. In both cases
                    // the line runs in the beam's direction.
                    let met = [towards, -towards].map(|d| section.line(eye, d).map(|hit| hit.pair));
                    seen[usize::from(u >> 4) * 16 + usize::from(v >> 4)] +=
                        u32::from(met.contains(&Some(pair)));
                }
            }
            let sampler = section
                .beam_sampler(0, beam, Some(&Viewpoint { eye: eye.to_array(), radius }))
                .unwrap();
            let mut counts = [0u32; 256];
            for number in 0..samples {
                let [a, b, c, d] = sampler.coords(number).0;
                let (u, v) = if entry_is_far { (a, b) } else { (c, d) };
                counts[usize::from(u >> 4) * 16 + usize::from(v >> 4)] += 1;
            }
            let share = f64::from(samples) / f64::from(seen.iter().sum::<u32>());
            for i in 0..256usize {
                let (u, v) = (i / 16, i % 16);
                let around = (u.saturating_sub(1)..=(u + 1).min(15))
                    .flat_map(|u| (v.saturating_sub(1)..=(v + 1).min(15)).map(move |v| u * 16 + v));
                if seen[i] == 256 {
                    open_boxes += 1;
                    // Rays are at least as even as random samples, at 5 standard deviations
                    // (Poisson).
                    let expected = 256.0 * share;
                    let miss = (f64::from(counts[i]) - expected).abs();
                    assert!(
                        miss <= 5.0 * expected.sqrt(),
                        "{pair:?} box {i}: {} samples, expected {expected}",
                        counts[i]
                    );
                } else if around.map(|n| seen[n]).sum::<u32>() == 0 {
                    closed_boxes += 1;
                    assert_eq!(counts[i], 0, "{pair:?} box {i}");
                }
            }
            // All rays differ.
            let distinct: BTreeSet<RayCoords> = (0..1000).map(|n| sampler.coords(n)).collect();
            assert!(distinct.len() >= 900, "{pair:?}: {} distinct rays of 1000", distinct.len());
        }
    }
    println!("{open_boxes} open and {closed_boxes} closed boxes");
    assert!(open_boxes > 5000 && closed_boxes > 5000);
}

#[test]
fn positions_are_uniform_over_the_visible_part() {
    // The eye is one unit outside, on the axis of two opposite cells. It sees the whole exit wall,
    // at distance 2, through the central half of the entry wall in each direction.
    let section = section([0.0; 3], UNIT, [1; 3]);
    let pair = CellPair {
        entry: CellIndex { wall: 4, u: 0, v: 0 },
        exit: CellIndex { wall: 5, u: 0, v: 0 },
    };
    let viewpoint = Viewpoint { eye: [0.5, 0.5, -1.0], radius: 1e-3 };
    let sampler = section.beam_sampler(0, section.beam(pair), Some(&viewpoint)).unwrap();
    assert!(sampler.is_limited());
    let mut counts = [0u32; 64];
    for n in 0..4096 {
        let c = sampler.coords(n).0;
        counts[usize::from(c[2] >> 5) * 8 + usize::from(c[3] >> 5)] += 1;
        assert!((63..=192).contains(&c[0]) && (63..=192).contains(&c[1]), "{c:?}");
    }
    // With a low-discrepancy sequence every box is within 25 % of its share of 64. For random
    // samples, the standard deviation would be 12 %.
    assert!(counts.iter().all(|&n| (48..=80).contains(&n)), "{counts:?}");
}

#[test]
fn a_radius_of_a_cells_size_does_not_pile_rays_up_at_the_borders() {
    let section = section([0.0; 3], UNIT, [8; 3]);
    let pair = CellPair {
        entry: CellIndex { wall: 0, u: 3, v: 3 },
        exit: CellIndex { wall: 1, u: 3, v: 3 },
    };
    let viewpoint = Viewpoint { eye: [0.4, 0.43, 0.45], radius: 0.1 };
    let sampler = section.beam_sampler(0, section.beam(pair), Some(&viewpoint)).unwrap();
    let eye = DVec3::from_array(viewpoint.eye);
    let n = 4096;
    for place in 0..4 {
        let mut strips = [0u32; 16];
        (0..n).for_each(|number| strips[usize::from(sampler.coords(number).0[place] >> 4)] += 1);
        // The eye lies well inside a beam as wide as the radius. No strip of a 16th of a cell then
        // gets three times its share.
        assert!(strips.iter().all(|&count| count < 3 * n / 16), "coordinate {place}: {strips:?}");
    }
    let near = (0..n)
        .filter(|&i| ray_eye_distance(&sampler.ray(sampler.coords(i)), eye) <= viewpoint.radius)
        .count();
    assert_eq!(near, n as usize);
}

#[test]
fn an_eye_whose_sphere_alone_reaches_the_beam_still_gets_near_rays() {
    let section = section([0.0; 3], UNIT, [8; 3]);
    let pair = CellPair {
        entry: CellIndex { wall: 0, u: 3, v: 3 },
        exit: CellIndex { wall: 1, u: 3, v: 3 },
    };
    for (beside, limited) in [(0.005, true), (0.019, true), (0.021, false), (0.1, false)] {
        // The beam's hull is the prism with y and z from 3/8 to 4/8.
        let viewpoint = Viewpoint { eye: [0.5, 0.5 + beside, 0.45], radius: 0.02 };
        let sampler = section.beam_sampler(0, section.beam(pair), Some(&viewpoint)).unwrap();
        assert_eq!(sampler.is_limited(), limited, "{beside}");
        let uniform = section.beam_sampler(0, section.beam(pair), None).unwrap();
        let eye = DVec3::from_array(viewpoint.eye);
        let near = (0..100)
            .filter(|&n| ray_eye_distance(&sampler.ray(sampler.coords(n)), eye) <= 0.02)
            .count();
        if limited {
            assert!(near >= 20, "{beside}: {near}");
        } else {
            assert!((0..100).all(|n| sampler.coords(n) == uniform.coords(n)));
        }
    }
}

fn first(sampler: &BeamSampler) -> Vec<[u8; 4]> {
    (0..30).map(|n| sampler.coords(n).0).collect()
}

#[test]
fn rays_depend_on_section_beam_number_and_viewpoint_alone() {
    let section = cornell();
    let eye = section.local_to_world(DVec3::splat(0.45));
    let near = Viewpoint { eye: eye.to_array(), radius: 0.01 };
    for beam in crossed(&section, eye, 50) {
        let rays = first(&section.beam_sampler(0, beam, Some(&near)).unwrap());
        assert_eq!(rays, first(&section.beam_sampler(0, beam, Some(&near)).unwrap()));
        assert_ne!(rays, first(&section.beam_sampler(1, beam, Some(&near)).unwrap()));
        let moved = Viewpoint { eye: (eye + DVec3::splat(0.1)).to_array(), ..near };
        assert_ne!(rays, first(&section.beam_sampler(0, beam, Some(&moved)).unwrap()));
    }
}

#[test]
fn impossible_viewpoints_give_rays_of_the_beam() {
    let section = section([0.0; 3], UNIT, [4; 3]);
    let mut rng = Rng(32);
    let odd = [0.0, 1.0, 0.25, 0.5 + 0.5 / 1024.0, -1e30, 1e30, 1e308, f64::NAN, f64::INFINITY];
    for _ in 0..20_000 {
        let mut pick = || odd[rng.below(odd.len() as u64) as usize];
        let viewpoint = Viewpoint { eye: [pick(), pick(), pick()], radius: pick() };
        let beam = BeamId(rng.below(section.beam_count()));
        let sampler = section.beam_sampler(0, beam, Some(&viewpoint)).unwrap();
        for number in [0, 1, u32::MAX] {
            let ray = sampler.ray(sampler.coords(number));
            assert_eq!(
                section.line(ray.origin, ray.direction).map(|h| section.beam(h.pair)),
                Some(beam)
            );
        }
    }
}
