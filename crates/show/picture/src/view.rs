//! A view: the eye's position, direction and field of view, and the ray of every point of its
//! picture.
//!
//! Invariants: a [`View`] is finite and not degenerate. Its axes are orthonormal, and both sides
//! of its picture are valid for its type. Its parameters can be read like fields but never changed.

use crate::kind::{ACROSS, ALONG, ViewKind};
use crate::size::is_size;
use crate::view_error::ViewError;
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::f64::consts::TAU;
use std::ops::{Deref, Range};

/// Horizontal angle in degrees of a perspective view that states no angle.
pub const DEFAULT_VH: f64 = 60.0;

/// Sine of the smallest angle allowed between the view direction and the up vector.
const MIN_UP_SINE: f64 = 1e-6;

/// The parameters of a [`View`], which can be read through it: `view.vp`, `view.vh`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ViewParams {
    /// View type.
    #[serde(default)]
    pub kind: ViewKind,
    /// Eye, in scene units. For a parallel view, the centre of the plane on which rays begin.
    pub vp: DVec3,
    /// Direction of the view's centre; unit length.
    pub vd: DVec3,
    /// Direction that is up in the picture; unit length. Not necessarily perpendicular to `vd`.
    pub vu: DVec3,
    /// Full horizontal angle in degrees; for a parallel view the width in scene units.
    pub vh: f64,
    /// Full vertical angle in degrees; for a parallel view the height in scene units.
    pub vv: f64,
    /// Shift of the picture to the right, in widths of the picture.
    #[serde(default)]
    pub vs: f64,
    /// Shift of the picture upwards, in heights of the picture.
    #[serde(default)]
    pub vl: f64,
    /// Fore clipping distance in scene units; 0 for none. For a parallel view, the distance before
    /// `vp` at which rays begin.
    #[serde(default)]
    pub vo: f64,
    /// Aft clipping distance in scene units; 0 for none.
    #[serde(default)]
    pub va: f64,
}

/// The stated parameters of a view's picture.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(crate) struct ViewParameters {
    pub kind: ViewKind,
    pub vh: Option<f64>,
    pub vv: Option<f64>,
    pub vs: f64,
    pub vl: f64,
    pub vo: f64,
    pub va: f64,
}

/// A view of one of Radiance's types `v`, `l`, `c`, `a` and `h`.
///
/// Picture coordinates are as in Radiance: `x` from 0 (left) to 1 (right) and `y` from 0
/// (**bottom**) to 1 (top). Pixel coordinates count rows from the **top**, as
/// [`Picture`](crate::Picture) stores them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "ViewParams", into = "ViewParams")]
pub struct View {
    params: ViewParams,
    /// Right in the picture; unit length.
    right: DVec3,
    /// Up in the picture; unit length, perpendicular to `vd` and `right`.
    up: DVec3,
    /// Width and height of the picture on the plane of its type.
    extent: [f64; 2],
}

/// Makes `view.vp` and other parameters readable. Without `DerefMut`, nothing can make a view
/// invalid.
impl Deref for View {
    type Target = ViewParams;

    fn deref(&self) -> &ViewParams {
        &self.params
    }
}

impl TryFrom<ViewParams> for View {
    type Error = ViewError;

    fn try_from(params: ViewParams) -> Result<View, ViewError> {
        View::from_params(params)
    }
}

impl From<View> for ViewParams {
    fn from(view: View) -> ViewParams {
        view.params
    }
}

impl View {
    /// Makes a perspective view for a picture of `size` pixels; only the shape of the picture
    /// matters.
    ///
    /// If one angle is missing, it follows from the other one and `size` so that pixels are square.
    /// If both are missing, `vh` is [`DEFAULT_VH`]. If both are given, both are kept. The lengths
    /// of `vd` and `vu` do not matter. [`ViewSpec::resolve`](crate::ViewSpec::resolve) makes views
    /// of other types.
    ///
    /// # Errors
    /// Numbers that are not finite, zero or parallel directions, angles outside (0, 180),
    /// impossible sizes.
    pub fn new(
        vp: DVec3,
        vd: DVec3,
        vu: DVec3,
        vh: Option<f64>,
        vv: Option<f64>,
        size: (u32, u32),
    ) -> Result<View, ViewError> {
        View::framed(vp, vd, vu, &ViewParameters { vh, vv, ..ViewParameters::default() }, size)
    }

    /// Makes a perspective view, and returns it with the size of its picture. The size is
    /// `max_size`, unless both angles are given. Then it is the size of the largest picture with
    /// square pixels that fits into `max_size` (Radiance's `rpict -x -y -pa 1`).
    ///
    /// # Errors
    /// As [`View::new`].
    pub fn resolve(
        vp: DVec3,
        vd: DVec3,
        vu: DVec3,
        vh: Option<f64>,
        vv: Option<f64>,
        max_size: (u32, u32),
    ) -> Result<(View, (u32, u32)), ViewError> {
        View::fitted(vp, vd, vu, &ViewParameters { vh, vv, ..ViewParameters::default() }, max_size)
    }

    /// Implements [`View::resolve`] for any type.
    pub(crate) fn fitted(
        vp: DVec3,
        vd: DVec3,
        vu: DVec3,
        frame: &ViewParameters,
        max_size: (u32, u32),
    ) -> Result<(View, (u32, u32)), ViewError> {
        let view = View::framed(vp, vd, vu, frame, max_size)?;
        let size =
            if frame.vh.is_some() && frame.vv.is_some() { view.fit(max_size) } else { max_size };
        Ok((view, size))
    }

    /// Implements [`View::new`] for any type.
    fn framed(
        vp: DVec3,
        vd: DVec3,
        vu: DVec3,
        frame: &ViewParameters,
        size: (u32, u32),
    ) -> Result<View, ViewError> {
        if !is_size(size) {
            let (width, height) = size;
            return Err(ViewError::Size { width, height });
        }
        let ViewParameters { kind, vh, vv, vs, vl, vo, va } = *frame;
        let aspect = f64::from(size.1) / f64::from(size.0);
        let from_width = |vh: f64| Ok((vh, other_size(kind, (ACROSS, vh), ALONG, aspect)?));
        let (vh, vv) = match (vh, vv) {
            (Some(vh), Some(vv)) => (vh, vv),
            (Some(vh), None) => from_width(vh)?,
            (None, Some(vv)) => (other_size(kind, (ALONG, vv), ACROSS, 1.0 / aspect)?, vv),
            (None, None) => from_width(
                default_vh(kind)
                    .ok_or(ViewError::Missing("-vh: how wide it is, in scene units"))?,
            )?,
        };
        View::from_params(ViewParams { kind, vp, vd, vu, vh, vv, vs, vl, vo, va })
    }

    /// Returns the same view at another position and with another direction.
    ///
    /// # Errors
    /// As [`View::new`].
    pub fn moved(&self, vp: DVec3, vd: DVec3) -> Result<View, ViewError> {
        View::from_params(ViewParams { vp, vd, ..self.params })
    }

    /// Returns the same view with its picture shifted to the right by so many widths of the picture
    /// more: see [`vs`](ViewParams::vs).
    #[must_use]
    pub fn shifted(&self, widths: f64) -> View {
        View { params: ViewParams { vs: self.params.vs + widths, ..self.params }, ..*self }
    }

    /// Returns the view whose picture is a part of this view's: these columns and rows, counted
    /// from the left and from the top, of a picture of `size` pixels. A part that is empty or
    /// reaches beyond the picture is widened or cut to one inside it.
    #[must_use]
    pub fn part(&self, size: (u32, u32), columns: Range<u32>, rows: Range<u32>) -> View {
        let shares = |range: Range<u32>, whole: u32| {
            let start = range.start.min(whole.saturating_sub(1));
            let end = range.end.clamp(start + 1, whole.max(1));
            let whole = f64::from(whole.max(1));
            (f64::from(start) / whole, f64::from(end) / whole)
        };
        let ((left, right), (top, bottom)) = (shares(columns, size.0), shares(rows, size.1));
        let (width, height) = (right - left, bottom - top);
        let extent = [self.extent[0] * width, self.extent[1] * height];
        let kind = self.params.kind;
        // A part is smaller than the whole, so its angles exist.
        let vh = kind.option_value(ACROSS, extent[0]).unwrap_or(self.params.vh);
        let vv = kind.option_value(ALONG, extent[1]).unwrap_or(self.params.vv);
        let vs = (left - 0.5 + self.params.vs) / width + 0.5;
        let vl = (0.5 - bottom + self.params.vl) / height + 0.5;
        View { params: ViewParams { vh, vv, vs, vl, ..self.params }, extent, ..*self }
    }

    /// Returns the largest size with square pixels for this view's shape that fits into `max_size`;
    /// each side is at least 1.
    pub fn fit(&self, max_size: (u32, u32)) -> (u32, u32) {
        let shape = self.extent[1] / self.extent[0];
        let (width, height) = (f64::from(max_size.0), f64::from(max_size.1));
        // The casts saturate. Radiance rounds to the nearest, too (image.c, normaspect).
        if shape * width > height {
            (((height / shape + 0.5) as u32).clamp(1, max_size.0.max(1)), max_size.1)
        } else {
            (max_size.0, ((shape * width + 0.5) as u32).clamp(1, max_size.1.max(1)))
        }
    }

    /// Returns the ray through picture coordinates (`x`, `y`), where `y` = 0 is the bottom: its
    /// origin and its unit direction.
    ///
    /// Clipping surfaces are ignored: see [`clipped_ray`](Self::clipped_ray). The direction is 0
    /// where the picture shows none: see [`try_ray`](Self::try_ray). Such a ray meets nothing, and
    /// no section covers it.
    #[inline]
    pub fn ray(&self, x: f64, y: f64) -> (DVec3, DVec3) {
        self.try_ray(x, y).unwrap_or((self.params.vp, DVec3::ZERO))
    }

    /// Returns the ray as [`ray`](Self::ray) does, or `None` where the picture shows nothing: in
    /// the corners of fisheyes.
    #[inline]
    pub fn try_ray(&self, x: f64, y: f64) -> Option<(DVec3, DVec3)> {
        let across = (x - 0.5 + self.params.vs) * self.extent[0];
        let along = (y - 0.5 + self.params.vl) * self.extent[1];
        match self.params.kind {
            ViewKind::Perspective => Some((
                self.params.vp,
                (self.params.vd + self.right * across + self.up * along).normalize(),
            )),
            ViewKind::Parallel => {
                Some((self.eye() + self.right * across + self.up * along, self.params.vd))
            }
            kind => {
                let d = kind.direction([across, along])?;
                Some((
                    self.params.vp,
                    (self.right * d.x + self.up * d.y + self.params.vd * d.z).normalize(),
                ))
            }
        }
    }

    /// Returns the ray that sees the point `p`: its origin and its unit direction. It begins at the
    /// eye, or on the plane of a parallel view (behind which `p` may lie).
    #[inline]
    pub fn ray_to(&self, p: DVec3) -> (DVec3, DVec3) {
        let (eye, vd) = (self.eye(), self.params.vd);
        if self.params.kind.has_eye() {
            (eye, (p - eye).normalize_or(vd))
        } else {
            (p - vd * (p - eye).dot(vd), vd)
        }
    }

    /// Returns where the point `p` is seen: (`x`, `y`, distance from the origin of its ray). The
    /// inverse of [`View::ray`].
    ///
    /// `x` and `y` are outside [0, 1] for points outside the picture. `None` for points that no ray
    /// of the view meets, whatever the size of its picture: behind the eye of a perspective view.
    #[inline]
    pub fn project(&self, p: DVec3) -> Option<(f64, f64, f64)> {
        let d = p - self.eye();
        if self.params.kind.has_eye() {
            let (x, y) = self.project_direction(d)?;
            return Some((x, y, d.length()));
        }
        let d = self.to_local(d);
        let (x, y) = self.project_local(d)?;
        Some((x, y, d.z))
    }

    /// Returns the point (`x`, `y`) at which something infinitely far away in direction `d` (of any
    /// length) is seen. `None` if no ray of the view has this direction, such as behind the eye.
    /// Always `None` for a parallel view, because all its rays have one direction.
    #[inline]
    pub fn project_direction(&self, d: DVec3) -> Option<(f64, f64)> {
        match self.params.kind {
            ViewKind::Perspective => {
                let depth = d.dot(self.params.vd);
                if depth > 0.0 {
                    let x = 0.5 - self.params.vs + d.dot(self.right) / (depth * self.extent[0]);
                    let y = 0.5 - self.params.vl + d.dot(self.up) / (depth * self.extent[1]);
                    Some((x, y))
                } else {
                    None
                }
            }
            ViewKind::Parallel => None,
            _ => self.project_local(self.to_local(d)),
        }
    }

    /// Implements [`project`](Self::project) for a point relative to the eye, given as (right, up,
    /// forward): (`x`, `y`).
    #[inline]
    pub fn project_local(&self, place: DVec3) -> Option<(f64, f64)> {
        let [u, v] = self.params.kind.plane(place)?;
        let (x, y) =
            (u / self.extent[0] + 0.5 - self.params.vs, v / self.extent[1] + 0.5 - self.params.vl);
        if self.params.kind == ViewKind::Cylindrical && !(0.0..1.0).contains(&x) {
            // A shifted panorama continues beyond the direction straight behind.
            let around = TAU / self.extent[0];
            let other = if x < 0.0 { x + around } else { x - around };
            return Some((if (0.0..1.0).contains(&other) { other } else { x }, y));
        }
        Some((x, y))
    }

    /// Converts a vector to (right, up, forward).
    pub(crate) fn to_local(self, d: DVec3) -> DVec3 {
        DVec3::new(d.dot(self.right), d.dot(self.up), d.dot(self.params.vd))
    }

    /// Returns the picture coordinates of the centre of a pixel; `row` 0 is at the top.
    #[inline]
    pub fn pixel_centre(size: (u32, u32), column: u32, row: u32) -> (f64, f64) {
        (
            (f64::from(column) + 0.5) / f64::from(size.0),
            1.0 - (f64::from(row) + 0.5) / f64::from(size.1),
        )
    }

    /// Returns the (column, row) of the pixel that contains picture coordinates; row 0 is at the
    /// top. `None` outside the picture.
    #[inline]
    pub fn pixel_at(size: (u32, u32), x: f64, y: f64) -> Option<(u32, u32)> {
        let (column, row) =
            ((x * f64::from(size.0)).floor(), ((1.0 - y) * f64::from(size.1)).floor());
        let inside =
            column >= 0.0 && row >= 0.0 && column < f64::from(size.0) && row < f64::from(size.1);
        inside.then_some((column as u32, row as u32))
    }

    /// Returns the width of one pixel in scene units, at `distance` along the axis, for a picture
    /// of `size` pixels. It does not depend on the distance in parallel views.
    pub fn pixel_footprint(&self, size: (u32, u32), distance: f64) -> f64 {
        let distance = if self.params.kind.has_eye() { distance } else { 1.0 };
        self.extent[0] * distance / f64::from(size.0)
    }

    /// Returns the direction that is right in the picture; unit length.
    pub fn right(&self) -> DVec3 {
        self.right
    }

    /// Returns the direction that is up in the picture; unit length. Perpendicular to the view
    /// direction, which `vu` need not be.
    pub fn up(&self) -> DVec3 {
        self.up
    }

    /// Returns width and height of the picture on the plane of its type. For a perspective view
    /// they are taken at distance 1 along the axis; for a parallel one they are scene units. For
    /// others they are radians along the axes, near the centre.
    pub fn extent(&self) -> (f64, f64) {
        (self.extent[0], self.extent[1])
    }

    /// Returns the view as Radiance's options: `-vtv -vp 1 2 3 -vd 0 1 0 -vu 0 0 1 -vh 60 -vv 45
    /// -vo 0 -va 0 -vs 0 -vl 0`. Numbers are written so that they read back exactly.
    pub fn to_vf_options(&self) -> String {
        let ViewParams { kind, vp, vd, vu, vh, vv, vs, vl, vo, va } = self.params;
        format!(
            "-vt{} -vp {} {} {} -vd {} {} {} -vu {} {} {} -vh {vh} -vv {vv} -vo {vo} -va {va} -vs {vs} -vl {vl}",
            kind.letter(),
            vp.x,
            vp.y,
            vp.z,
            vd.x,
            vd.y,
            vd.z,
            vu.x,
            vu.y,
            vu.z
        )
    }

    fn from_params(params: ViewParams) -> Result<View, ViewError> {
        let ViewParams { kind, vp, vd, vu, vh, vv, vs, vl, vo, va } = params;
        for (option, is_finite) in
            [("-vp", vp.is_finite()), ("-vs", vs.is_finite()), ("-vl", vl.is_finite())]
        {
            if !is_finite {
                return Err(ViewError::NotFinite { option });
            }
        }
        check_clipping(kind, vo, va)?;
        let vd = unit("-vd", vd)?;
        let vu = unit("-vu", vu)?;
        let extent = [kind.extent(ACROSS, vh)?, kind.extent(ALONG, vv)?];
        let across = vd.cross(vu);
        if across.length() < MIN_UP_SINE {
            return Err(ViewError::UpIsAlongView);
        }
        let right = across.normalize();
        let up = right.cross(vd).normalize();
        Ok(View { params: ViewParams { vd, vu, ..params }, right, up, extent })
    }
}

/// Returns `-vh` for views that state no size. `None` for lengths, which have no default.
fn default_vh(kind: ViewKind) -> Option<f64> {
    match kind {
        ViewKind::Perspective => Some(DEFAULT_VH),
        ViewKind::Parallel => None,
        ViewKind::Cylindrical => Some(360.0),
        ViewKind::Angular | ViewKind::Hemispherical => Some(180.0),
    }
}

/// Checks the clipping distances of a view.
fn check_clipping(kind: ViewKind, vo: f64, va: f64) -> Result<(), ViewError> {
    for (option, value) in [("-vo", vo), ("-va", va)] {
        if !value.is_finite() {
            return Err(ViewError::NotFinite { option });
        }
    }
    if vo < 0.0 && kind.has_eye() {
        return Err(ViewError::ForeBehindEye { vo });
    }
    // As in Radiance's `setview`, 0 means none.
    if va < 0.0 || (va > 0.0 && va <= vo) {
        return Err(ViewError::AftBeforeFore { vo, va });
    }
    Ok(())
}

fn unit(option: &'static str, v: DVec3) -> Result<DVec3, ViewError> {
    if !v.is_finite() {
        return Err(ViewError::NotFinite { option });
    }
    let largest = v.abs().max_element();
    if largest == 0.0 {
        return Err(ViewError::ZeroDirection { option });
    }
    // A vector of unit length stays unchanged, so that a view that is written and read is the same
    // view.
    if (v.length_squared() - 1.0).abs() < 4.0 * f64::EPSILON {
        return Ok(v);
    }
    // Scaled first, because the square of a very short or very long vector is 0 or infinite.
    Ok((v / largest).normalize())
}

/// Returns the value of option `other` that makes pixels square, if option `given` has this value.
/// The size on the plane is `ratio` times that of `given`.
fn other_size(
    kind: ViewKind,
    (given, size): ((&'static str, usize), f64),
    other: (&'static str, usize),
    ratio: f64,
) -> Result<f64, ViewError> {
    let extent = kind.extent(given, size)? * ratio;
    kind.option_value(other, extent).ok_or(ViewError::NoSquare {
        given: given.0,
        size,
        other: other.0,
    })
}
