//! Measures the share of rays that pass within the wanted radius of an eye (Larson & Simmons 1999,
//! Appendix A). Prints JSON.
//!
//! `cargo run --release -p holo-section --example viewpoint_share`
//!
//! For each place of the eye, the beams are those that rays from it cross, in all directions. The
//! rays are the first packet of 21 samples of each beam. The radius is the width of a pixel at
//! distance 3, in a picture 320 pixels wide over 60°.

use std::collections::BTreeSet;
use std::error::Error;

use holo_section::{
    BeamId, DVec3, Section, SectionSpec, ViewClass, Viewpoint, ray_eye_distance, seed,
};

/// View rays in random directions that choose the beams.
const RAYS: u32 = 20_000;

/// Samples of a packet.
const PACKET: u32 = 21;

/// Places of the eye, as shares of the section's axes.
const PLACES: [(&str, [f64; 3]); 6] = [
    ("at the centre", [0.5, 0.5, 0.5]),
    ("off the centre", [0.31, 0.62, 0.43]),
    ("near a wall", [0.02, 0.45, 0.55]),
    ("near a corner", [0.013, 0.021, 0.974]),
    ("outside, beside a wall", [-0.1, 0.4, 0.6]),
    ("far outside", [-1.5, 0.4, 0.6]),
];

fn main() -> Result<(), Box<dyn Error>> {
    let radius = 2.0 * 3.0 * 30f64.to_radians().tan() / 320.0;
    let cornell = ("cornell", [0.6, 0.6, -4.0], [4.3, 4.2, 5.0], Some([8; 3]));
    let living = ("cabin, living room", [14.0, 1.0, 3.0], [10.0, 14.0, 4.0], None);
    let mut lines = Vec::new();
    for (name, origin, [x, y, z], grid) in [cornell, living] {
        let axes = [[x, 0.0, 0.0], [0.0, y, 0.0], [0.0, 0.0, z]];
        let grid = grid.unwrap_or_else(|| Section::default_grid(axes));
        let section = Section::new(SectionSpec {
            origin,
            axes,
            grid,
            class: ViewClass::Interior,
            obstructions: true,
        })?;
        for (place, local) in PLACES {
            let eye = section.local_to_world(DVec3::from_array(local));
            let Share { beams, near, rays, uniform } = share(&section, eye, radius);
            lines.push(format!(
                "{{\"section\":\"{name}\",\"grid\":{grid:?},\"eye\":\"{place}\",\
                 \"radius\":{radius},\"beams\":{beams},\"rays\":{rays},\"within_radius\":{near},\"uniform_beams\":{uniform}}}"
            ));
        }
    }
    println!("[{}]", lines.join(",\n "));
    Ok(())
}

struct Share {
    beams: usize,
    /// Rays within the radius.
    near: u32,
    /// Rays in all.
    rays: u32,
    /// Beams without any ray near enough to the eye. Their rays are spread over the whole beam.
    uniform: u32,
}

fn share(section: &Section, eye: DVec3, radius: f64) -> Share {
    let beams: BTreeSet<BeamId> = (0..RAYS)
        .filter_map(|number| section.line(eye, direction(number)))
        .map(|hit| section.beam(hit.pair))
        .collect();
    let viewpoint = Viewpoint { eye: eye.to_array(), radius };
    let mut share = Share { beams: beams.len(), near: 0, rays: 0, uniform: 0 };
    for sampler in beams.iter().filter_map(|&beam| section.beam_sampler(0, beam, Some(&viewpoint)))
    {
        share.uniform += u32::from(!sampler.is_limited());
        share.rays += PACKET;
        for number in 0..PACKET {
            let distance = ray_eye_distance(&sampler.ray(sampler.coords(number)), eye);
            share.near += u32::from(distance <= radius);
        }
    }
    share
}

/// Uniform over the sphere: a height and an angle.
fn direction(number: u32) -> DVec3 {
    let unit = |dimension| {
        (seed(30, BeamId(u64::from(number)), dimension) >> 11) as f64 / (1u64 << 53) as f64
    };
    let height = 2.0 * unit(0) - 1.0;
    let (sin, cos) = (std::f64::consts::TAU * unit(1)).sin_cos();
    let around = (1.0 - height * height).sqrt();
    DVec3::new(around * cos, around * sin, height)
}
