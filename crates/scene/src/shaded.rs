//! A scene's surfaces at points: their reflectance, emission and normals, with textures.

use glam::{Vec2, Vec3};

use crate::shading::{CUT_OUT, Maps, Shading, from_octahedral};
use crate::{Bsdf, Rgb, Scene, SceneError};

impl Scene {
    /// Adds normals and textures. A [`Shading`] with nothing in it is dropped.
    ///
    /// # Errors
    /// [`SceneError::Shading`] if it does not fit the scene.
    pub fn with_shading(mut self, shading: Shading) -> Result<Scene, SceneError> {
        shading.validate(self.triangles.len(), self.materials.len())?;
        let mut shading = shading;
        if shading.maps.iter().all(|maps| *maps == Maps::default()) {
            shading = Shading { normals: shading.normals, ..Shading::default() };
        }
        self.shading = (!shading.is_empty()).then(|| Box::new(shading));
        Ok(self)
    }

    /// Returns the share of light that a surface reflects diffusely (metals: mirrors) at a point: the
    /// material's colour times its texture. White for glass.
    ///
    /// `u` and `v` are the barycentric weights of the second and third corner. `footprint` is the
    /// width in scene units of what is looked at, such as a pixel's, and chooses the resolution of
    /// the texture; 0 takes the finest. Light divided by this at a sample, and multiplied by it at a
    /// pixel, shows textures sharply.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn reflectance(&self, triangle: u32, u: f32, v: f32, footprint: f32) -> Rgb {
        let colour = match self.material(triangle).bsdf {
            Bsdf::Diffuse { kd } | Bsdf::Coated { kd, .. } => kd,
            Bsdf::Conductor { ks, .. } | Bsdf::Mirror { ks } => ks,
            Bsdf::ThinGlass { .. } | Bsdf::Dielectric { .. } => [1.0; 3],
        };
        match self.base_texture(triangle, u, v, footprint) {
            None => colour,
            Some(texture) => std::array::from_fn(|k| colour[k] * texture[k]),
        }
    }

    /// Returns whether the reflectance of a triangle changes from point to point.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn has_texture(&self, triangle: u32) -> bool {
        self.maps(triangle).is_some_and(|(_, maps)| maps.base.is_some())
    }

    /// Returns the factor of the base texture at a point, as [`reflectance`](Self::reflectance) takes
    /// it; `None` without a texture.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn base_texture(&self, triangle: u32, u: f32, v: f32, footprint: f32) -> Option<Rgb> {
        let (shading, maps) = self.maps(triangle)?;
        Some(self.look_up(shading, maps.base?, triangle, [u, v], footprint))
    }

    /// Returns the factor of the emission's texture at a point; `None` without a texture.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn emission_texture(&self, triangle: u32, u: f32, v: f32, footprint: f32) -> Option<Rgb> {
        let (shading, maps) = self.maps(triangle)?;
        Some(self.look_up(shading, maps.emission?, triangle, [u, v], footprint))
    }

    /// Returns whether a cut-out surface is not there at a point.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn is_cut_out(&self, triangle: u32, u: f32, v: f32) -> bool {
        let Some((shading, maps)) = self.maps(triangle) else { return false };
        let Some(texture) = maps.cut_out else { return false };
        let uv = coordinates(&shading.uvs[triangle as usize], [u, v]);
        shading.textures[texture as usize].at(uv.to_array(), 0.0)[3] < CUT_OUT
    }

    /// Returns whether any surface has parts that are cut out.
    #[must_use]
    pub fn has_cut_outs(&self) -> bool {
        self.shading.as_ref().is_some_and(|s| s.maps.iter().any(|maps| maps.cut_out.is_some()))
    }

    /// Returns the unit normal of a curved surface at a point, on the side from which the corners run
    /// counter-clockwise; `None` for a facet.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn smooth_normal(&self, triangle: u32, u: f32, v: f32) -> Option<Vec3> {
        let normals = &self.shading.as_ref()?.normals;
        let [a, b, c] = *normals.get(triangle as usize)?;
        if a == b && b == c {
            // The normal of all corners: the facet's own, or nearly.
            return None;
        }
        (from_octahedral(a) * (1.0 - u - v) + from_octahedral(b) * u + from_octahedral(c) * v)
            .try_normalize()
    }

    #[inline]
    fn maps(&self, triangle: u32) -> Option<(&Shading, &Maps)> {
        let shading = self.shading.as_ref()?;
        let maps = shading.maps.get(self.material_ids[triangle as usize] as usize)?;
        Some((shading, maps))
    }

    #[inline]
    fn look_up(
        &self,
        shading: &Shading,
        texture: u32,
        triangle: u32,
        at: [f32; 2],
        footprint: f32,
    ) -> Rgb {
        let uvs = &shading.uvs[triangle as usize];
        let share =
            if footprint > 0.0 { footprint * self.texture_density(triangle, uvs) } else { 0.0 };
        let uv = coordinates(uvs, at).to_array();
        let [r, g, b, _] = shading.textures[texture as usize].at(uv, share);
        [r, g, b]
    }

    /// Returns sides of the texture per scene unit, the mean over directions on a triangle.
    #[inline]
    fn texture_density(&self, triangle: u32, uvs: &[[f32; 2]; 3]) -> f32 {
        let [a, b, c] = self.corners(triangle);
        let area = (b - a).cross(c - a).length();
        let [p, q, r] = uvs.map(Vec2::from);
        let covered = (q - p).perp_dot(r - p).abs();
        if area > 0.0 { (covered / area).sqrt() } else { 0.0 }
    }
}

#[inline]
fn coordinates(uvs: &[[f32; 2]; 3], [u, v]: [f32; 2]) -> Vec2 {
    let [a, b, c] = uvs.map(Vec2::from);
    a + (b - a) * u + (c - a) * v
}
