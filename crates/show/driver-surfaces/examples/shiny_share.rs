//! Prints how much of a picture is shiny: the shares of pixels whose first surface is a curved
//! mirror or smooth metal, rough metal, or solid glass.
//!
//! `shiny_share SCENE VIEW …`, each view as Radiance options in one argument, for 640 × 480 pixels.
//! `holodeck info FILE.holo --json` shows the views of a holodeck so.

use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

use holo_picture::View;
use holo_raycast::Raycaster;
use holo_scene::{Bsdf, LoadOptions, ShinyObjects, load};

const SIZE: (u32, u32) = (640, 480);

/// Roughness up to which metal is smooth.
const SMOOTH: f32 = 0.01;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [path, views @ ..] = &arguments[..] else { return Err("needs SCENE VIEW …".into()) };
    let scene = Arc::new(load(Path::new(path), &LoadOptions::default())?.scene);
    let objects = ShinyObjects::find(&scene);
    println!("{} shiny objects", objects.as_ref().map_or(0, |objects| objects.centres().len()));
    let raycaster = Raycaster::build(Arc::clone(&scene))?;
    for options in views {
        let (view, size) = View::parse_vf(options)?.resolve(SIZE)?;
        let (mut counts, mut seen) = ([0_u32; 3], HashSet::new());
        for pixel in 0..size.0 * size.1 {
            let (x, y) = View::pixel_centre(size, pixel % size.0, pixel / size.0);
            let (origin, direction) = view.ray(x, y);
            let hit = raycaster.localize(origin, direction).and_then(|(ray, _)| {
                let hit = raycaster.nearest(&ray)?;
                Some((objects.as_ref()?.of(hit.triangle)?, hit.triangle))
            });
            let Some((object, triangle)) = hit else { continue };
            seen.insert(object);
            match scene.material(triangle).bsdf {
                Bsdf::Conductor { alpha, .. } if alpha > SMOOTH => counts[1] += 1,
                Bsdf::Mirror { .. } | Bsdf::Conductor { .. } => counts[0] += 1,
                _ => counts[2] += 1,
            }
        }
        let [mirror, rough, glass] =
            counts.map(|count| 100.0 * f64::from(count) / f64::from(size.0 * size.1));
        println!(
            "mirror {mirror:.1} %, rough metal {rough:.1} %, glass {glass:.1} %, {} objects: \
             {options}",
            seen.len()
        );
    }
    Ok(())
}
