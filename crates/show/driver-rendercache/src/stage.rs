//! The stages of a frame, and which of them run.

use holo_display::DriverPart;

/// The stages of a frame, in their order (Walter et al. 2002, Figure 1 and Table 1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Stage {
    /// Makes all points older, removes the oldest, and adds new samples.
    UpdatePoints,
    /// Finds the parts of the predicted view that have points, at a quarter of the resolution
    /// (§3.1).
    PredictedProjection,
    /// Requests rays for the empty parts of the predicted view (§3.1).
    PredictedSampling,
    /// Projects points to pixels, into buckets by tile (§3.2).
    ProjectAndTileSort,
    /// Determines the nearest point of each pixel, tile by tile (§3.2).
    ZBufferTiles,
    /// Removes points that show through nearer surfaces (1999, §3.1).
    DepthCull,
    /// Averages over wider and wider windows, for the prefilter where points are few.
    Pyramid,
    /// Averages over 7×7 pixels (§3.3).
    Prefilter,
    /// Averages over 3×3 pixels weighted 4-2-1, and sets each pixel's priority (1999, §3.1 and §4).
    Interpolate,
    /// Chooses pixels to request by an error-diffusion dither of the priorities (1999, §4).
    Sampling,
}

impl Stage {
    /// All stages, in their order.
    pub const ALL: [Self; 10] = [
        Self::UpdatePoints,
        Self::PredictedProjection,
        Self::PredictedSampling,
        Self::ProjectAndTileSort,
        Self::ZBufferTiles,
        Self::DepthCull,
        Self::Pyramid,
        Self::Prefilter,
        Self::Interpolate,
        Self::Sampling,
    ];

    /// Returns the stage's name, as in the paper's table.
    pub fn name(self) -> &'static str {
        match self {
            Self::UpdatePoints => "Update Points",
            Self::PredictedProjection => "Predicted Projection",
            Self::PredictedSampling => "Predicted Sampling",
            Self::ProjectAndTileSort => "Project and Tile Sort",
            Self::ZBufferTiles => "Z-Buffer Tiles",
            Self::DepthCull => "Depth Cull",
            Self::Pyramid => "Pyramid",
            Self::Prefilter => "Prefilter",
            Self::Interpolate => "Interpolate / Smooth",
            Self::Sampling => "Sampling",
        }
    }
}

/// The parts of the method that run. They may change between any two frames. Projection and
/// z-buffer always run, because they make the picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stages {
    /// Points grow older in each frame. If off, only changes of colour make them older.
    pub ageing: bool,
    /// Points of the eviction age are removed (2002, §3.4). If off, they stay until they are
    /// overwritten.
    pub eviction: bool,
    /// Predicted projection and sampling (2002, §3.1).
    pub prediction: bool,
    /// The depth cull.
    pub depth_cull: bool,
    /// The 7×7 filter (2002, §3.3).
    pub prefilter: bool,
    /// The pyramid below the 7×7 filter. It runs only with that filter.
    pub pyramid: bool,
    /// The 3×3 filter. If off, each pixel shows its point alone.
    pub interpolation: bool,
    /// Requests go to pixels of high priority. If off, every pixel has an equal chance.
    pub dither: bool,
    /// Requested rays go through the old point, which stays if its colour has not changed (1999,
    /// §4.1). If off, they go anywhere in the pixel, and each makes a new point.
    pub resampling: bool,
}

impl Stages {
    /// All parts.
    pub const ALL: Self = Self {
        ageing: true,
        eviction: true,
        prediction: true,
        depth_cull: true,
        prefilter: true,
        pyramid: true,
        interpolation: true,
        dither: true,
        resampling: true,
    };

    /// The parts of both papers: no pyramid.
    pub const OF_2002: Self = Self { pyramid: false, ..Self::ALL };

    /// The parts of the first paper (1999): no eviction, prediction or prefilter.
    pub const OF_1999: Self =
        Self { eviction: false, prediction: false, prefilter: false, ..Self::OF_2002 };

    /// The names of the parts, as [`switch`](Self::switch) takes them.
    pub const NAMES: [&str; 9] = [
        "ageing",
        "eviction",
        "prediction",
        "depth-cull",
        "prefilter",
        "pyramid",
        "interpolation",
        "dither",
        "resampling",
    ];

    /// What each part does, in the order of [`NAMES`](Self::NAMES), in a few words.
    const MEANINGS: [&str; 9] = [
        "old points give way",
        "the oldest points go",
        "rays for where you go",
        "near points hide far",
        "fills wide gaps, 7×7",
        "fills gaps of any width",
        "fills and smooths, 3×3",
        "worst pixels ask first",
        "rays test known points",
    ];

    /// Switches a part on or off by its name in [`NAMES`](Self::NAMES). Returns whether the name is
    /// known.
    pub fn switch(&mut self, name: &str, on: bool) -> bool {
        let part = self.part(name);
        let is_known = part.is_some();
        part.into_iter().for_each(|part| *part = on);
        is_known
    }

    /// Returns all parts, with what they do and whether they run.
    pub fn parts(mut self) -> Vec<DriverPart> {
        let parts = Self::NAMES.into_iter().zip(Self::MEANINGS);
        let part = |(name, meaning)| {
            let is_on = self.part(name).is_some_and(|is_on| *is_on);
            DriverPart { name, meaning, is_on }
        };
        parts.map(part).collect()
    }

    fn part(&mut self, name: &str) -> Option<&mut bool> {
        Some(match name {
            "ageing" => &mut self.ageing,
            "eviction" => &mut self.eviction,
            "prediction" => &mut self.prediction,
            "depth-cull" => &mut self.depth_cull,
            "prefilter" => &mut self.prefilter,
            "pyramid" => &mut self.pyramid,
            "interpolation" => &mut self.interpolation,
            "dither" => &mut self.dither,
            "resampling" => &mut self.resampling,
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_switches_a_part_of_its_own() {
        let mut stages = Stages::ALL;
        for name in Stages::NAMES {
            let before = stages;
            assert!(stages.switch(name, false), "{name}");
            assert_ne!(stages, before, "{name}");
        }
        assert!(!stages.switch("projection", false));
        assert!(stages.switch("dither", true));
        let on: Vec<_> = stages.parts().into_iter().filter(|part| part.is_on).collect();
        assert_eq!(
            on,
            [DriverPart { name: "dither", meaning: "worst pixels ask first", is_on: true }]
        );
    }
}
