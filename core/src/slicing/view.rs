//! From world space to pixels: the inverse of a [`RayGrid`].

use glam::{DMat3, DVec2, DVec3};

use crate::{RayGrid, Viewport};

/// Maps points of the world to pixel coordinates of the viewport, and tells how rays run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelMap {
    /// World directions to homogeneous pixels, or to pixels and depth where rays are parallel.
    matrix: DMat3,
    origin: DVec3,
    perspective: bool,
    /// Columns and rows of the viewport.
    size: DVec2,
    /// The least cosine between a ray and the view axis.
    least_cosine: f64,
}

impl PixelMap {
    /// The map of a picture's rays; `None` where the rays do not span space.
    pub fn new(rays: &RayGrid, viewport: &Viewport) -> Option<Self> {
        let linear = rays.linear();
        let (third, origin) = match linear.eye {
            Some(eye) => (linear.corner, eye),
            None => (linear.direction, linear.corner),
        };
        let matrix = DMat3::from_cols(linear.dx, linear.dy, third).inverse();
        let size = DVec2::new(viewport.width as f64, viewport.height as f64);
        let corners = [DVec2::ZERO, DVec2::new(size.x, 0.0), DVec2::new(0.0, size.y), size];
        let cosine = |c: &DVec2| rays.ray(c.x, c.y).direction.dot(linear.axis);
        let least_cosine = corners.iter().map(cosine).fold(1.0, f64::min);
        matrix.is_finite().then_some(Self { matrix, origin, perspective: linear.eye.is_some(), size, least_cosine })
    }

    /// A point as `(x·w, y·w, w)` of its pixel coordinates in the viewport. In front of the eye `w` is
    /// positive; for parallel rays it is 1.
    pub fn homogeneous(&self, point: DVec3) -> DVec3 {
        let p = self.matrix * (point - self.origin);
        if self.perspective { p } else { p.with_z(1.0) }
    }

    /// A point's pixel coordinates; `None` where it lies beside or behind the eye.
    pub fn pixel(&self, point: DVec3) -> Option<DVec2> {
        let p = self.homogeneous(point);
        let pixel = p.truncate() / p.z;
        (p.z > 0.0 && pixel.is_finite()).then_some(pixel)
    }

    /// The matrix and the origin of [`homogeneous`](Self::homogeneous): `matrix·(p − origin)`, of
    /// which the last part is to be 1 where rays are parallel.
    pub fn parts(&self) -> (DMat3, DVec3) {
        (self.matrix, self.origin)
    }

    /// Columns and rows of the viewport.
    pub fn size(&self) -> DVec2 {
        self.size
    }

    /// The least cosine between a ray of the picture and the view axis.
    pub fn least_cosine(&self) -> f64 {
        self.least_cosine
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Camera;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn points_of_a_ray_lie_on_its_pixel(
            eye in prop::array::uniform3(-5.0..5.0f64), x in 0.0..40.0f64, y in 0.0..30.0f64, t in 0.1..50.0f64,
            parallel in any::<bool>(),
        ) {
            let eye = DVec3::from(eye) - DVec3::Y * 20.0;
            let camera = if parallel {
                Camera::orthographic(eye, DVec3::ZERO, DVec3::Z, 7.0)
            } else {
                Camera::perspective(eye, DVec3::ZERO, DVec3::Z, 50.0)
            };
            let viewport = Viewport { x: 3, y: 5, width: 40, height: 30 };
            let rays = camera.rays(&viewport).unwrap();
            let map = PixelMap::new(&rays, &viewport).unwrap();
            let point = rays.ray(x, y).at(t);
            prop_assert!((map.pixel(point).unwrap() - DVec2::new(x, y)).length() < 1e-9);
            let behind = eye - (point - eye);
            prop_assert_eq!(map.pixel(behind).is_some(), parallel);
        }
    }
}
