//! The all-weather sky of Perez: from measured irradiances to the radiance of each direction.

use glam::DVec3;

use crate::WHITE_EFFICACY;
use crate::formula::{SkyFormula, SkyShape};
use crate::level::lowered;

/// Irradiance of the sun outside of the atmosphere at its mean distance, W·m⁻².
const SOLAR_CONSTANT: f64 = 1367.0;

/// Factor of the cubed zenith angle in the sky's clearness (Perez et al. 1990, equation 1).
const CUBE: f64 = 1.041;

/// Upper bounds of the first seven classes of clearness.
const CLASSES: [f64; 7] = [1.065, 1.23, 1.5, 1.95, 2.8, 4.5, 6.2];

/// Parameters of the shape by classes of clearness (Perez et al. 1993, Table 1). Each of a, b, c, d
/// and e has four.
const SHAPES: [[[f64; 4]; 5]; 8] = [
    [
        [1.3525, -0.2576, -0.2690, -1.4366],
        [-0.7670, 0.0007, 1.2734, -0.1233],
        [2.8000, 0.6004, 1.2375, 1.0000],
        [1.8734, 0.6297, 0.9738, 0.2809],
        [0.0356, -0.1246, -0.5718, 0.9938],
    ],
    [
        [-1.2219, -0.7730, 1.4148, 1.1016],
        [-0.2054, 0.0367, -3.9128, 0.9156],
        [6.9750, 0.1774, 6.4477, -0.1239],
        [-1.5798, -0.5081, -1.7812, 0.1080],
        [0.2624, 0.0672, -0.2190, -0.4285],
    ],
    [
        [-1.1000, -0.2515, 0.8952, 0.0156],
        [0.2782, -0.1812, -4.5000, 1.1766],
        [24.7219, -13.0812, -37.7000, 34.8438],
        [-5.0000, 1.5218, 3.9229, -2.6204],
        [-0.0156, 0.1597, 0.4199, -0.5562],
    ],
    [
        [-0.5484, -0.6654, -0.2672, 0.7117],
        [0.7234, -0.6219, -5.6812, 2.6297],
        [33.3389, -18.3000, -62.2500, 52.0781],
        [-3.5000, 0.0016, 1.1477, 0.1062],
        [0.4659, -0.3296, -0.0876, -0.0329],
    ],
    [
        [-0.6000, -0.3566, -2.5000, 2.3250],
        [0.2937, 0.0496, -5.6812, 1.8415],
        [21.0000, -4.7656, -21.5906, 7.2492],
        [-3.5000, -0.1554, 1.4062, 0.3988],
        [0.0032, 0.0766, -0.0656, -0.1294],
    ],
    [
        [-1.0156, -0.3670, 1.0078, 1.4051],
        [0.2875, -0.5328, -3.8500, 3.3750],
        [14.0000, -0.9999, -7.1406, 7.5469],
        [-3.4000, -0.1078, -1.0750, 1.5702],
        [-0.0672, 0.4016, 0.3017, -0.4844],
    ],
    [
        [-1.0000, 0.0211, 0.5025, -0.5119],
        [-0.3000, 0.1922, 0.7023, -1.6317],
        [19.0000, -5.0000, 1.2438, -1.9094],
        [-4.0000, 0.0250, 0.3844, 0.2656],
        [1.0468, -0.3788, -2.4517, 1.4656],
    ],
    [
        [-1.0500, 0.0289, 0.4260, 0.3590],
        [-0.3250, 0.1156, 0.7781, 0.0025],
        [31.0625, -14.5000, -46.1148, 55.3750],
        [-7.2312, 0.4050, 13.3500, 0.6234],
        [1.5000, -0.6426, 1.8564, 0.5636],
    ],
];

/// Luminous efficacy of diffuse light by classes of clearness (Perez et al. 1990, Table 4).
const DIFFUSE_EFFICACY: [[f64; 4]; 8] = [
    [97.24, -0.46, 12.00, -8.91],
    [107.22, 1.15, 0.59, -3.95],
    [104.97, 2.96, -5.53, -8.77],
    [102.39, 5.59, -13.95, -13.90],
    [100.71, 5.94, -22.75, -23.74],
    [106.42, 3.83, -36.15, -28.83],
    [141.88, 1.90, -53.24, -14.03],
    [152.23, 0.35, -45.27, -7.98],
];

/// Luminous efficacy of the sun by classes of clearness (Perez et al. 1990, Table 4).
const DIRECT_EFFICACY: [[f64; 4]; 8] = [
    [57.20, -4.55, -2.98, 117.12],
    [98.99, -3.46, -1.21, 12.38],
    [109.83, -4.90, -1.71, -8.81],
    [110.34, -5.84, -1.99, -4.56],
    [106.36, -3.97, -1.75, -6.16],
    [107.19, -1.25, -1.51, -26.73],
    [105.75, 0.77, -1.26, -34.44],
    [101.18, 1.58, -1.10, -8.29],
];

/// What a weather station measures.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerezWeather {
    /// Irradiance by the sun on a surface that faces it, W·m⁻².
    pub direct: f64,
    /// Irradiance by the sky on a horizontal surface, W·m⁻².
    pub diffuse: f64,
    /// Water in the air above a place, centimetres; 2 if unknown.
    pub water: f64,
    /// Day of the year, from 1. It determines the distance of the sun.
    pub day_of_year: u32,
}

/// A sky of Perez, with its sun and the figures that it follows from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PerezSky {
    /// The sky.
    pub sky: SkyFormula,
    /// Irradiance by the sun on a surface that faces it, watts of white light per m².
    pub sun: f64,
    /// Illuminance of a horizontal surface by the sky, lx.
    pub diffuse_illuminance: f64,
    /// Illuminance by the sun of a surface that faces it, lx.
    pub direct_illuminance: f64,
    /// Clearness of the sky, from 1.
    pub clearness: f64,
    /// Brightness of the sky.
    pub brightness: f64,
    /// True if the sun was taken lower than it stands, because the formulas end at 87°.
    pub is_lowered: bool,
}

/// Returns the sky of Perez for the sun's direction and measured irradiances.
pub fn perez_sky(sun: DVec3, weather: &PerezWeather) -> PerezSky {
    let (shaping, is_lowered) = lowered(sun);
    let zenith = shaping.z.clamp(0.0, 1.0).acos();
    let (direct, diffuse) = (weather.direct.max(0.0), weather.diffuse.max(0.0));
    let clearness = clearness(direct, diffuse, zenith);
    let brightness = (diffuse * air_mass(zenith)
        / (SOLAR_CONSTANT * eccentricity(weather.day_of_year)))
    .clamp(0.01, 0.6);
    let class = CLASSES.iter().filter(|&&bound| clearness >= bound).count();
    let [a, b, c, d] = DIFFUSE_EFFICACY[class];
    let of_diffuse = a + b * weather.water + c * zenith.cos() + d * brightness.ln();
    let [a, b, c, d] = DIRECT_EFFICACY[class];
    let of_direct = a + b * weather.water + c * (5.73 * zenith - 5.0).exp() + d * brightness;
    let diffuse_illuminance = diffuse * of_diffuse.max(0.0);
    let direct_illuminance = if sun.z > 0.0 { direct * of_direct.max(0.0) } else { 0.0 };
    let [a, b, c, d, e] = shape(class, zenith, clearness, brightness);
    let shape = SkyShape::Gradation { factors: [a, b, 1.0, c, d, e] };
    let sky = SkyFormula::with_horizontal(shape, shaping, diffuse_illuminance / WHITE_EFFICACY);
    PerezSky {
        sky,
        sun: direct_illuminance / WHITE_EFFICACY,
        diffuse_illuminance,
        direct_illuminance,
        clearness,
        brightness,
        is_lowered,
    }
}

fn clearness(direct: f64, diffuse: f64, zenith: f64) -> f64 {
    let cube = CUBE * zenith.powi(3);
    let ratio = if diffuse > 0.0 { (diffuse + direct) / diffuse } else { 1.0 };
    ((ratio + cube) / (1.0 + cube)).clamp(1.0, 11.9)
}

/// Returns the relative optical air mass (Kasten 1966).
fn air_mass(zenith: f64) -> f64 {
    1.0 / (zenith.cos() + 0.15 * (93.885 - zenith.to_degrees()).powf(-1.253))
}

/// Returns the squared ratio of the sun's mean distance to its distance on a day of the year.
fn eccentricity(day_of_year: u32) -> f64 {
    let angle = (f64::from(day_of_year) - 1.0) * std::f64::consts::TAU / 365.0;
    let twice = 2.0 * angle;
    1.00011
        + 0.034221 * angle.cos()
        + 0.00128 * angle.sin()
        + 0.000719 * twice.cos()
        + 0.000077 * twice.sin()
}

/// Returns the parameters a, b, c, d and e (Perez et al. 1993, equations 6 to 8).
fn shape(class: usize, zenith: f64, clearness: f64, brightness: f64) -> [f64; 5] {
    let is_between = clearness > 1.065 && clearness < 2.8;
    let brightness = if is_between { brightness.max(0.2) } else { brightness };
    let table = &SHAPES[class];
    let mut shape = table.map(|[p, q, r, s]| p + q * zenith + brightness * (r + s * zenith));
    if class == 0 {
        let [p, q, r, s] = table[2];
        shape[2] = (brightness * (p + q * zenith)).powf(r).exp() - s;
        let [p, q, r, s] = table[3];
        shape[3] = -(brightness * (p + q * zenith)).exp() + r + brightness * s;
    }
    // A positive b makes the horizon up to 1e13 times as bright as the rest, or black. The tables
    // give one for clear and bright skies around a sun below 11°, as at sunrise.
    shape[1] = shape[1].min(0.0);
    shape
}
