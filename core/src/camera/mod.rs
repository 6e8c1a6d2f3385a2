//! Cameras and rays. World space is right-handed; image row 0 is at the top; the centre of pixel
//! (x, y) lies at (x + ½, y + ½).
//!
//! Along a ray, `t` is the world distance from the eye (perspective) or from the plane through
//! the world's origin at right angles to the rays (orthographic). The sampling lattice is counted
//! in this `t`, so that it does not depend on where an orthographic camera stands.

mod rays;

use glam::{DAffine3, DMat4, DVec3};
use thiserror::Error;

use crate::{Aabb, Viewport};
pub use rays::{LinearRays, Ray, RayGrid};
use rays::{look_at, matrices};

/// How the view is projected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Perspective with a vertical field of view in degrees.
    Perspective {
        /// Full vertical angle in degrees, above 0 and below 180.
        fov_y: f64,
    },
    /// Orthographic with the height of the view in world units.
    Orthographic {
        /// Height in world units.
        height: f64,
    },
}

/// The clip-space depth that a projection matrix maps near and far to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DepthRange {
    /// 0 at near, 1 at far (wgpu, Vulkan, Direct3D).
    #[default]
    ZeroToOne,
    /// −1 at near, 1 at far (OpenGL).
    MinusOneToOne,
}

/// A camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Camera {
    /// An eye that looks at a point.
    LookAt {
        /// Position of the eye.
        eye: DVec3,
        /// The point in the middle of the picture.
        target: DVec3,
        /// What points up in the picture.
        up: DVec3,
        /// The projection.
        projection: Projection,
        /// Distance of the near plane along the view axis from the eye.
        near: f64,
        /// Distance of the far plane along the view axis from the eye; may be infinite.
        far: f64,
    },
    /// Any view and projection matrices, off-axis ones included; y up in clip space.
    Matrices {
        /// World to view space.
        view: DMat4,
        /// View to clip space.
        projection: DMat4,
        /// What near and far map to.
        depth: DepthRange,
    },
}

/// Why a camera cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("camera: {what} is {found}, wanted {wanted}")]
pub struct CameraError {
    /// Which part.
    pub what: &'static str,
    /// What was found.
    pub found: String,
    /// What was wanted.
    pub wanted: &'static str,
}

/// Views that fit a scene. The z axis is up; `Front` looks along +y, as at a patient in LPS.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[expect(missing_docs, reason = "the names say it")]
pub enum View {
    #[default]
    Front,
    Back,
    Left,
    Right,
    Top,
    Bottom,
    /// From in front, the right and above.
    Iso,
}

impl View {
    /// All views with their names.
    pub const ALL: [(&'static str, Self); 7] = [
        ("front", Self::Front),
        ("back", Self::Back),
        ("left", Self::Left),
        ("right", Self::Right),
        ("top", Self::Top),
        ("bottom", Self::Bottom),
        ("iso", Self::Iso),
    ];

    /// The view of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(n, _)| *n == name).map(|(_, v)| *v)
    }

    /// The direction from the scene to the eye, and what is up.
    pub fn axes(self) -> (DVec3, DVec3) {
        match self {
            Self::Front => (-DVec3::Y, DVec3::Z),
            Self::Back => (DVec3::Y, DVec3::Z),
            Self::Left => (-DVec3::X, DVec3::Z),
            Self::Right => (DVec3::X, DVec3::Z),
            Self::Top => (DVec3::Z, DVec3::Y),
            Self::Bottom => (-DVec3::Z, DVec3::Y),
            Self::Iso => (DVec3::new(0.62, -1.0, 0.55).normalize(), DVec3::Z),
        }
    }
}

impl Camera {
    /// A perspective camera without near or far plane.
    pub fn perspective(eye: DVec3, target: DVec3, up: DVec3, fov_y: f64) -> Self {
        let projection = Projection::Perspective { fov_y };
        Self::LookAt { eye, target, up, projection, near: 0.0, far: f64::INFINITY }
    }

    /// An orthographic camera that sees everything before its eye's plane.
    pub fn orthographic(eye: DVec3, target: DVec3, up: DVec3, height: f64) -> Self {
        let projection = Projection::Orthographic { height };
        Self::LookAt { eye, target, up, projection, near: 0.0, far: f64::INFINITY }
    }

    /// A perspective camera (30 degrees) that sees the whole of a world box.
    pub fn fit(bounds: &Aabb, view: View, width: usize, height: usize) -> Self {
        let (towards_eye, up) = view.axes();
        let fov_y: f64 = 30.0;
        let right = up.cross(towards_eye).normalize();
        let true_up = towards_eye.cross(right);
        let half = (fov_y / 2.0).to_radians().tan();
        let aspect = width.max(1) as f64 / height.max(1) as f64;
        let center = bounds.center();
        let size = bounds.size().length();
        // The smallest distance at which every corner lies within 94 % of the picture.
        let mut distance = size * 1e-3;
        for corner in bounds.corners() {
            let p = corner - center;
            let (x, y, z) = (p.dot(right).abs(), p.dot(true_up).abs(), p.dot(towards_eye));
            distance = distance.max(z + (x / aspect).max(y) / (half * 0.94));
        }
        Self::perspective(center + towards_eye * distance, center, true_up, fov_y)
    }

    /// A perspective camera (30 degrees) that sees all of some points, from no farther away than it
    /// must, or than a quarter of their depth; `None` where there are none, or one is not finite.
    pub fn fit_points(points: &[DVec3], view: View, width: usize, height: usize) -> Option<Self> {
        let (towards_eye, up) = view.axes();
        let fov_y: f64 = 30.0;
        let right = up.cross(towards_eye).normalize();
        let true_up = towards_eye.cross(right);
        // Half the width and height at distance 1, less 6 % as a margin.
        let half = (fov_y / 2.0).to_radians().tan() * 0.94;
        let slopes = [half * width.max(1) as f64 / height.max(1) as f64, half];
        let first = *points.first().filter(|_| points.iter().all(|p| p.is_finite()))?;
        // From an eye at (x, y, d) a point is in the picture where |px − x| ≤ slope·(d − pz), and so
        // for y: what matters of all points is the highest px + slope·pz and the lowest px − slope·pz.
        let mut ends = [[f64::NEG_INFINITY, f64::INFINITY]; 2];
        let mut depth = [f64::INFINITY, f64::NEG_INFINITY];
        for p in points.iter().map(|p| *p - first) {
            let z = p.dot(towards_eye);
            for (end, (slope, along)) in ends.iter_mut().zip(slopes.into_iter().zip([right, true_up])) {
                let at = p.dot(along);
                *end = [end[0].max(at + slope * z), end[1].min(at - slope * z)];
            }
            depth = [depth[0].min(z), depth[1].max(z)];
        }
        let needed = |axis: usize| (ends[axis][0] - ends[axis][1]) / (2.0 * slopes[axis]);
        let middle = |axis: usize| (ends[axis][0] + ends[axis][1]) / 2.0;
        let deep = depth[1] - depth[0];
        let distance = needed(0).max(needed(1)).max(depth[1] + 0.25 * deep);
        let target = first + right * middle(0) + true_up * middle(1) + towards_eye * depth[0].midpoint(depth[1]);
        let away = distance - depth[0].midpoint(depth[1]);
        let eye = target + towards_eye * if away > 0.0 { away } else { 1.0 };
        (eye.is_finite() && target.is_finite()).then(|| Self::perspective(eye, target, true_up, fov_y))
    }

    /// Prepares the rays of a picture whose viewport is that many pixels.
    ///
    /// # Errors
    /// If a number is not finite, the eye sits on its target, `up` is parallel to the view, the
    /// field of view or height is out of bounds, near is not below far, or a matrix is singular.
    pub fn rays(&self, viewport: &Viewport) -> Result<RayGrid, CameraError> {
        match *self {
            Self::LookAt { eye, target, up, projection, near, far } => {
                look_at(eye, target, up, projection, [near, far], viewport)
            }
            Self::Matrices { view, projection, depth } => matrices(view, projection, depth, viewport),
        }
    }

    /// World to view space: the eye (or a point of its plane) at the origin, x to the right, y up,
    /// looking along −z.
    ///
    /// # Errors
    /// As [`rays`](Self::rays).
    pub fn world_to_view(&self, viewport: &Viewport) -> Result<DAffine3, CameraError> {
        let grid = self.rays(viewport)?;
        Ok(grid.world_to_view())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::dcamera::rh::proj::directx;
    use proptest::prelude::*;

    fn viewport(width: usize, height: usize) -> Viewport {
        Viewport { x: 0, y: 0, width, height }
    }

    #[test]
    fn row_zero_is_at_the_top_and_x_runs_right() {
        let camera = Camera::perspective(DVec3::new(0.0, -5.0, 0.0), DVec3::ZERO, DVec3::Z, 90.0);
        let rays = camera.rays(&viewport(2, 2)).unwrap();
        let ray = rays.ray(0.5, 0.5);
        assert!(ray.direction.x < 0.0 && ray.direction.z > 0.0);
        let at_plane = ray.at(5.0 / ray.direction.y);
        assert!((at_plane - DVec3::new(-2.5, 0.0, 2.5)).length() < 1e-12);
    }

    #[test]
    fn orthographic_lattice_does_not_depend_on_the_eye() {
        let at = |d: f64| {
            let camera = Camera::orthographic(DVec3::new(1.0, -d, 2.0), DVec3::new(1.0, 0.0, 2.0), DVec3::Z, 4.0);
            camera.rays(&viewport(8, 8)).unwrap().ray(1.5, 2.5)
        };
        let (a, b) = (at(5.0), at(9.0));
        assert!((a.origin - b.origin).length() < 1e-12);
        assert!(a.origin.y.abs() < 1e-12);
        assert_eq!((a.near, b.near), (-5.0, -9.0));
    }

    fn compare(look: Camera, matrices: Camera) -> Result<(), TestCaseError> {
        let view = viewport(37, 23);
        let (a, b) = (look.rays(&view).unwrap(), matrices.rays(&view).unwrap());
        for (x, y) in [(0.5, 0.5), (36.5, 0.5), (12.5, 20.5)] {
            let (p, q) = (a.ray(x, y), b.ray(x, y));
            prop_assert!((p.direction - q.direction).length() < 1e-9, "{p:?} {q:?}");
            prop_assert!((p.origin - q.origin).length() < 1e-6);
            prop_assert!((p.near - q.near).abs() < 1e-6 && (p.far - q.far).abs() < 1e-4 * p.far.abs());
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn matrices_give_the_same_rays_as_look_at(
            eye in prop::array::uniform3(-10.0..10.0f64),
            fov in 5.0..150.0f64,
            ortho in any::<bool>(),
        ) {
            let eye = DVec3::from_array(eye) + DVec3::new(0.0, -20.0, 0.0);
            let (near, far, aspect) = (0.5, 80.0, 37.0 / 23.0);
            let view = glam::dcamera::rh::view::look_at_mat4(eye, DVec3::ZERO, DVec3::Z);
            let height = fov / 5.0;
            let (projection, kind) = if ortho {
                let (w, h) = (height * aspect / 2.0, height / 2.0);
                (directx::orthographic(-w, w, -h, h, near, far), Projection::Orthographic { height })
            } else {
                (directx::perspective(fov.to_radians(), aspect, near, far), Projection::Perspective { fov_y: fov })
            };
            let look = Camera::LookAt { eye, target: DVec3::ZERO, up: DVec3::Z, projection: kind, near, far };
            compare(look, Camera::Matrices { view, projection, depth: DepthRange::ZeroToOne })?;
        }

        #[test]
        fn fit_sees_every_corner(
            min in prop::array::uniform3(-10.0..10.0f64),
            size in prop::array::uniform3(0.1..30.0f64),
            view in 0usize..7,
            width in 20usize..200,
        ) {
            let min = DVec3::from_array(min);
            let bounds = Aabb::new(min, min + DVec3::from_array(size));
            let camera = Camera::fit(&bounds, View::ALL[view].1, width, 64);
            let rays = camera.rays(&viewport(width, 64)).unwrap();
            let to_view = rays.world_to_view();
            let corner = rays.ray(0.0, 0.0).direction;
            let limit = to_view.transform_vector3(corner);
            for c in bounds.corners() {
                let p = to_view.transform_point3(c);
                prop_assert!(p.z < 0.0);
                prop_assert!((p.x / p.z).abs() <= (limit.x / limit.z).abs());
                prop_assert!((p.y / p.z).abs() <= (limit.y / limit.z).abs());
            }
        }
    }

    proptest! {
        #[test]
        fn fitted_points_are_seen_and_touch_the_margin(
            points in prop::collection::vec(prop::array::uniform3(-10.0..10.0f64), 2..30),
            far in -1e6..1e6f64,
            view in 0usize..7,
            width in 20usize..200,
        ) {
            let points: Vec<DVec3> = points.into_iter().map(|p| DVec3::from_array(p) + far).collect();
            let camera = Camera::fit_points(&points, View::ALL[view].1, width, 64).unwrap();
            let rays = camera.rays(&viewport(width, 64)).unwrap();
            let to_view = rays.world_to_view();
            let limit = to_view.transform_vector3(rays.ray(0.0, 0.0).direction);
            let place = |c: &DVec3| {
                let p = to_view.transform_point3(*c);
                assert!(p.z < 0.0);
                let [x, y] = [(p.x / p.z / (limit.x / limit.z)).abs(), (p.y / p.z / (limit.y / limit.z)).abs()];
                x.max(y)
            };
            let outermost = points.iter().map(place).fold(0.0, f64::max);
            let z = points.iter().map(|p| -to_view.transform_point3(*p).z);
            let [near, far] = z.fold([f64::INFINITY, 0.0], |[a, b], z| [a.min(z), b.max(z)]);
            prop_assert!(outermost < 0.94 + 1e-6, "{outermost}");
            prop_assert!(outermost > 0.94 - 1e-6 || near < 0.2501 * (far - near), "{outermost} {near} {far}");
        }
    }

    #[test]
    fn a_point_alone_is_seen_from_somewhere() {
        let camera = Camera::fit_points(&[DVec3::splat(3.0)], View::Iso, 8, 8).unwrap();
        assert!(camera.rays(&viewport(8, 8)).is_ok());
        assert!(Camera::fit_points(&[], View::Iso, 8, 8).is_none());
        assert!(Camera::fit_points(&[DVec3::ONE, DVec3::NAN], View::Iso, 8, 8).is_none());
    }

    #[test]
    fn bad_cameras_are_refused() {
        let bad = |camera: Camera| camera.rays(&viewport(4, 4)).unwrap_err().to_string();
        let (eye, target) = (DVec3::Y, DVec3::ZERO);
        assert!(bad(Camera::perspective(eye, eye, DVec3::Z, 30.0)).contains("a point off the eye"));
        assert!(bad(Camera::perspective(eye, target, DVec3::Y, 30.0)).contains("up is"));
        assert!(bad(Camera::perspective(eye, target, DVec3::Z, 180.0)).contains("field of view is 180"));
        assert!(bad(Camera::orthographic(eye, target, DVec3::Z, 0.0)).contains("height is 0"));
        let zero = Camera::Matrices { view: DMat4::IDENTITY, projection: DMat4::ZERO, depth: DepthRange::default() };
        assert!(bad(zero).contains("singular"));
    }
}
