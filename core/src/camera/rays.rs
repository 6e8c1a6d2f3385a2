//! The rays of a picture, from a camera's view and projection.

use glam::{DAffine3, DMat4, DVec3, DVec4};

use super::{CameraError, DepthRange, Projection};
use crate::Viewport;

/// A ray with the interval that the camera sees of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// The point at `t = 0`.
    pub origin: DVec3,
    /// Unit direction.
    pub direction: DVec3,
    /// Where the near plane is met.
    pub near: f64,
    /// Where the far plane is met; may be infinite.
    pub far: f64,
    /// `t` of the point from which depth is counted: the eye, or its plane.
    pub depth_zero: f64,
}

impl Ray {
    /// The point at `t`.
    pub fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }
}

/// What [`RayGrid::ray`] computes rays from: the point on the image plane for pixel coordinates is
/// `corner + x·dx + y·dy`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinearRays {
    /// The eye of a perspective view; the image plane is then given relative to it, and a ray's
    /// direction is the normalised point.
    pub eye: Option<DVec3>,
    /// The direction of all rays of a parallel view; a ray's origin is then the point less its
    /// part along the direction.
    pub direction: DVec3,
    /// `t` from which depth is counted.
    pub depth_zero: f64,
    /// The point for pixel coordinates (0, 0).
    pub corner: DVec3,
    /// Its change from column to column.
    pub dx: DVec3,
    /// Its change from row to row.
    pub dy: DVec3,
    /// Normal of the near and far planes.
    pub axis: DVec3,
    /// `axis·p` on the near plane.
    pub near: f64,
    /// `axis·p` on the far plane.
    pub far: f64,
}

/// All rays of a picture.
#[derive(Clone, Debug, PartialEq)]
pub struct RayGrid {
    kind: GridKind,
    /// Points on the image plane: `corner + x·dx + y·dy` for pixel coordinates.
    corner: DVec3,
    dx: DVec3,
    dy: DVec3,
    /// Normal of the near and far planes, and their offsets: inside is `near ≤ n·p ≤ far`.
    axis: DVec3,
    near: f64,
    far: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum GridKind {
    /// Rays leave the eye; the image plane is given relative to it.
    Perspective { eye: DVec3 },
    /// Rays share a unit direction; `zero` is the depth's zero along it.
    Parallel { direction: DVec3, zero: f64 },
}

impl RayGrid {
    /// Whether the rays meet in an eye, and where.
    pub fn eye(&self) -> Option<DVec3> {
        match self.kind {
            GridKind::Perspective { eye } => Some(eye),
            GridKind::Parallel { .. } => None,
        }
    }

    /// The coefficients from which kernels make many rays at once.
    pub fn linear(&self) -> LinearRays {
        let (eye, direction, depth_zero) = match self.kind {
            GridKind::Perspective { eye } => (Some(eye), DVec3::ZERO, 0.0),
            GridKind::Parallel { direction, zero } => (None, direction, zero),
        };
        let (corner, dx, dy, axis) = (self.corner, self.dx, self.dy, self.axis);
        LinearRays { eye, direction, depth_zero, corner, dx, dy, axis, near: self.near, far: self.far }
    }

    /// The view axis: normal of near and far planes, pointing away from the eye.
    pub fn axis(&self) -> DVec3 {
        self.axis
    }

    /// The ray through a point of the viewport in pixels; pixel (x, y) has its centre at +0.5.
    pub fn ray(&self, x: f64, y: f64) -> Ray {
        let plane = self.corner + self.dx * x + self.dy * y;
        match self.kind {
            GridKind::Perspective { eye } => {
                let direction = plane.normalize();
                let (slope, start) = (self.axis.dot(direction), self.axis.dot(eye));
                let [near, far] = self.clip(slope, start);
                Ray { origin: eye, direction, near: near.max(0.0), far, depth_zero: 0.0 }
            }
            GridKind::Parallel { direction, zero } => {
                let origin = plane - direction * plane.dot(direction);
                let [near, far] = self.clip(self.axis.dot(direction), self.axis.dot(origin));
                Ray { origin, direction, near, far, depth_zero: zero }
            }
        }
    }

    fn clip(&self, slope: f64, start: f64) -> [f64; 2] {
        let at = |plane: f64| if plane.is_finite() { (plane - start) / slope } else { plane };
        [at(self.near), at(self.far)]
    }

    pub(super) fn world_to_view(&self) -> DAffine3 {
        let forward = self.axis;
        let up = -self.dy.normalize();
        let right = forward.cross(up).normalize();
        let up = right.cross(forward);
        let rotation = glam::DMat3::from_cols(right, up, -forward).transpose();
        let eye = self.eye().unwrap_or(self.corner);
        DAffine3::from_mat3_translation(rotation, -(rotation * eye))
    }
}

fn error(what: &'static str, found: impl ToString, wanted: &'static str) -> CameraError {
    CameraError { what, found: found.to_string(), wanted }
}

pub(super) fn look_at(
    eye: DVec3,
    target: DVec3,
    up: DVec3,
    projection: Projection,
    [near, far]: [f64; 2],
    viewport: &Viewport,
) -> Result<RayGrid, CameraError> {
    for (what, v) in [("eye", eye), ("target", target), ("up", up)] {
        if !v.is_finite() {
            return Err(error(what, v, "finite numbers"));
        }
    }
    let forward = (target - eye).try_normalize().ok_or_else(|| error("target", target, "a point off the eye"))?;
    let side = up.try_normalize().map(|up| forward.cross(up)).filter(|s| s.length() > 1e-12);
    let right = side.ok_or_else(|| error("up", up, "a direction off the view axis"))?.normalize();
    let up = right.cross(forward);
    if near.is_nan() || far.is_nan() || near >= far || near == f64::INFINITY {
        return Err(error("near and far", format!("{near} and {far}"), "near below far"));
    }
    let (w, h) = (viewport.width as f64, viewport.height as f64);
    let start = forward.dot(eye);
    let grid = |kind, center: DVec3, half: f64| RayGrid {
        kind,
        corner: center - right * (half * w / h) + up * half,
        dx: right * (2.0 * half / h),
        dy: -up * (2.0 * half / h),
        axis: forward,
        near: start + near,
        far: start + far,
    };
    match projection {
        Projection::Perspective { fov_y } => {
            if !(fov_y > 0.0 && fov_y < 180.0) {
                return Err(error("field of view", fov_y, "above 0 and below 180 degrees"));
            }
            if near < 0.0 {
                return Err(error("near", near, "at least 0"));
            }
            let half = (fov_y / 2.0).to_radians().tan();
            Ok(grid(GridKind::Perspective { eye }, forward, half))
        }
        Projection::Orthographic { height } => {
            if !(height > 0.0 && height.is_finite()) {
                return Err(error("height", height, "a positive, finite number"));
            }
            let kind = GridKind::Parallel { direction: forward, zero: start };
            Ok(grid(kind, eye, height / 2.0))
        }
    }
}

pub(super) fn matrices(
    view: DMat4,
    projection: DMat4,
    depth: DepthRange,
    viewport: &Viewport,
) -> Result<RayGrid, CameraError> {
    if !view.is_finite() || !projection.is_finite() {
        return Err(error("matrix", "not finite", "finite numbers"));
    }
    let inverse = (projection * view).inverse();
    if !inverse.is_finite() {
        return Err(error("matrix", "singular", "invertible view and projection"));
    }
    let near_depth = if depth == DepthRange::ZeroToOne { 0.0 } else { -1.0 };
    let point = |x: f64, y: f64, z: f64| {
        let p = inverse * DVec4::new(x, y, z, 1.0);
        p.truncate() / p.w
    };
    let (w, h) = (viewport.width as f64, viewport.height as f64);
    // The one point, finite or not, through which all rays pass.
    let apex = inverse * DVec4::new(0.0, 0.0, 1.0, 0.0);
    let corner = [point(-1.0, 1.0, near_depth), point(1.0, 1.0, near_depth), point(-1.0, -1.0, near_depth)];
    if corner.iter().any(|c| !c.is_finite()) {
        return Err(error("projection", "a near plane at infinity", "a finite near plane"));
    }
    let axis_raw = (corner[2] - corner[0]).cross(corner[1] - corner[0]);
    let axis =
        axis_raw.try_normalize().ok_or_else(|| error("projection", "a view without area", "an invertible matrix"))?;
    let far_h = inverse * DVec4::new(0.0, 0.0, 1.0, 1.0);
    let finite_apex = apex.w.abs() > 1e-12 * apex.truncate().length().max(1e-300);
    let inner = point(0.0, 0.0, if depth == DepthRange::ZeroToOne { 0.5 } else { 0.0 });
    let middle = point(0.0, 0.0, near_depth);
    let axis = if axis.dot(inner - middle) < 0.0 { -axis } else { axis };
    let far_point = far_h.truncate() / far_h.w;
    let far = axis.dot(far_point);
    let near = axis.dot(corner[0]);
    let far = if far.is_finite() && far > near { far } else { f64::INFINITY };
    let (dx, dy) = ((corner[1] - corner[0]) / w, (corner[2] - corner[0]) / h);
    let (kind, origin) = if finite_apex {
        let eye = apex.truncate() / apex.w;
        (GridKind::Perspective { eye }, corner[0] - eye)
    } else {
        let direction = (inner - middle).normalize();
        (GridKind::Parallel { direction, zero: direction.dot(middle) }, corner[0])
    };
    Ok(RayGrid { kind, corner: origin, dx, dy, axis, near, far })
}
