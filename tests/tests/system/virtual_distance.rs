//! Compares a file of virtual distances with a room unfolded at its mirror, and checks that the
//! file keeps its kind of distance.

use holo_section::{DVec3, Section};
use holo_tests::{Place, stored};

/// A room from 0 to 4 whose wall at x = 4 is a mirror.
const ROOM: &str = "mtllib room.mtl\n\
    v 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 0 0 4\nv 4 0 4\nv 4 4 4\nv 0 4 4\n\
    usemtl wall\nf 1 2 3 4\nf 5 8 7 6\nf 1 4 8 5\nf 1 5 6 2\nf 4 3 7 8\nusemtl mirror\nf 2 6 7 3\n";
const MATERIALS: &str =
    "newmtl wall\nKd 0.5 0.5 0.5\nKe 1 1 1\nnewmtl mirror\nillum 3\nKs 0.9 0.9 0.9\n";

/// From inside a box to its wall.
fn out_of(low: DVec3, high: DVec3, origin: DVec3, direction: DVec3) -> f64 {
    let walls = (0..3).map(|axis| {
        let wall = if direction[axis] > 0.0 { high[axis] } else { low[axis] };
        (wall - origin[axis]) / direction[axis]
    });
    walls.filter(|t| t.is_finite()).fold(f64::INFINITY, f64::min)
}

#[test]
fn a_file_keeps_the_distances_that_it_was_made_with_and_is_not_filled_with_others() {
    let place = Place::new();
    place.write("room.obj", ROOM);
    place.write("room.mtl", MATERIALS);
    let fill = |file: &str, words: &[&str]| {
        let section = "1,1,1 2.5,0,0 0,2,0 0,0,2 3,3,3";
        let always = ["fill", "{}/room.obj", "--section", section, "--samples", "20k", "-o"];
        place.run(&[&always[..], &[file], words].concat())
    };
    fill("{}/virtual.holo", &["--virtual-distance"]).ok();
    fill("{}/plain.holo", &[]).ok();
    // Filling with the other kind would mix them, and filling with the same kind is the usual case.
    fill("{}/virtual.holo", &[]).failed(
        1,
        &["virtual.holo", "--virtual-distance is on in the file, and off now", "Name another file"],
    );
    fill("{}/plain.holo", &["--virtual-distance"])
        .failed(1, &["plain.holo", "--virtual-distance is off in the file"]);
    fill("{}/virtual.holo", &["--virtual-distance"]).ok();

    let (low, high) = (DVec3::ZERO, DVec3::splat(4.0));
    for (file, is_virtual) in [("virtual.holo", true), ("plain.holo", false)] {
        let info = place.run(&["info", &place.text(file), "--json"]).ok().whole_json();
        assert_eq!(info["settings"]["virtual_distance"], is_virtual);
        let holodeck = holo_server::Holodeck::open_read_only(&place.path(file), 0).unwrap();
        let section: &Section = &holodeck.sections[0];
        let (mut farther, mut samples) = (0, 0);
        for ((key, _), numbered) in &stored(&place.path(file)).beams {
            let cells = section.cells(key.beam).unwrap();
            for (_, sample) in numbered {
                let ray = section.ray(cells, sample.coords);
                // Unfolded at the mirror, the room is twice as long.
                let unfolded = if is_virtual { high + DVec3::X * 4.0 } else { high };
                let expected = out_of(low, unfolded, ray.origin, ray.direction);
                let distance = sample.distance(section.diagonal());
                // Half a step of the distance code, and single precision.
                let slack = (section.diagonal().max(distance) / 4096.0) * 1.001 + 1e-4;
                assert!(
                    (distance - expected).abs() < slack,
                    "{file} {key:?}: {distance}, not {expected}, along {ray:?}"
                );
                farther += u32::from(expected > out_of(low, high, ray.origin, ray.direction) + 0.5);
                samples += 1;
            }
        }
        assert!(samples > 15_000, "{samples}");
        assert!(!is_virtual || farther > samples / 20, "{farther} of {samples} are of the mirror");
    }
}
