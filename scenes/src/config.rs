//! Sections and views of the interior, and its configuration file for `holodeck --config`.
//!
//! Invariant: each room has one section, clear of walls and furniture. The eye of every view lies
//! inside a section.

use std::fmt::Write;

/// An upright box from which one looks outwards.
pub struct RoomSection {
    /// Name of its room.
    pub name: &'static str,
    /// The lowest corner, in metres.
    pub origin: [f64; 3],
    /// The extent along x, y and z, in metres.
    pub size: [f64; 3],
}

/// A view of a room.
pub struct RoomView {
    /// Its name on the command line.
    pub name: &'static str,
    /// The eye's position, in metres.
    pub vp: [f64; 3],
    /// The direction of view.
    pub vd: [f64; 3],
    /// Horizontal field of view in degrees.
    pub vh: f64,
}

/// The sections, one for each room.
pub const SECTIONS: [RoomSection; 6] = [
    RoomSection { name: "living room", origin: [0.55, 0.55, 1.05], size: [4.35, 3.45, 1.15] },
    RoomSection { name: "kitchen", origin: [7.35, 0.5, 1.05], size: [2.65, 3.8, 0.65] },
    RoomSection { name: "hallway", origin: [0.3, 5.3, 1.05], size: [9.9, 0.9, 1.15] },
    RoomSection { name: "bedroom", origin: [0.65, 7.15, 1.05], size: [3.5, 3.2, 1.15] },
    RoomSection { name: "bathroom", origin: [5.75, 6.9, 1.05], size: [2.2, 2.9, 1.15] },
    RoomSection { name: "study", origin: [8.75, 6.85, 1.05], size: [2.0, 2.95, 1.15] },
];

/// The views; the first is the initial one.
pub const VIEWS: [RoomView; 6] = [
    RoomView { name: "living", vp: [0.8, 0.75, 1.55], vd: [0.76, 0.62, -0.07], vh: 78.0 },
    RoomView { name: "kitchen", vp: [7.45, 0.6, 1.6], vd: [0.55, 0.83, -0.14], vh: 75.0 },
    RoomView { name: "hallway", vp: [9.8, 5.8, 1.55], vd: [-1.0, 0.02, -0.06], vh: 65.0 },
    RoomView { name: "bedroom", vp: [3.9, 7.3, 1.55], vd: [-0.76, 0.6, -0.2], vh: 75.0 },
    RoomView { name: "bathroom", vp: [7.8, 7.05, 1.55], vd: [-0.66, 0.75, -0.16], vh: 78.0 },
    RoomView { name: "study", vp: [10.6, 6.95, 1.55], vd: [-0.5, 0.85, -0.14], vh: 75.0 },
];

/// Radiance of the dusk sky outside the windows.
pub const SKY: [f64; 3] = [0.28, 0.42, 0.72];

/// Returns the configuration of the interior.
pub fn interior() -> String {
    let mut text = format!(
        "# A house of five rooms and a hallway, for `holodeck --config`.\n\
         scene = \"interior.obj\"\nup = [0, 0, 1]\nunit = 1.0\nsky = {SKY:?}\ntwo_sided_lights = false\n"
    );
    for RoomSection { name, origin, size: [w, d, h] } in SECTIONS {
        let _ = writeln!(
            text,
            "\n[[section]]\nname = \"{name}\"\norigin = {origin:?}\naxes = [[{w}, 0, 0], [0, {d}, 0], [0, 0, {h}]]"
        );
    }
    for RoomView { name, vp, vd, vh } in VIEWS {
        let _ = writeln!(
            text,
            "\n[[view]]\nname = \"{name}\"\nvp = {vp:?}\nvd = {vd:?}\nvu = [0, 0, 1]\nvh = {vh:?}"
        );
    }
    text
}
