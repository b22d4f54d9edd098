//! Groups of a scene's lamps, by which people dim them.

use std::collections::BTreeSet;

use crate::Scene;

/// Name of the group of all suns.
pub const SUN: &str = "sun";

/// Name of the sky as a group.
pub const SKY: &str = "sky";

impl Scene {
    /// Returns the names of the groups of lamps: luminaires and punctual lights by their groups,
    /// other lamps by their materials; then [`SUN`] and [`SKY`], if the scene has them.
    #[must_use]
    pub fn lamp_groups(&self) -> Vec<String> {
        let of_luminaire: BTreeSet<u32> = self.luminaires().iter().map(|l| l.material).collect();
        // Lamps are often many triangles of few materials.
        let used: BTreeSet<u32> =
            self.emitters().map(|triangle| self.material_id(triangle)).collect();
        let plain = used.difference(&of_luminaire).map(|id| &*self.materials[*id as usize].name);
        let hung = self.luminaires().iter().filter(|l| used.contains(&l.material));
        let hung = hung.map(|l| group_or_name(&l.group, &l.name));
        let points = self.punctual_lights.iter().map(|l| group_or_name(&l.group, &l.name));
        let names: BTreeSet<&str> =
            plain.chain(hung).chain(points).filter(|name| !name.is_empty()).collect();
        let mut names: Vec<String> = names.into_iter().map(str::to_owned).collect();
        let mut add = |name: &str, is_there: bool| {
            if is_there && !names.iter().any(|other| other == name) {
                names.push(name.to_owned());
            }
        };
        add(SUN, self.all_suns().next().is_some());
        add(SKY, self.sky.shines());
        names
    }
}

fn group_or_name<'a>(group: &'a str, name: &'a str) -> &'a str {
    if group.is_empty() { name } else { group }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use crate::{Bsdf, Material, Scene};

    #[test]
    fn groups_are_materials_that_shine_and_are_used_then_the_sky() {
        let lamp = |name: &str| Material {
            emission: [1.0; 3],
            bsdf: Bsdf::Diffuse { kd: [0.0; 3] },
            ..Material::grey(name)
        };
        let materials = vec![lamp("b"), Material::grey("wall"), lamp("a"), lamp("spare")];
        let corners = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let faces = [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]];
        let scene = |sky| {
            Scene::from_world(&corners, &faces, &[0, 1, 2, 0], materials.clone(), sky).unwrap().0
        };
        assert_eq!(scene([0.0; 3]).lamp_groups(), ["a", "b"]);
        assert_eq!(scene([1.0; 3]).lamp_groups(), ["a", "b", "sky"]);
    }
}
