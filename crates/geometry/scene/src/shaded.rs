//! A scene's surfaces at points: their reflectance, emission and normals, with textures.

use glam::{Vec2, Vec3};
use holo_mapped::Array;

use crate::instances::InstanceTable;
use crate::shading::{Channel, Cover, Maps, Octahedral, Shading, WHITE, from_octahedral};
use crate::texture::linear_table;
use crate::{Bsdf, Rgb, Scene, SceneError};

impl Scene {
    /// Adds normals and textures. A [`Shading`] with nothing in it is dropped.
    ///
    /// # Errors
    /// [`SceneError::Shading`] if it does not fit the scene.
    pub fn with_shading(mut self, shading: Shading) -> Result<Scene, SceneError> {
        shading.validate(self.triangles.len(), self.materials.len())?;
        let mut shading = shading;
        if shading.colours.as_flattened().iter().all(|colour| *colour == WHITE) {
            shading.colours = Array::default();
        }
        if shading.opacities.as_flattened().iter().all(|&opacity| opacity == u8::MAX) {
            shading.opacities = Array::default();
        }
        if shading.covers.iter().all(|cover| *cover == Cover::default()) {
            shading.covers.clear();
        }
        if !shading.has_textures() {
            let Shading { normals, colours, covers, opacities, .. } = shading;
            shading = Shading { normals, colours, covers, opacities, ..Shading::default() };
        }
        if shading.has_textures() && shading.maps.is_empty() {
            shading.maps.resize(self.materials.len(), Maps::default());
        }
        self.shading = (!shading.is_empty()).then(|| Box::new(shading));
        self.check_covers()?;
        Ok(self)
    }

    /// Returns the share of light that a surface reflects at a point: the material's colour times
    /// its texture. Metals reflect it as mirrors, other surfaces diffusely. White for glass.
    ///
    /// `u` and `v` are the barycentric weights of the second and third corner. `footprint` is the
    /// width of the observed area in scene units, such as a pixel's. It chooses the resolution of
    /// the texture; 0 takes the finest. If light is divided by this at a sample, and multiplied by
    /// it at a pixel, textures are shown sharply.
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
            || self.colours(triangle).is_some()
    }

    /// Returns whether a triangle is a facet that looks the same at all points.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    pub fn is_plain(&self, triangle: u32) -> bool {
        self.shading.is_none()
            || !self.has_texture(triangle)
                && self.looks_even(triangle)
                && self.maps(triangle).is_none_or(|(_, maps)| *maps == Maps::default())
                && self.smooth_normal(triangle, 0.3, 0.3).is_none()
    }

    /// Returns whether a material has no texture of normals, roughness or metalness. Its
    /// reflections then look the same everywhere.
    #[must_use]
    pub fn has_even_finish(&self, material: usize) -> bool {
        let maps = self.shading.as_ref().and_then(|shading| shading.maps.get(material));
        maps.is_none_or(|maps| maps.normal.is_none() && maps.finish.is_none())
    }

    /// Returns the factor of the base texture and of the corners' colours at a point, as used by
    /// [`reflectance`](Self::reflectance); `None` without either.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn base_texture(&self, triangle: u32, u: f32, v: f32, footprint: f32) -> Option<Rgb> {
        let map = self.maps(triangle).and_then(|(shading, maps)| Some((shading, maps.base?)));
        let texture = map.map(|(shading, map)| {
            let [r, g, b, _] = self.look_up(shading, map, triangle, [u, v], footprint);
            [r, g, b]
        });
        let Some([a, b, c]) = self.colours(triangle) else { return texture };
        let table = linear_table();
        let linear = |colour: [u8; 3], k: usize| table[usize::from(colour[k])];
        let between =
            |k| linear(a, k) * (1.0 - u - v).max(0.0) + linear(b, k) * u + linear(c, k) * v;
        let texture = texture.unwrap_or([1.0; 3]);
        Some(std::array::from_fn(|k| texture[k] * between(k)))
    }

    /// Returns roughness and metalness at a point, if textures define them.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn finish(&self, triangle: u32, u: f32, v: f32, footprint: f32) -> Option<[f32; 2]> {
        let (shading, maps) = self.maps(triangle)?;
        let finish = maps.finish?;
        let number = |from: Channel| {
            from.factor
                * from.texture.map_or(1.0, |texture| {
                    let texel = self.look_up(shading, texture, triangle, [u, v], footprint);
                    texel[usize::from(from.channel)].clamp(0.0, 1.0)
                })
        };
        Some([number(finish.roughness), number(finish.metalness)])
    }

    /// Returns the normal from a texture of normals at a point whose normal is `normal`, on the
    /// side from which the corners appear counter-clockwise. `None` without such a texture.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn mapped_normal(
        &self,
        triangle: u32,
        [u, v]: [f32; 2],
        footprint: f32,
        normal: Vec3,
    ) -> Option<Vec3> {
        let (shading, maps) = self.maps(triangle)?;
        let map = maps.normal?;
        let [x, y, z, _] = self.look_up(shading, map.texture, triangle, [u, v], footprint);
        let [x, y] = [x, y].map(|c| (2.0 * c - 1.0) * map.strength);
        let [right, up] = self.picture_axes(triangle, &self.uvs(shading, triangle)?, normal)?;
        (right * x + up * y + normal * (2.0 * z - 1.0).max(0.05)).try_normalize()
    }

    /// Returns the factor of the emission's texture at a point; `None` without a texture.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn emission_texture(&self, triangle: u32, u: f32, v: f32, footprint: f32) -> Option<Rgb> {
        let (shading, maps) = self.maps(triangle)?;
        let [r, g, b, _] = self.look_up(shading, maps.emission?, triangle, [u, v], footprint);
        Some([r, g, b])
    }

    /// Returns whether a surface has a hole at a point.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn is_cut_out(&self, triangle: u32, u: f32, v: f32) -> bool {
        self.opacity(triangle, u, v) <= 0.0
    }

    /// Returns whether any surface has parts that are cut out.
    #[must_use]
    pub fn has_cut_outs(&self) -> bool {
        self.shading.as_ref().is_some_and(|s| s.maps.iter().any(|maps| maps.cut_out.is_some()))
    }

    /// Returns the unit normal of a curved surface at a point, on the side from which the corners
    /// appear counter-clockwise; `None` for a facet.
    ///
    /// # Panics
    /// If there is no such triangle.
    #[must_use]
    #[inline]
    pub fn smooth_normal(&self, triangle: u32, u: f32, v: f32) -> Option<Vec3> {
        let [a, b, c] = self.normals(self.shading.as_ref()?, triangle)?;
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
        let maps = shading.maps.get(self.material_id(triangle) as usize)?;
        Some((shading, maps))
    }

    #[inline]
    pub(crate) fn look_up(
        &self,
        shading: &Shading,
        texture: u32,
        triangle: u32,
        at: [f32; 2],
        footprint: f32,
    ) -> [f32; 4] {
        let uvs = &self.uvs(shading, triangle).unwrap_or_default();
        let share =
            if footprint > 0.0 { footprint * self.texture_density(triangle, uvs) } else { 0.0 };
        let uv = coordinates(uvs, at).to_array();
        shading.textures[texture as usize].at(uv, share)
    }

    /// Returns the directions on a triangle that are to the right and up in its picture. They have
    /// unit length and are at right angles to `normal`. `None` if the picture has no width there.
    #[inline]
    fn picture_axes(&self, triangle: u32, uvs: &[[f32; 2]; 3], normal: Vec3) -> Option<[Vec3; 2]> {
        let [a, b, c] = self.corners(triangle);
        let [p, q, r] = uvs.map(Vec2::from);
        let (ab, ac, pq, pr) = (b - a, c - a, q - p, r - p);
        // Only signs and directions count, so nothing is divided by the determinant.
        let side = pq.perp_dot(pr).signum();
        let right = (ab * pr.y - ac * pq.y) * side;
        let down = (ac * pq.x - ab * pr.x) * side;
        let right = (right - normal * right.dot(normal)).try_normalize()?;
        let across = normal.cross(right);
        Some([right, if across.dot(down) > 0.0 { -across } else { across }])
    }

    /// Returns the colours of a triangle's corners, unless all are white.
    #[inline]
    fn colours(&self, triangle: u32) -> Option<[[u8; 3]; 3]> {
        let colours = self.colours_of(self.shading.as_ref()?, triangle)?;
        Some(colours).filter(|colours| *colours != [WHITE; 3])
    }

    /// Returns the texture coordinates of a triangle's corners.
    #[inline]
    pub(crate) fn uvs(&self, shading: &Shading, triangle: u32) -> Option<[[f32; 2]; 3]> {
        match &self.shared {
            None => shading.uvs.get(triangle as usize).copied(),
            Some(shared) => self.attribute(shared, &shading.uvs, triangle),
        }
    }

    /// Returns the normals of a triangle's corners.
    #[inline]
    pub(crate) fn normals(&self, shading: &Shading, triangle: u32) -> Option<[Octahedral; 3]> {
        match &self.shared {
            None => shading.normals.get(triangle as usize).copied(),
            Some(shared) => self.placed_normals(shared, shading, triangle),
        }
    }

    /// Returns the colours of a triangle's corners.
    #[inline]
    pub(crate) fn colours_of(&self, shading: &Shading, triangle: u32) -> Option<[[u8; 3]; 3]> {
        match &self.shared {
            None => shading.colours.get(triangle as usize).copied(),
            Some(shared) => self.attribute(shared, &shading.colours, triangle),
        }
    }

    /// Returns the opacities of a triangle's corners.
    #[inline]
    pub(crate) fn opacities_of(&self, shading: &Shading, triangle: u32) -> Option<[u8; 3]> {
        match &self.shared {
            None => shading.opacities.get(triangle as usize).copied(),
            Some(shared) => self.attribute(shared, &shading.opacities, triangle),
        }
    }

    /// Returns an attribute of the corners of a triangle in a scene with instances.
    #[cold]
    fn attribute<T: Copy>(
        &self,
        shared: &InstanceTable,
        all: &[[T; 3]],
        triangle: u32,
    ) -> Option<[T; 3]> {
        let (stored, instance) = self.located(shared, triangle);
        let corners = *all.get(stored)?;
        Some(instance.map_or(corners, |instance| instance.placement.ordered(corners)))
    }

    #[cold]
    fn placed_normals(
        &self,
        shared: &InstanceTable,
        shading: &Shading,
        triangle: u32,
    ) -> Option<[Octahedral; 3]> {
        let (stored, instance) = self.located(shared, triangle);
        let normals = *shading.normals.get(stored)?;
        let Some(instance) = instance else { return Some(normals) };
        let corners = self.mesh_corners(shared, instance, stored);
        Some(instance.placement.normals(corners, normals))
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
