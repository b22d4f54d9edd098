//! Photometric files of lamps whose intensity is a formula.

use glam::DVec3;

/// A lamp by a formula: intensity in candela by direction.
pub type Lamp = fn(DVec3) -> f64;

/// Formulas by their symmetry.
pub const NO_SYMMETRY: Lamp = |d| 100.0 + 40.0 * d.x + 25.0 * d.y - 30.0 * d.z + 15.0 * d.x * d.y;
pub const SAME_ACROSS_Y: Lamp = |d| 100.0 + 40.0 * d.x - 30.0 * d.z + 20.0 * d.y * d.y;
pub const SAME_ACROSS_X: Lamp = |d| 100.0 + 25.0 * d.y - 30.0 * d.z + 20.0 * d.x * d.x;
pub const SAME_ACROSS_BOTH: Lamp = |d| 100.0 - 30.0 * d.z + 20.0 * d.x * d.x - 35.0 * d.y * d.y;
pub const ROUND: Lamp = |d| 100.0 - 30.0 * d.z + 20.0 * d.z * d.z;

/// Integral of a lamp over the sphere. Terms that are odd in a coordinate vanish, and x² has a
/// third of 4π.
pub fn flux(lamp: Lamp) -> f64 {
    let sum: f64 = [DVec3::X, DVec3::Y, DVec3::Z].map(|axis| lamp(axis) + lamp(-axis)).iter().sum();
    // Exact for polynomials of degree 3.
    4.0 * std::f64::consts::PI * sum / 6.0
}

/// Returns a direction of type C.
pub fn direction_c(vertical: f64, horizontal: f64) -> DVec3 {
    let (sin, cos) = vertical.to_radians().sin_cos();
    let (y, x) = horizontal.to_radians().sin_cos();
    DVec3::new(sin * x, sin * y, -cos)
}

/// Returns a direction of type B: longitude about -y, from the nadir to x, and latitude to -y.
pub fn direction_b(vertical: f64, horizontal: f64) -> DVec3 {
    let (along, across) = vertical.to_radians().sin_cos();
    let (sin, cos) = horizontal.to_radians().sin_cos();
    DVec3::new(cos * along, -sin, -cos * across)
}

/// Returns a direction of type A: longitude about x, from the nadir to -y, and latitude to x.
pub fn direction_a(vertical: f64, horizontal: f64) -> DVec3 {
    let (sin, cos) = vertical.to_radians().sin_cos();
    let (right, ahead) = horizontal.to_radians().sin_cos();
    DVec3::new(sin, -cos * right, -cos * ahead)
}

/// Returns angles from `first` to `last`.
pub fn angles(first: f64, last: f64, step: f64) -> Vec<f64> {
    let count = ((last - first) / step).round() as usize;
    (0..=count).map(|at| first + step * at as f64).collect()
}

fn line(numbers: impl IntoIterator<Item = f64>) -> String {
    let words: Vec<String> = numbers.into_iter().map(|number| format!("{number:.5}")).collect();
    // Lines of these files are short.
    words.chunks(10).map(|ten| ten.join(" ") + "\n").collect()
}

/// What an IES file states besides its angles.
pub struct Ies<'a> {
    pub header: &'a str,
    /// From `TILT=` on.
    pub tilt: &'a str,
    /// 1 for C, 2 for B, 3 for A.
    pub kind: u32,
    /// Width, length and height, metres.
    pub opening: [f64; 3],
    /// Factor of the candela values; the values are divided by it.
    pub multiplier: f64,
    /// Factors of ballast and lamp; the values are divided by them.
    pub ballast: [f64; 2],
}

impl Default for Ies<'_> {
    fn default() -> Self {
        Ies {
            header: "IESNA:LM-63-2002\n[LUMINAIRE] a lamp\n",
            tilt: "TILT=NONE\n",
            kind: 1,
            opening: [0.0; 3],
            multiplier: 1.0,
            ballast: [1.0; 2],
        }
    }
}

impl Ies<'_> {
    /// Writes a lamp with these vertical and horizontal angles.
    pub fn write(&self, lamp: Lamp, vertical: &[f64], horizontal: &[f64]) -> String {
        let direction = match self.kind {
            1 => direction_c,
            2 => direction_b,
            _ => direction_a,
        };
        let Ies { header, tilt, kind, opening: [w, l, h], multiplier, ballast: [a, b] } = self;
        let (rows, columns) = (vertical.len(), horizontal.len());
        let mut text = format!(
            "{header}{tilt}1 -1 {multiplier} {rows} {columns} {kind} 2 {w} {l} {h}\n{a} {b} 20\n"
        );
        text += &line(vertical.iter().copied());
        text += &line(horizontal.iter().copied());
        for h in horizontal {
            let value = |v: &f64| lamp(direction(*v, *h)) / (multiplier * a * b);
            text += &line(vertical.iter().map(value));
        }
        text
    }
}

/// Writes an EULUMDAT file. `stored` are the angles of the planes whose intensities it has.
pub fn eulumdat(lamp: Lamp, symmetry: u32, planes: usize, step: f64, stored: &[f64]) -> String {
    let gamma = angles(0.0, 180.0, step);
    let lumens = 4000.0;
    let mut lines: Vec<String> = vec![
        "maker".into(),
        "1".into(),
        symmetry.to_string(),
        planes.to_string(),
        format!("{}", 360.0 / planes as f64),
        gamma.len().to_string(),
        step.to_string(),
        "report".into(),
        "a lamp".into(),
        "1".into(),
        "a.ldt".into(),
        "today".into(),
    ];
    // Sizes of the luminaire and of its luminous area, millimetres.
    lines.extend(["1300", "200", "80", "1200", "150", "0", "0", "0", "0"].map(String::from));
    lines.extend(["50", "100", "1", "0", "1", "1", "lamp"].map(String::from));
    lines.extend([lumens.to_string(), "3000".into(), "80".into(), "40".into()]);
    lines.extend(std::iter::repeat_n("0.5".to_owned(), 10));
    lines.extend((0..planes).map(|at| format!("{}", 360.0 * at as f64 / planes as f64)));
    lines.extend(gamma.iter().map(f64::to_string));
    for c in stored {
        lines.extend(gamma.iter().map(|g| {
            let value = lamp(direction_c(*g, *c)) * 1000.0 / lumens;
            // Some programs write commas.
            format!("{value:.5}").replace('.', ",")
        }));
    }
    lines.join("\r\n") + "\r\n"
}
