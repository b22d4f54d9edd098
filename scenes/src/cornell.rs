//! The Cornell box from the measurements that the Program of Computer Graphics at Cornell
//! University published (<https://www.graphics.cornell.edu/online/box/data.html>), in units of 100
//! mm, +Y up.
//!
//! The reflectances are the usual RGB conversions of the measured spectra. The lamp lies 0.1 mm
//! below the ceiling, which has a hole there in the published data, so that the two do not
//! coincide.

use std::fmt::Write;

/// A quadrilateral: its material, and its corners in millimetres, counter-clockwise from the
/// visible side.
type Quad = (&'static str, [[f64; 3]; 4]);

/// Published corners, except for the lamp, which is 0.1 mm lower because it covers a hole.
pub const QUADS: [Quad; 16] = [
    ("white", [[552.8, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 559.2], [549.6, 0.0, 559.2]]),
    ("white", [[556.0, 548.8, 0.0], [556.0, 548.8, 559.2], [0.0, 548.8, 559.2], [0.0, 548.8, 0.0]]),
    ("white", [[549.6, 0.0, 559.2], [0.0, 0.0, 559.2], [0.0, 548.8, 559.2], [556.0, 548.8, 559.2]]),
    ("green", [[0.0, 0.0, 559.2], [0.0, 0.0, 0.0], [0.0, 548.8, 0.0], [0.0, 548.8, 559.2]]),
    ("red", [[552.8, 0.0, 0.0], [549.6, 0.0, 559.2], [556.0, 548.8, 559.2], [556.0, 548.8, 0.0]]),
    (
        "light",
        [
            [343.0, 548.7, 227.0],
            [343.0, 548.7, 332.0],
            [213.0, 548.7, 332.0],
            [213.0, 548.7, 227.0],
        ],
    ),
    // The short block.
    (
        "white",
        [[130.0, 165.0, 65.0], [82.0, 165.0, 225.0], [240.0, 165.0, 272.0], [290.0, 165.0, 114.0]],
    ),
    (
        "white",
        [[290.0, 0.0, 114.0], [290.0, 165.0, 114.0], [240.0, 165.0, 272.0], [240.0, 0.0, 272.0]],
    ),
    (
        "white",
        [[130.0, 0.0, 65.0], [130.0, 165.0, 65.0], [290.0, 165.0, 114.0], [290.0, 0.0, 114.0]],
    ),
    ("white", [[82.0, 0.0, 225.0], [82.0, 165.0, 225.0], [130.0, 165.0, 65.0], [130.0, 0.0, 65.0]]),
    (
        "white",
        [[240.0, 0.0, 272.0], [240.0, 165.0, 272.0], [82.0, 165.0, 225.0], [82.0, 0.0, 225.0]],
    ),
    // The tall block.
    (
        "white",
        [
            [423.0, 330.0, 247.0],
            [265.0, 330.0, 296.0],
            [314.0, 330.0, 456.0],
            [472.0, 330.0, 406.0],
        ],
    ),
    (
        "white",
        [[423.0, 0.0, 247.0], [423.0, 330.0, 247.0], [472.0, 330.0, 406.0], [472.0, 0.0, 406.0]],
    ),
    (
        "white",
        [[472.0, 0.0, 406.0], [472.0, 330.0, 406.0], [314.0, 330.0, 456.0], [314.0, 0.0, 456.0]],
    ),
    (
        "white",
        [[314.0, 0.0, 456.0], [314.0, 330.0, 456.0], [265.0, 330.0, 296.0], [265.0, 0.0, 296.0]],
    ),
    (
        "white",
        [[265.0, 0.0, 296.0], [265.0, 330.0, 296.0], [423.0, 330.0, 247.0], [423.0, 0.0, 247.0]],
    ),
];

/// The material library.
pub const MTL: &str = "\
newmtl white
Kd 0.73 0.73 0.73
illum 1

newmtl red
Kd 0.63 0.065 0.05
illum 1

newmtl green
Kd 0.14 0.45 0.091
illum 1

newmtl light
Kd 0.78 0.78 0.78
Ke 17 12 4
illum 1
";

/// A section in front of the box that extends into it, the usual view, and a view from inside.
pub const CONFIG: &str = r#"# The Cornell box, for `holodeck --config`.
scene = "cornell.obj"
up = [0, 1, 0]
unit = 0.1
sky = [0, 0, 0]
two_sided_lights = false

[[section]]
name = "before the box"
origin = [0.6, 0.6, -4]
axes = [[4.3, 0, 0], [0, 4.2, 0], [0, 0, 5]]
grid = [8, 8, 8]

[[view]]
name = "front"
vp = [2.78, 2.73, -2]
vd = [0, 0, 1]
vu = [0, 1, 0]
vh = 60

[[view]]
name = "left"
vp = [4.4, 3.6, -1]
vd = [-0.35, -0.25, 0.9]
vu = [0, 1, 0]
vh = 65
"#;

/// Returns the OBJ file.
pub fn obj() -> String {
    let mut text = String::from("# The Cornell box, units of 100 mm, +Y up.\nmtllib cornell.mtl\n");
    for (i, (material, corners)) in QUADS.iter().enumerate() {
        for corner in corners {
            // Published in millimetres with one decimal, so thousandths of 100 mm are exact.
            let [x, y, z] = corner.map(|mm| (mm * 10.0).round() / 1000.0);
            let _ = writeln!(text, "v {x} {y} {z}");
        }
        let first = 4 * i + 1;
        let _ = writeln!(
            text,
            "usemtl {material}\nf {first} {} {} {}",
            first + 1,
            first + 2,
            first + 3
        );
    }
    text
}
