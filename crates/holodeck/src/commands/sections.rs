//! `holodeck sections`: prints a scene's rooms as options, and draws a plan.

use std::path::PathBuf;

use anyhow::Result;
use holo_picture::Image;
use holodeck::{
    config::SectionTable,
    opening::{OpeningRequest, open},
};

use crate::commands::{arguments::picture_path, scene_args::SceneArgs};

/// Find the rooms of a scene: prints sections as options to paste, and draws a plan
#[derive(clap::Args)]
#[command(after_help = "Example:\n  holodeck sections house.obj -o plan.png")]
pub struct SectionsArgs {
    /// The scene
    #[arg(value_name = "MODEL")]
    scene: Option<PathBuf>,
    /// Draw a plan of each storey: rooms in colours, a dot and a line for each view (.png)
    #[arg(short, value_name = "FILE.png", value_parser = picture_path())]
    output: Option<PathBuf>,
    #[command(flatten)]
    scene_args: SceneArgs,
    /// Report as JSON
    #[arg(long)]
    json: bool,
    /// Print less
    #[arg(short, long)]
    quiet: bool,
}

/// See [`SectionsArgs`].
pub fn run(args: &SectionsArgs) -> Result<()> {
    let config = args.scene_args.resolve(args.scene.as_ref())?;
    let opened = open(&config, OpeningRequest::Sections, args.quiet || args.json)?;
    if args.json {
        let sections: Vec<_> = opened.sections.iter().map(SectionTable::to_option).collect();
        let report = serde_json::json!({
            "up": opened.up, "unit": opened.unit, "sections": sections,
            "exterior": opened.sections.iter().any(|section| section.exterior),
            "views": opened.views, "choices": opened.choices,
        });
        holo_progress::print_line!("{report}");
    } else {
        if !args.quiet {
            opened.say(&config)?;
        }
        for section in &opened.sections {
            let exterior = if section.exterior { " --exterior" } else { "" };
            holo_progress::print_line!("--section \"{}\"{exterior}", section.to_option());
        }
    }
    let Some(path) = &args.output else { return Ok(()) };
    match opened.survey().and_then(holo_survey::Survey::plan) {
        None => eprintln!("no plan is drawn: the scene has no rooms, or its sections are stated"),
        Some(plan) => {
            let (width, height) = (plan.width as u32, plan.height as u32);
            Image { width, height, rgb: plan.rgb, legend: None, exposure: None }.write(path)?;
        }
    }
    Ok(())
}
