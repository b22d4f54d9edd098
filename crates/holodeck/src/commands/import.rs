//! `holodeck import`: makes a holodeck of captured pictures with depths.

use std::path::PathBuf;

use anyhow::Result;
use holo_progress::{HumanCount, Meter};
use holodeck::{
    config::{SectionTable, Unit, Up},
    import::{
        DepthAlong, ImportList, ImportReport, ImportedPanorama, PanoramaSource, Projection, import,
    },
    settings::Usage,
};

use crate::commands::scene_args::{parse_numbers, parse_section};

/// Make a holodeck of panoramas with depths: each pixel becomes a stored ray
///
/// The pictures may come from a camera or from another renderer. Colours are .exr or .hdr, and
/// depths .exr, .pfm or .hdr of the same size. The new file has no scene, and nothing can be traced
/// for it: `holodeck replay` shows it, with the drivers that need no scene.
#[derive(clap::Args)]
#[command(after_help = "Examples:
  holodeck import hall.exr --depth hall-depth.exr --vp 2,3,1.6 --vd 0,1,0 -o hall.holo
  holodeck import house.toml -o house.holo
  holodeck replay house.holo")]
pub struct ImportArgs {
    /// A picture, or a list of several, which the manual describes. A name with `{face}` stands for
    /// the six faces of a cube: right, left, up, down, front, back
    #[arg(value_name = "PICTURE|LIST.toml")]
    from: PathBuf,
    /// The picture of depths, in scene units; infinite where it shows the sky
    #[arg(long, value_name = "FILE")]
    depth: Option<PathBuf>,
    /// Where the picture was taken [default: the eye of the view that it states]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_numbers, allow_hyphen_values = true)]
    vp: Option<[f64; 3]>,
    /// Direction of the picture's middle [default: by the view that it states]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_numbers, allow_hyphen_values = true)]
    vd: Option<[f64; 3]>,
    /// Up in the picture [default: the up axis]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_numbers, allow_hyphen_values = true)]
    vu: Option<[f64; 3]>,
    /// How pictures show directions [default: view if the picture states one, else by its shape]
    #[arg(long, value_name = "PROJECTION")]
    projection: Option<Projection>,
    /// What depths are measured along [default: ray]
    #[arg(long, value_name = "ALONG")]
    depth_along: Option<DepthAlong>,
    /// Scene units in a unit of depth, such as 0.001 for depths in millimetres [default: 1]
    #[arg(long, value_name = "FACTOR")]
    depth_scale: Option<f64>,
    /// Depth from which on a pixel shows the sky, in units of depth. Some programs write 1e10
    /// [default: infinity]
    #[arg(long, value_name = "DEPTH")]
    sky_beyond: Option<f64>,
    /// A section of the file: origin, three axes and, if wanted, the grid. May be repeated
    /// [default: around the eyes and what they saw near them]
    #[arg(
        long,
        value_name = "\"OX,OY,OZ AX,AY,AZ BX,BY,BZ CX,CY,CZ [NX,NY,NZ]\"",
        value_parser = parse_section,
        allow_hyphen_values = true
    )]
    section: Vec<SectionTable>,
    /// Make sections to look into from outside, not to look out of
    #[arg(long)]
    exterior: bool,
    /// Up axis [default: z]
    #[arg(long, value_name = "x|y|z|X,Y,Z", allow_hyphen_values = true)]
    up: Option<Up>,
    /// Unit of positions [default: m]
    #[arg(long, value_name = "mm|cm|m|in|ft|METRES")]
    unit: Option<Unit>,
    /// The new file
    #[arg(short, long, value_name = "NEW.holo")]
    output: PathBuf,
    /// Report as JSON
    #[arg(long)]
    json: bool,
    /// Print less
    #[arg(short, long)]
    quiet: bool,
}

impl ImportArgs {
    /// Returns the list of pictures. Options override what it says.
    fn list(&self) -> Result<ImportList> {
        let is_list = self.from.extension().is_some_and(|end| end == "toml");
        let mut list = match is_list {
            true => self.stated_list()?,
            false => ImportList { panorama: vec![self.only_picture()?], ..ImportList::default() },
        };
        list.projection = self.projection.or(list.projection);
        list.depth_along = self.depth_along.or(list.depth_along);
        list.depth_scale = self.depth_scale.or(list.depth_scale);
        list.sky_beyond = self.sky_beyond.or(list.sky_beyond);
        (list.up, list.unit) = (self.up.or(list.up), self.unit.or(list.unit));
        if !self.section.is_empty() {
            list.section.clone_from(&self.section);
        }
        list.section.iter_mut().for_each(|section| section.exterior |= self.exterior);
        if self.exterior && list.section.is_empty() {
            return Err(Usage("--exterior needs --section".to_owned()).into());
        }
        Ok(list)
    }

    /// Reads the list that was named.
    fn stated_list(&self) -> Result<ImportList> {
        let is_one = [self.vp, self.vd, self.vu].iter().any(Option::is_some);
        if is_one || self.depth.is_some() {
            let words =
                "--depth, --vp, --vd and --vu are for one picture: write them into the list";
            return Err(Usage(words.to_owned()).into());
        }
        ImportList::read(&self.from)
    }

    fn only_picture(&self) -> Result<PanoramaSource> {
        let Some(depth) = self.depth.clone() else {
            return Err(Usage("say where the picture's depths are: --depth FILE".to_owned()).into());
        };
        let (colour, vp, vd, vu) = (self.from.clone(), self.vp, self.vd, self.vu);
        Ok(PanoramaSource { colour, depth, vp, vd, vu, projection: None })
    }
}

/// See [`ImportArgs`].
pub fn run(args: &ImportArgs) -> Result<()> {
    let list = args.list()?;
    let mut meter = Meter::new(args.quiet || args.json);
    let report = import(&list, &args.output, &mut |share| meter.show(share, "reading pictures"))?;
    meter.finish();
    if args.json {
        holo_progress::print_line!("{}", serde_json::to_string(&report)?);
    } else if !args.quiet {
        print(&report);
    }
    Ok(())
}

fn print(report: &ImportReport) {
    for ImportedPanorama { picture, pixels, rays } in &report.panoramas {
        let mut words = vec![format!("{} rays stored", HumanCount(rays.kept))];
        for (count, what) in [
            (pixels.sky, "of them show the sky"),
            (pixels.without_depth, "pixels without a depth left out"),
            (pixels.without_colour, "pixels without a colour left out"),
            (rays.outside, "rays cross no section"),
        ] {
            if count > 0 {
                words.push(format!("{} {what}", HumanCount(count)));
            }
        }
        holo_progress::print_line!("{}: {}", picture.display(), words.join(", "));
    }
    let (file, samples) = (report.file.display(), HumanCount(report.samples));
    holo_progress::print_line!("{file}: {samples} samples; show it with `holodeck replay {file}`");
}
