//! Surfaces: opaque triangles, lit from both sides.
//!
//! rgb × (ambient + (1 − ambient)·|n·l|), with the normal n of the triangle or, interpolated, of
//! its vertices (B. T. Phong, *Illumination for computer generated pictures*, 1975), carried to
//! the world by the inverse transpose, and l to the light.
//!
//! # Every edge once
//! Triangles are met as the faces of tetrahedra are ([`tetra`](super::tetra)): a ray through an
//! edge or a vertex is taken as moved aside by next to nothing, so that of the triangles around it
//! one is hit, whether they share vertices or only their places. Which one is arbitrary. So all
//! ways of moving it aside are looked at: where each of them hits, the surface is there for sure,
//! in the colour of any triangle that was hit; at a silhouette it may be missed.

use std::cmp::Ordering;

use volact_core::{
    Aabb, ActionError, Bvh, Clip, Geometry, ParameterValue, Surface,
    glam::{DAffine3, DVec3},
    parameter::{ParameterProblem, ProblemKind},
    resolve::ResolvedShape,
};

use super::{
    dd::Dd,
    hit::Hit,
    line::EPS,
    mark::{FINE, Mark, Stretches},
    options::NAME,
    sight::Sight,
    tetra::{LEANS, Lean, Pass, Sheared},
};

/// A surface made ready.
pub(super) struct Prepared {
    /// What identifies the shape.
    pub id: u64,
    surface: Surface,
    tree: Bvh,
    to_object: DAffine3,
    clip: Clip,
    color: [f64; 3],
    ambient: f64,
    /// To the light; along the ray where there is none.
    light: Option<DVec3>,
}

/// A triangle that a ray passes through.
struct Passed {
    triangle: usize,
    pass: Pass,
    mark: Mark,
    /// For which ways of moving the ray aside.
    leans: [bool; LEANS.len()],
}

/// Whether a shape is to be drawn as a surface.
pub(super) fn is_surface(shape: &ResolvedShape) -> bool {
    shape.state.shader == "surface" || shape.state.geometry.as_surface().is_some()
}

/// Refuses what is no surface with a shader for surfaces.
pub(super) fn check(shape: &ResolvedShape) -> Result<(), ActionError> {
    let (shader, geometry) = (shape.state.shader.clone(), &shape.state.geometry);
    let refuse = |what: String, cure: &str| {
        Err(ActionError::Unsupported { action: NAME.into(), shape: shape.name.clone(), what, cure: cure.into() })
    };
    if geometry.as_surface().is_none() {
        let what = format!("shader \"surface\" on the geometry {:?}, which is no surface", geometry.name());
        return refuse(what, "use a surface of triangles, or a shader that draws volume");
    }
    if shader != "surface" {
        let what = format!("shader {shader:?} on the geometry {:?}, which holds no volume", geometry.name());
        return refuse(what, "use the shader surface, or a geometry that holds volume");
    }
    match light(shape) {
        Some(None) => {
            let kind = ProblemKind::Mistyped { found: "without length".into(), wanted: "a direction".into() };
            let problems = vec![ParameterProblem { name: "lightdir".into(), kind }];
            Err(ActionError::Parameters { shape: shape.name.clone(), shader, problems })
        }
        _ => Ok(()),
    }
}

/// The direction to the light, if one is given; `None` in it where it has no length.
fn light(shape: &ResolvedShape) -> Option<Option<DVec3>> {
    match shape.parameters.get("lightdir") {
        Some(ParameterValue::Vec3(v)) => Some(v.try_normalize()),
        _ => None,
    }
}

/// Makes a surface ready that [`check`] has let pass.
pub(super) fn prepare(shape: &ResolvedShape) -> Option<Prepared> {
    let surface = shape.state.geometry.as_surface().filter(|_| shape.state.shader == "surface")?.clone();
    let corners = |t: &[u32; 3]| t.map(|i| surface.points().at(i as usize));
    let around = |t| corners(t).iter().fold(Aabb::EMPTY, |b, &p| b.union(&Aabb::new(p, p)));
    let boxes: Vec<_> = surface.triangles().iter().map(around).collect();
    let color = match shape.parameters.get("color") {
        Some(ParameterValue::Color([r, g, b, _])) => [*r, *g, *b],
        _ => [0.8; 3],
    };
    Some(Prepared {
        id: shape.id,
        tree: Bvh::new(&boxes),
        to_object: shape.to_object,
        clip: shape.state.clip.clone(),
        color,
        ambient: shape.float("ambient").unwrap_or(0.2),
        light: light(shape).flatten(),
        surface,
    })
}

impl Prepared {
    /// The highest number of any colour channel.
    pub fn brightest(&self) -> f64 {
        self.color.iter().fold(0.0, |m, c| m.max(*c))
    }

    /// The hits of a ray, of which `seen` is left, among the stretches that clips keep.
    pub fn hits(&self, ray: &volact_core::Ray, world_clip: &Clip, seen: &Stretches, hits: &mut Vec<Hit>) {
        let bounds = self.surface.bounds();
        let Some(sight) = Sight::new(ray, &self.to_object, bounds.center()) else { return };
        let passed = self.passed(&sight, bounds.size().max_element());
        if passed.is_empty() {
            return;
        }
        let mut left = seen.clone();
        sight.clip(&self.clip, world_clip, &mut left);
        for together in passed.chunk_by(|a, b| a.mark.compare(&b.mark) != Some(Ordering::Less)) {
            let mark = together[0].mark;
            let error = together.iter().map(|p| p.mark.error + (p.mark.from(mark.t.hi)).abs()).fold(0.0, f64::max);
            let same = together.iter().all(|p| p.mark.compare(&mark) == Some(Ordering::Equal));
            let mark = if same { mark } else { Mark { error: 2.0 * error, fine: false, ..mark } };
            let held = left.hold(&mark);
            if held == Some(false) {
                continue;
            }
            let mut color = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
            for [lo, hi] in together.iter().map(|p| self.lit(p, ray.direction)) {
                for (bounds, c) in color.iter_mut().zip(self.color) {
                    *bounds = [bounds[0].min(c * lo), bounds[1].max(c * hi)];
                }
            }
            let hit = Hit::new(mark, color, [1.0; 2]);
            let sure = held == Some(true) && (0..LEANS.len()).all(|i| together.iter().any(|p| p.leans[i]));
            hits.push(if sure { hit } else { hit.doubtful() });
        }
    }

    /// The triangles that a ray passes through, in order.
    fn passed(&self, sight: &Sight, size: f64) -> Vec<Passed> {
        let path = &sight.object;
        let high = |v: [Dd; 3]| DVec3::from_array(v.map(|d| d.hi));
        let mut near = Vec::new();
        self.tree.line(high(path.at), high(path.step), [f64::NEG_INFINITY, f64::INFINITY], |t| near.push(t));
        near.sort_unstable();
        let sheared = Sheared::new(path, size);
        let scale = size / sight.object.step.iter().fold(0.0, |m: f64, d| m.max(d.hi.abs()));
        let mut found: Vec<_> = near.into_iter().filter_map(|t| self.pass(sight, &sheared, scale, t)).collect();
        found.sort_by(|a, b| a.mark.order(&b.mark));
        found
    }

    /// `size` is the surface's extent along the ray.
    fn pass(&self, sight: &Sight, ray: &Sheared, size: f64, triangle: usize) -> Option<Passed> {
        let corners = self.surface.triangles()[triangle].map(|i| ray.corner(self.surface.points().at(i as usize)));
        let mut tie = false;
        let first = ray.meet_triangle(&corners, LEANS[0], &mut tie);
        let again = |lean: Lean| ray.meet_triangle(&corners, lean, &mut false);
        let passes = if tie { LEANS.map(again) } else { [first; LEANS.len()] };
        let pass = passes.into_iter().flatten().next()?;
        let scale = pass.tau.hi.abs() + sight.anchor.abs();
        let error = pass.error + FINE * scale;
        let fine = error <= 1e-20 * (scale + size);
        let mark = Mark { t: Dd::new(sight.anchor).add(pass.tau), error, fine };
        Some(Passed { triangle, pass, mark, leans: passes.map(|p| p.is_some()) })
    }

    /// Bounds on ambient + (1 − ambient)·|n·l|.
    fn lit(&self, passed: &Passed, direction: DVec3) -> [f64; 2] {
        let light = self.light.unwrap_or(direction);
        let smooth = self.smooth(passed).map(|n| cosine(&self.to_object, n, light));
        let [lo, hi] = match smooth {
            Some([lo, hi]) if hi - lo < 1.0 => [lo, hi],
            _ => cosine(&self.to_object, self.flat(passed.triangle), light),
        };
        let part = |cosine: f64| self.ambient + (1.0 - self.ambient) * cosine;
        [part(lo) * (1.0 - 8.0 * EPS), part(hi) * (1.0 + 8.0 * EPS)]
    }

    /// The triangle's normal in object space, with a bound on its error.
    fn flat(&self, triangle: usize) -> (DVec3, f64) {
        let [a, b, c] = self.surface.triangles()[triangle].map(|i| self.surface.points().at(i as usize));
        let edge = |p: DVec3| [0, 1, 2].map(|i| Dd::new(p[i]).add(Dd::new(-a[i])));
        let (u, v) = (edge(b), edge(c));
        let cross = |i: usize, j: usize| u[i].times(v[j]).add(u[j].times(v[i]).negate()).hi;
        let size = |e: &[Dd; 3]| e.iter().map(|d| d.hi.abs()).sum::<f64>();
        let normal = DVec3::new(cross(1, 2), cross(2, 0), cross(0, 1));
        (normal, 2.0 * EPS * normal.length() + FINE * size(&u) * size(&v))
    }

    /// The vertices' normals, interpolated, with a bound on the error; `None` where there is none.
    fn smooth(&self, passed: &Passed) -> Option<(DVec3, f64)> {
        let normals = self.surface.normals()?;
        let corners = self.surface.triangles()[passed.triangle].map(|i| normals.at(i as usize));
        let normal: DVec3 = (0..3).map(|i| corners[i] * passed.pass.weights[i]).sum();
        let size: f64 = corners.iter().map(|n| n.length()).sum();
        let error = (2.0 * passed.pass.loose + 8.0 * EPS) * size;
        (normal.length() > 2.0 * error).then_some((normal, error))
    }
}

/// Bounds on |cos| of the angle between a normal of object space, known to an error, and a
/// direction of world space.
fn cosine(to_object: &DAffine3, (normal, error): (DVec3, f64), direction: DVec3) -> [f64; 2] {
    let inverse = to_object.matrix3.transpose();
    let world = inverse * normal;
    let size = inverse.x_axis.length() + inverse.y_axis.length() + inverse.z_axis.length();
    let off = size * (error + 8.0 * EPS * normal.length()) / world.length() + 16.0 * EPS;
    let found = (world.dot(direction) / (world.length() * direction.length())).abs();
    if off < 1.0 { [(found - 2.0 * off).max(0.0), (found + 2.0 * off).min(1.0)] } else { [0.0, 1.0] }
}
