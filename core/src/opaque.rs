//! What an application has drawn already: opaque colour and depth, taken as input.

use std::sync::Arc;

use glam::{DMat4, DVec3, DVec4};

use crate::{RayGrid, Viewport, camera::DepthRange, frame::FrameError};

/// Opaque pictures of a frame's size, row by row from the top.
///
/// The volume is drawn before, behind and around it: every ray ends at the depth, and the colour
/// lies there. Where the depth is infinite (or the far end of a depth buffer), the colour lies
/// behind everything. Without colour rays end in nothing, for an application that lays the
/// frame over its own picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Opaque {
    /// Premultiplied RGBA.
    pub color: Option<Arc<[[f32; 4]]>>,
    /// How far away it is.
    pub depth: OpaqueDepth,
}

/// How far away each pixel is.
#[derive(Clone, Debug, PartialEq)]
pub enum OpaqueDepth {
    /// World distance along the pixel's ray, counted as a frame's depth is; infinite for nothing.
    Distance(Arc<[f32]>),
    /// A depth buffer.
    Buffer {
        /// Its numbers; at the far end of the range there is nothing.
        values: Arc<[f32]>,
        /// What near and far map to.
        range: DepthRange,
        /// World to clip space, as it was drawn with.
        world_to_clip: DMat4,
    },
}

impl Opaque {
    /// Checks the sizes, the numbers and the projection.
    ///
    /// # Errors
    /// If there are not as many pixels as in the frame, a depth is NaN or negative, a colour is
    /// not finite, or the projection cannot be inverted.
    pub fn validate(&self, width: usize, height: usize) -> Result<(), FrameError> {
        let wrong = |what, found: String, wanted| Err(FrameError::Number { what, found, wanted });
        let values = match &self.depth {
            OpaqueDepth::Distance(values) | OpaqueDepth::Buffer { values, .. } => values,
        };
        let pixels = width * height;
        if values.len() != pixels {
            return wrong("number of opaque depths", values.len().to_string(), "one a pixel of the frame");
        }
        if let Some(color) = self.color.as_ref().filter(|c| c.len() != pixels) {
            return wrong("number of opaque colours", color.len().to_string(), "one a pixel of the frame");
        }
        if let Some(color) = self.color.iter().flat_map(|c| c.iter()).find(|c| !c.iter().all(|v| v.is_finite())) {
            return wrong("opaque colour", format!("{color:?}"), "finite numbers");
        }
        let good = |d: &&f32| match &self.depth {
            OpaqueDepth::Distance(_) => **d >= 0.0,
            OpaqueDepth::Buffer { .. } => d.is_finite(),
        };
        if let Some(depth) = values.iter().find(|d| !good(d)) {
            return wrong("opaque depth", depth.to_string(), "distances of at least 0, or finite depth-buffer values");
        }
        match &self.depth {
            OpaqueDepth::Buffer { world_to_clip, .. } if !world_to_clip.inverse().is_finite() => {
                wrong("projection of the opaque depth", format!("{world_to_clip:?}"), "a matrix that can be inverted")
            }
            _ => Ok(()),
        }
    }

    /// Premultiplied colour of a pixel of the frame.
    pub fn color_at(&self, index: usize) -> [f32; 4] {
        self.color.as_ref().map_or([0.0; 4], |c| c[index])
    }

    /// Where rays end: `t` for each pixel of the viewport, row by row; infinite for nothing.
    /// `frame_width` is the number of columns of the frame.
    pub fn limits(&self, grid: &RayGrid, viewport: &Viewport, frame_width: usize) -> Vec<f64> {
        let inverse = match &self.depth {
            OpaqueDepth::Buffer { world_to_clip, .. } => world_to_clip.inverse(),
            OpaqueDepth::Distance(_) => DMat4::IDENTITY,
        };
        let mut limits = Vec::with_capacity(viewport.width * viewport.height);
        for y in 0..viewport.height {
            for x in 0..viewport.width {
                let at = (viewport.y + y) * frame_width + viewport.x + x;
                let ray = grid.ray(x as f64 + 0.5, y as f64 + 0.5);
                limits.push(match &self.depth {
                    OpaqueDepth::Distance(values) => f64::from(values[at]) + ray.depth_zero,
                    OpaqueDepth::Buffer { values, range, world_to_clip } => {
                        unproject(f64::from(values[at]), *range, world_to_clip, &inverse, &ray)
                    }
                });
            }
        }
        limits
    }
}

/// `t` at which a ray has a depth-buffer value: clip-space z and w are linear in `t`, so that
/// z(t) = depth·w(t) is one equation.
fn unproject(depth: f64, range: DepthRange, to_clip: &DMat4, to_world: &DMat4, ray: &crate::Ray) -> f64 {
    if depth >= 1.0 {
        return f64::INFINITY;
    }
    // Near the scene, so that a distant origin costs no digits.
    let start = {
        let near = if range == DepthRange::ZeroToOne { 0.0 } else { -1.0 };
        let origin = *to_clip * DVec4::from((ray.origin, 1.0));
        let toward = *to_clip * DVec4::from((ray.direction, 0.0));
        let (a, b) = (toward.z - near * toward.w, near * origin.w - origin.z);
        let t = b / a;
        if t.is_finite() { t } else { 0.0 }
    };
    let at = *to_clip * DVec4::from((ray.at(start), 1.0));
    let toward = *to_clip * DVec4::from((ray.direction, 0.0));
    let t = start + (depth * at.w - at.z) / (toward.z - depth * toward.w);
    if t.is_finite() {
        return t;
    }
    // A ray along which depth does not change: the point itself.
    let ndc = at.truncate() / at.w;
    let point = *to_world * DVec4::new(ndc.x, ndc.y, depth, 1.0);
    (DVec3::new(point.x, point.y, point.z) / point.w - ray.origin).dot(ray.direction)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, FrameDesc};
    use glam::dcamera::rh;

    #[test]
    fn depth_buffers_and_distances_mean_the_same() {
        let viewport = Viewport { x: 0, y: 0, width: 8, height: 6 };
        let view = rh::view::look_at_mat4(DVec3::new(2.0, -5.0, 1.0), DVec3::ZERO, DVec3::Z);
        for (projection, range) in [
            (rh::proj::directx::perspective(0.7, 8.0 / 6.0, 0.5, 50.0), DepthRange::ZeroToOne),
            (rh::proj::opengl::perspective(0.7, 8.0 / 6.0, 0.5, 50.0), DepthRange::MinusOneToOne),
            (rh::proj::directx::orthographic(-2.0, 2.0, -1.5, 1.5, 0.1, 20.0), DepthRange::ZeroToOne),
        ] {
            let camera = Camera::Matrices { view, projection, depth: range };
            let grid = camera.rays(&viewport).unwrap();
            let clip = projection * view;
            let (mut buffer, mut wanted) = (Vec::new(), Vec::new());
            for y in 0..6 {
                for x in 0..8 {
                    let ray = grid.ray(f64::from(x) + 0.5, f64::from(y) + 0.5);
                    let t = ray.near + 0.3 * f64::from(x + y) + 0.5;
                    let p = clip * DVec4::from((ray.at(t), 1.0));
                    buffer.push((p.z / p.w) as f32);
                    wanted.push(t);
                }
            }
            let opaque = Opaque {
                color: None,
                depth: OpaqueDepth::Buffer { values: buffer.into(), range, world_to_clip: clip },
            };
            opaque.validate(8, 6).unwrap();
            for (t, wanted) in opaque.limits(&grid, &viewport, 8).into_iter().zip(wanted) {
                assert!((t - wanted).abs() < 1e-3, "{t} {wanted}");
            }
        }
    }

    #[test]
    fn pictures_of_another_size_are_refused() {
        let camera = Camera::perspective(DVec3::ONE, DVec3::ZERO, DVec3::Z, 30.0);
        let opaque = |n: usize, depth: f32| Opaque { color: None, depth: OpaqueDepth::Distance(vec![depth; n].into()) };
        let frame = |opaque| FrameDesc::new(camera, 4, 4).with_opaque(opaque).validate();
        assert!(frame(opaque(16, f32::INFINITY)).is_ok());
        assert!(frame(opaque(15, 1.0)).is_err());
        assert!(frame(opaque(16, f32::NAN)).is_err());
        assert!(frame(opaque(16, -1.0)).is_err());
        let no_colors = Opaque { color: Some(Vec::new().into()), ..opaque(16, 1.0) };
        assert!(frame(no_colors).is_err());
    }
}
