//! Options that choose a driver.

use clap::{Args, ValueEnum};

/// What turns samples into a picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum DriverArg {
    /// The same as `voronoi`, but that a scene which cannot be read is done without
    #[default]
    Auto,
    /// Edges from the scene itself, light from all samples on what is seen; where there is no scene, cells of the samples (`--cells`)
    Voronoi,
    /// Light kept on the scene's surfaces for the whole session, smoothed: shows most of a new view
    /// at once, but blurs what is small. An experiment
    Surfaces,
    /// Means over the leaves of a quadtree, as large as noise asks; needs no scene
    Quadtree,
    /// The render cache: what is known is projected into every view, gaps are filled; needs no scene
    Pointimage,
    /// Each pixel shows its newest rays; needs no scene
    Frameless,
}

/// Which driver, and what it is told.
#[derive(Args, Clone, Copy, Debug, Default)]
pub struct DriverArgs {
    /// What turns samples into a picture
    #[arg(long, value_enum, default_value_t)]
    pub driver: DriverArg,
    /// Of the driver `voronoi`: cells of samples alone, even where there is a scene, such as `--driver voronoi --cells constant`
    #[arg(long, value_enum, value_name = "FILLING")]
    pub cells: Option<CellsArg>,
    /// Whether `auto` draws light that is kept on surfaces: whoever walks sees at once what was
    /// seen before, from elsewhere.
    #[arg(skip)]
    pub walks: bool,
}

impl DriverArgs {
    /// Refuses what would do nothing.
    ///
    /// # Errors
    /// A text for people, if cells are wanted of a driver that has none.
    pub fn check(&self) -> Result<(), String> {
        match (self.driver, self.cells) {
            (DriverArg::Auto | DriverArg::Voronoi, _) | (_, None) => Ok(()),
            (driver, Some(_)) => {
                let name = driver
                    .to_possible_value()
                    .map_or_else(String::new, |value| value.get_name().to_owned());
                Err(format!("--cells is for --driver voronoi; {name} has no cells"))
            }
        }
    }
}

/// What cells show: see [`holo_driver_quadtree::Filling`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum CellsArg {
    /// Colours that go from sample to sample of a surface; means where a pixel has many [what is used where there is no scene]
    Smooth,
    /// Each the colour of its sample, as in the paper (Larson & Simmons 1999)
    Constant,
}
