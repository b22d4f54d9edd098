//! A corridor with a bend that gets its light only through an open door, in metres, +Z up.
//!
//! Invariant: the lamp hangs on the room's side of the door's wall and shines away from it. Both
//! arms of the corridor lie behind its plane, so nothing in them is lit directly.

use std::fmt::Write;

/// An upright or level rectangle: a box without extent along one axis.
pub struct Rectangle {
    /// Its material.
    pub material: &'static str,
    /// Its lowest corner.
    pub low: [f64; 3],
    /// Its highest corner.
    pub high: [f64; 3],
    /// Whether it faces along its axis, or against it.
    pub along: bool,
}

const fn facing(along: bool, material: &'static str, low: [f64; 3], high: [f64; 3]) -> Rectangle {
    Rectangle { material, low, high, along }
}

/// Faces along +x, +y or +z.
const fn plus(material: &'static str, low: [f64; 3], high: [f64; 3]) -> Rectangle {
    facing(true, material, low, high)
}

/// Faces along -x, -y or -z.
const fn minus(material: &'static str, low: [f64; 3], high: [f64; 3]) -> Rectangle {
    facing(false, material, low, high)
}

/// The corridor's side of the wall with the door, along y. The wall ends at [`ROOM_FROM`].
pub const CORRIDOR_TO: f64 = 3.4;
/// The room's side of that wall, along y.
pub const ROOM_FROM: f64 = 3.55;

/// All rectangles.
pub const RECTANGLES: [Rectangle; 35] = [
    // The long arm, along x.
    plus("floor", [0.0, 0.0, 0.0], [8.0, 1.8, 0.0]),
    minus("ceiling", [0.0, 0.0, 2.6], [8.0, 1.8, 2.6]),
    plus("wall", [0.0, 0.0, 0.0], [8.0, 0.0, 2.6]),
    plus("wall", [0.0, 0.0, 0.0], [0.0, 1.8, 2.6]),
    minus("wall", [0.0, 1.8, 0.0], [6.2, 1.8, 2.6]),
    // The outer wall of both arms.
    minus("wall", [8.0, 0.0, 0.0], [8.0, CORRIDOR_TO, 2.6]),
    // The short arm, along y.
    plus("floor", [6.2, 1.8, 0.0], [8.0, CORRIDOR_TO, 0.0]),
    minus("ceiling", [6.2, 1.8, 2.6], [8.0, CORRIDOR_TO, 2.6]),
    plus("wall", [6.2, 1.8, 0.0], [6.2, CORRIDOR_TO, 2.6]),
    // The wall with the door, seen from the corridor.
    minus("wall", [6.2, CORRIDOR_TO, 0.0], [6.4, CORRIDOR_TO, 2.6]),
    minus("wall", [7.8, CORRIDOR_TO, 0.0], [8.0, CORRIDOR_TO, 2.6]),
    minus("wall", [6.4, CORRIDOR_TO, 2.2], [7.8, CORRIDOR_TO, 2.6]),
    // The doorway.
    plus("floor", [6.4, CORRIDOR_TO, 0.0], [7.8, ROOM_FROM, 0.0]),
    minus("frame", [6.4, CORRIDOR_TO, 2.2], [7.8, ROOM_FROM, 2.2]),
    plus("frame", [6.4, CORRIDOR_TO, 0.0], [6.4, ROOM_FROM, 2.2]),
    minus("frame", [7.8, CORRIDOR_TO, 0.0], [7.8, ROOM_FROM, 2.2]),
    // The room.
    plus("floor", [5.0, ROOM_FROM, 0.0], [10.0, 7.55, 0.0]),
    minus("ceiling", [5.0, ROOM_FROM, 2.6], [10.0, 7.55, 2.6]),
    plus("warm", [5.0, ROOM_FROM, 0.0], [5.0, 7.55, 2.6]),
    minus("warm", [10.0, ROOM_FROM, 0.0], [10.0, 7.55, 2.6]),
    minus("warm", [5.0, 7.55, 0.0], [10.0, 7.55, 2.6]),
    plus("warm", [5.0, ROOM_FROM, 0.0], [6.4, ROOM_FROM, 2.6]),
    plus("warm", [7.8, ROOM_FROM, 0.0], [10.0, ROOM_FROM, 2.6]),
    plus("warm", [6.4, ROOM_FROM, 2.2], [7.8, ROOM_FROM, 2.6]),
    plus("lamp", [8.4, 3.57, 1.2], [9.8, 3.57, 2.2]),
    // The leaf of the door, without thickness, opened to a right angle.
    plus("wood", [6.38, ROOM_FROM, 0.01], [6.38, 4.95, 2.15]),
    // A bench in the long arm.
    plus("red", [3.6, 0.05, 0.45], [5.0, 0.45, 0.45]),
    minus("red", [3.6, 0.05, 0.0], [3.6, 0.45, 0.45]),
    plus("red", [5.0, 0.05, 0.0], [5.0, 0.45, 0.45]),
    minus("red", [3.6, 0.05, 0.0], [5.0, 0.05, 0.45]),
    plus("red", [3.6, 0.45, 0.0], [5.0, 0.45, 0.45]),
    // A locker at the outer wall of the short arm.
    plus("blue", [7.6, 2.1, 1.8], [8.0, 2.9, 1.8]),
    minus("blue", [7.6, 2.1, 0.0], [7.6, 2.9, 1.8]),
    minus("blue", [7.6, 2.1, 0.0], [8.0, 2.1, 1.8]),
    plus("blue", [7.6, 2.9, 0.0], [8.0, 2.9, 1.8]),
];

/// The material library.
pub const MTL: &str = "\
newmtl wall
Kd 0.75 0.75 0.72
illum 1

newmtl ceiling
Kd 0.8 0.8 0.8
illum 1

newmtl floor
Kd 0.4 0.32 0.25
illum 1

newmtl warm
Kd 0.8 0.72 0.55
illum 1

newmtl frame
Kd 0.6 0.6 0.6
illum 1

newmtl wood
Kd 0.5 0.3 0.15
illum 1

newmtl red
Kd 0.6 0.15 0.1
illum 1

newmtl blue
Kd 0.15 0.3 0.5
illum 1

newmtl lamp
Kd 0 0 0
Ke 40 36 30
illum 1
";

/// Sections for both arms and the room. The first view is along the long arm.
pub const CONFIG: &str = r#"# A corridor lit only indirectly, for `holodeck --config`.
scene = "corridor.obj"
up = [0, 0, 1]
unit = 1.0
sky = [0, 0, 0]
two_sided_lights = false

[[section]]
name = "long arm"
origin = [0.2, 0.2, 1]
axes = [[7.3, 0, 0], [0, 1.4, 0], [0, 0, 1.2]]

[[section]]
name = "short arm"
origin = [6.4, 2.0, 1]
axes = [[1.1, 0, 0], [0, 1.3, 0], [0, 0, 1.2]]

[[section]]
name = "room"
origin = [5.3, 5.1, 1]
axes = [[4.4, 0, 0], [0, 2.2, 0], [0, 0, 1.2]]

[[view]]
name = "long arm"
vp = [2.2, 0.8, 1.55]
vd = [1, 0.05, -0.1]
vu = [0, 0, 1]
vh = 60

[[view]]
name = "to the door"
vp = [7.1, 0.6, 1.55]
vd = [0, 1, -0.05]
vu = [0, 0, 1]
vh = 60
"#;

impl Rectangle {
    /// Returns its corners, counter-clockwise from the side that it faces.
    pub fn corners(&self) -> [[f64; 3]; 4] {
        let (low, high) = (self.low, self.high);
        // One axis has no extent. The two after it, in cyclic order, turn counter-clockwise seen
        // from its end.
        let normal = (0..3).find(|&axis| low[axis] == high[axis]).unwrap_or(0);
        let (first, second) = ((normal + 1) % 3, (normal + 2) % 3);
        let corner = |on_first: bool, on_second: bool| {
            let mut corner = low;
            corner[first] = if on_first { high[first] } else { low[first] };
            corner[second] = if on_second { high[second] } else { low[second] };
            corner
        };
        let mut corners =
            [corner(false, false), corner(true, false), corner(true, true), corner(false, true)];
        if !self.along {
            corners.reverse();
        }
        corners
    }
}

/// Returns the OBJ file.
pub fn obj() -> String {
    let mut text =
        String::from("# A corridor lit only indirectly, metres, +Z up.\nmtllib corridor.mtl\n");
    for (i, rectangle) in RECTANGLES.iter().enumerate() {
        for [x, y, z] in rectangle.corners() {
            let _ = writeln!(text, "v {x} {y} {z}");
        }
        let first = 4 * i + 1;
        let (second, third, fourth) = (first + 1, first + 2, first + 3);
        let _ =
            writeln!(text, "usemtl {}\nf {first} {second} {third} {fourth}", rectangle.material);
    }
    text
}
