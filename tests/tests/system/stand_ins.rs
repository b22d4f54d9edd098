//! Stand-ins for the scene at displays: kept in the file, handed to displays, and taken for views
//! of their section.

use holo_picture::Picture;
use holo_tests::Place;

/// A room from 0 to 4; its wall at x = 4 shines less than the others.
const CORNERS: &str =
    "mtllib room.mtl\nv 0 0 0\nv 4 0 0\nv 4 4 0\nv 0 4 0\nv 0 0 4\nv 4 0 4\nv 4 4 4\nv 0 4 4\n";
const SHELL: &str = "usemtl wall\nf 1 2 3 4\nf 5 8 7 6\nf 1 4 8 5\nf 1 5 6 2\nf 4 3 7 8\n";
const DOOR: &str = "usemtl far\nf 2 6 7 3\n";
const MATERIALS: &str =
    "newmtl wall\nKd 0 0 0\nKe 1 1 1\nnewmtl far\nKd 0 0 0\nKe 0.25 0.25 0.25\n";

#[test]
fn a_file_keeps_its_stand_ins_and_displays_cast_them_and_see_through_portals_by_samples() {
    let place = Place::new();
    place.write("room.mtl", MATERIALS);
    place.write("room.obj", &[CORNERS, SHELL, DOOR].concat());
    place.write("shell.obj", &[CORNERS, SHELL].concat());
    place.write("door.obj", &[CORNERS, DOOR].concat());
    let fill = |words: &[&str]| {
        let section = "1,1,1 2,0,0 0,2,0 0,0,2 3,3,3";
        let always = [
            "fill",
            "{}/room.obj",
            "--section",
            section,
            "--engine",
            "path",
            "-o",
            "{}/room.holo",
            "--samples",
        ];
        place.run(&[&always[..], words].concat())
    };
    // Radiances of all pixels that look along x, one way and the other.
    let look = |towards: &str| -> Vec<f32> {
        let view =
            ["--vp", "2,2,2", "--vd", towards, "--vu", "0,0,1", "--vh", "60", "--size", "32x32"];
        let file = ["picture", "{}/room.holo", "-o", "{}/a.pfm"];
        place.run(&[&file[..], &view[..]].concat()).ok();
        Picture::read(place.path("a.pfm")).unwrap().pixels.into_iter().flatten().collect()
    };
    let all_are = |pixels: &[f32], expected: f32| {
        // RGBE's step.
        pixels.iter().all(|pixel| (pixel - expected).abs() <= expected / 128.0)
    };
    fill(&["100k", "--geometry", "3={}/shell.obj"]).failed(1, &["no section 3"]);

    fill(&["100k", "--geometry", "{}/shell.obj"]).ok();
    assert!(all_are(&look("1,0,0"), 0.0), "what the stand-in lacks is not there");
    assert!(all_are(&look("-1,0,0"), 1.0));

    fill(&["10k", "--geometry", "{}/shell.obj", "--portals", "0={}/door.obj"]).ok();
    assert!(all_are(&look("1,0,0"), 0.25), "beyond the portal samples are drawn by themselves");
    assert!(all_are(&look("-1,0,0"), 1.0));
    let info = place.run(&["info", "{}/room.holo", "--json"]).ok().whole_json();
    let known: Vec<_> = info["stand_ins"]
        .as_array()
        .unwrap()
        .iter()
        .map(|part| part[1].as_str().unwrap())
        .collect();
    assert_eq!(known, ["geometry", "portals"]);

    // A fill that names none leaves them as they are.
    fill(&["10k"]).ok();
    assert!(all_are(&look("1,0,0"), 0.25));
    place.run(&["verify", "{}/room.holo"]).ok();
}
