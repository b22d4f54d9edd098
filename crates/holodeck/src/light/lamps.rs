//! Lamps that are dimmed or switched off by their names.

use std::collections::HashSet;

use anyhow::{Result, bail};
use holo_scene::{SKY, SUN, Scene};

use super::{SkyChoice, StatedLight};

impl StatedLight {
    /// Multiplies the lamps of a scene by their factors, after it has its sky. Returns what was
    /// done, for people.
    ///
    /// # Errors
    /// If there is no such lamp.
    pub fn dim_lamps(&self, scene: &mut Scene) -> Result<Vec<String>> {
        let mut said = Vec::new();
        let is_made = !matches!(self.kind(), None | Some(SkyChoice::Radiance(_)));
        for (name, factor) in &self.lamps {
            let count = dim(scene, name, *factor, is_made);
            if count == 0 {
                bail!("--lamp {name}={factor}: there is no such lamp; there are {}", groups(scene));
            }
            said.push(format!("light: {name} times {factor} (--lamp)"));
        }
        Ok(said)
    }
}

/// Multiplies the lamps of a group by a factor, and returns their number. The sky and its sun are
/// left as they are if they were `made` with it.
fn dim(scene: &mut Scene, name: &str, factor: f32, is_made: bool) -> usize {
    let scale = |radiance: [f32; 3]| radiance.map(|channel| channel * factor);
    let of_group = scene.luminaires().iter().filter(|l| l.name == name || l.group == name);
    let of_group: HashSet<u32> = of_group.map(|luminaire| luminaire.material).collect();
    let mut count = 0;
    for (id, material) in (0..).zip(&mut scene.materials) {
        if material.emits() && (material.name == name || of_group.contains(&id)) {
            material.emission = scale(material.emission);
            count += 1;
        }
    }
    for light in scene.punctual_lights.iter_mut().filter(|l| l.name == name || l.group == name) {
        light.intensity = scale(light.intensity);
        count += 1;
    }
    if name == SUN {
        count += scene.suns.len() + usize::from(is_made);
        scene.suns.iter_mut().for_each(|sun| sun.irradiance = scale(sun.irradiance));
    }
    if name == SKY {
        count += usize::from(is_made || scene.sky.shines());
        if !is_made {
            scene.sky = std::mem::take(&mut scene.sky).dimmed(factor, 1.0);
        }
    }
    if factor == 0.0 {
        scene.punctual_lights.retain(|light| light.intensity != [0.0; 3]);
        scene.suns.retain(|sun| sun.irradiance != [0.0; 3]);
    }
    count
}

/// Returns the names of a scene's groups of lamps, for people.
fn groups(scene: &Scene) -> String {
    const MOST: usize = 12;
    let mut names = scene.lamp_groups();
    let more = names.len().saturating_sub(MOST);
    names.truncate(MOST);
    let more = if more > 0 { format!(" and {more} more") } else { String::new() };
    if names.is_empty() { "none".to_owned() } else { names.join(", ") + &more }
}
