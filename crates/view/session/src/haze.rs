//! Haze that is equally dense everywhere, added to frames along each pixel's ray. Stored rays keep
//! their radiance without it.
//!
//! A pixel that shows radiance L at distance d shows L·exp(-d/D) + H·(1 - exp(-d/D)) in haze of
//! radiance H. D is the distance after which 37 % of the light is left. Without haze, nothing is
//! computed.
//!
//! What is left out: light that lamps scatter into the haze, the shadows in it, and the way of
//! light before it reaches a surface. In a mirror, the way counts to the mirror alone.

use std::str::FromStr;

use holo_display::Frame;

/// Haze as people state it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HazeOption {
    /// Distance after which 37 % of the light is left, metres.
    metres: f64,
    /// Its radiance, W·sr⁻¹·m⁻². `None`: the mean of the sky.
    radiance: Option<[f32; 3]>,
}

impl FromStr for HazeOption {
    type Err = String;

    fn from_str(text: &str) -> Result<HazeOption, String> {
        let wrong = || format!("`{text}` is no haze: write METRES or METRES,R,G,B");
        let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
        let numbers = numbers.ok_or_else(wrong)?;
        let (metres, radiance) = match numbers[..] {
            [metres] => (metres, None),
            [metres, red, green, blue] => (metres, Some([red, green, blue].map(|c| c as f32))),
            _ => return Err(wrong()),
        };
        if !(metres > 0.0 && metres.is_finite()) {
            return Err(format!("the distance of haze is above 0 metres, not {metres}"));
        }
        if radiance.iter().flatten().any(|channel| !(*channel >= 0.0 && channel.is_finite())) {
            return Err("the radiance of haze is not negative, and finite".to_owned());
        }
        Ok(HazeOption { metres, radiance })
    }
}

impl HazeOption {
    /// Returns the haze in a scene whose unit is `unit` metres, under a sky of this mean radiance.
    pub(crate) fn in_scene(&self, unit: f64, sky: [f32; 3]) -> Haze {
        Haze { distance: self.metres / unit, radiance: self.radiance.unwrap_or(sky) }
    }
}

/// Haze in a scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Haze {
    /// Distance after which 37 % of the light is left, scene units.
    distance: f64,
    /// Its radiance, W·sr⁻¹·m⁻².
    radiance: [f32; 3],
}

impl Haze {
    /// Adds the haze to a frame. A lit pixel of unknown distance, in a gap that a driver fills, is
    /// taken to be as far as the known pixel before it in its row. Pixels of which nothing is known
    /// stay as they are.
    pub fn veil(&self, frame: &mut Frame) {
        let per_unit = (-1.0 / self.distance) as f32;
        let left = |depth: f32| (depth * per_unit).exp();
        let width = frame.picture.width.max(1) as usize;
        let rows = frame.picture.pixels.chunks_mut(width).zip(frame.depth.chunks(width));
        for (pixels, depths) in rows {
            let mut nearby = depths.iter().copied().find(|depth| *depth > 0.0).unwrap_or(0.0);
            for (pixel, &depth) in pixels.iter_mut().zip(depths) {
                if depth > 0.0 {
                    nearby = depth;
                } else if *pixel == [0.0; 3] {
                    continue;
                }
                let left = left(nearby);
                for (channel, haze) in pixel.iter_mut().zip(self.radiance) {
                    *channel = *channel * left + haze * (1.0 - left);
                }
            }
        }
        for (certainty, &depth) in frame.certainty.iter_mut().zip(&frame.depth) {
            // What is not known is not known behind haze either.
            if depth > 0.0 && certainty.error.is_finite() {
                certainty.error *= left(depth);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use holo_display::Certainty;

    use super::*;

    #[test]
    fn haze_is_stated_by_its_distance_and_its_radiance() {
        let haze = |text: &str| text.parse::<HazeOption>();
        let sky = [0.5; 3];
        let stated = haze("20,0.1,0.2,0.3").unwrap().in_scene(0.1, sky);
        assert_eq!(stated, Haze { distance: 200.0, radiance: [0.1, 0.2, 0.3] });
        assert_eq!(
            haze(" 7.5 ").unwrap().in_scene(1.0, sky),
            Haze { distance: 7.5, radiance: sky }
        );
        for wrong in
            ["", "far", "0", "-3", "inf", "nan", "5,1,1", "5,1,1,-1", "5,1,1,inf", "5,,1,1"]
        {
            assert!(haze(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_filled_gap_is_as_hazy_as_the_pixel_before_it() {
        let mut frame = Frame::black((3, 2));
        frame.depth = vec![0.0, 3.0, 0.0, 0.0, 0.0, 6.0];
        frame.picture.pixels.fill([1.0; 3]);
        Haze { distance: 3.0, radiance: [0.0; 3] }.veil(&mut frame);
        let left: Vec<f32> = frame.picture.pixels.iter().map(|pixel| pixel[0]).collect();
        let [one, two] = [(-1.0_f32).exp(), (-2.0_f32).exp()];
        let expected = [one, one, one, two, two, two];
        assert!(left.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{left:?}");
    }

    #[test]
    fn a_frame_in_haze_agrees_with_the_closed_form_and_the_sky_is_all_haze() {
        let depths = [0.0, 0.25, 3.0, 40.0, f32::INFINITY];
        let mut frame = Frame::black((5, 1));

        frame.depth = depths.to_vec();
        frame.picture.pixels.fill([2.0, 1.0, 0.0]);
        frame.picture.pixels[0] = [0.0; 3];
        frame.certainty = vec![Certainty { error: 0.5, samples: 9 }; 5];
        frame.certainty[1].error = f32::INFINITY;
        let haze = Haze { distance: 6.0, radiance: [0.25, 0.5, 1.0] };
        haze.veil(&mut frame);
        assert_eq!(frame.picture.pixels[0], [0.0; 3], "nothing is known there");
        for (at, depth) in depths.into_iter().enumerate().skip(1) {
            let left = (-f64::from(depth) / 6.0).exp();
            for channel in 0..3 {
                let light = f64::from([2.0_f32, 1.0, 0.0][channel]);
                let expected = light * left + f64::from(haze.radiance[channel]) * (1.0 - left);
                let shown = f64::from(frame.picture.pixels[at][channel]);
                assert!((shown - expected).abs() < 1e-6, "{at} {channel}: {shown} {expected}");
            }
        }
        assert_eq!(frame.picture.pixels[4], haze.radiance, "the sky");
        let errors: Vec<f32> = frame.certainty.iter().map(|certainty| certainty.error).collect();
        assert_eq!((errors[0], errors[1], errors[4]), (0.5, f32::INFINITY, 0.0));
        assert!((errors[2] - 0.5 * (-0.5_f32).exp()).abs() < 1e-6);
    }
}
