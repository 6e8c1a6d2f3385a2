//! What ends rays: surfaces, and what the application has drawn.

use volact_core::{
    Clip, FrameDesc, Opaque, ParameterValue, RayGrid, Viewport,
    glam::{DAffine3, DVec3},
    mutated,
    resolve::ResolvedShape,
};

use super::{
    packet::{Bundle, Lanes, SIDE, Span},
    part::lane,
    resources::{Prepared, Resources},
    simd::LANES,
    stretches::Stretches,
    surface::{Meeting, Skin},
    sweep::piece::Hit,
};

/// Everything opaque of a picture.
#[derive(Debug)]
pub struct Limits<'a> {
    walls: Vec<Wall<'a>>,
    scene: &'a Clip,
    drawn: Option<Drawn<'a>>,
}

/// A lit surface.
#[derive(Debug)]
struct Wall<'a> {
    skin: &'a Skin,
    clip: &'a Clip,
    to_object: DAffine3,
    color: [f64; 3],
    ambient: f64,
    /// Towards the light; at the eye where there is none.
    light: Option<DVec3>,
}

/// What the application has drawn.
#[derive(Debug)]
struct Drawn<'a> {
    picture: &'a Opaque,
    viewport: Viewport,
    width: usize,
    /// Where it is, by pixel of the viewport.
    limits: Vec<f64>,
}

/// What ends sixteen rays.
#[derive(Clone, Debug)]
pub struct Ends {
    /// Where; infinite for nothing.
    pub t: Lanes,
    /// What is there.
    pub hits: [Vec<Hit>; LANES],
    /// Lanes that end at something.
    pub met: u32,
    /// What lies behind everything.
    pub behind: [[f32; 4]; LANES],
}

impl Default for Ends {
    fn default() -> Self {
        let (t, hits, behind) = ([f64::INFINITY; LANES], Default::default(), [[0.0; 4]; LANES]);
        Self { t, hits, met: 0, behind }
    }
}

impl<'a> Limits<'a> {
    /// The surfaces among the shapes drawn, and the application's picture.
    pub fn new(
        drawn: &[&'a ResolvedShape],
        desc: &'a FrameDesc,
        resources: &'a Resources,
        (grid, viewport): (&RayGrid, Viewport),
    ) -> Self {
        let wall = |shape: &&'a ResolvedShape| {
            let Some(Prepared::Skin(skin)) = resources.prepared(shape) else { return None };
            let color = match shape.parameters.get("color") {
                Some(ParameterValue::Color([r, g, b, _])) => [*r, *g, *b],
                _ => [0.8; 3],
            };
            let light = match shape.parameters.get("lightdir") {
                Some(ParameterValue::Vec3(v)) => v.try_normalize(),
                _ => None,
            };
            let ambient = shape.float("ambient").unwrap_or(0.2);
            Some(Wall { skin, clip: &shape.state.clip, to_object: shape.to_object, color, ambient, light })
        };
        let drawn_before = desc.opaque.as_ref().map(|picture| Drawn {
            picture,
            viewport,
            width: desc.width,
            limits: picture.limits(grid, &viewport, desc.width),
        });
        Self { walls: drawn.iter().filter_map(wall).collect(), scene: &desc.clip, drawn: drawn_before }
    }

    /// Whether there is nothing.
    pub fn is_none(&self) -> bool {
        self.walls.is_empty() && self.drawn.is_none()
    }

    /// What ends the rays of a bundle.
    pub fn find(&self, bundle: &Bundle) -> Ends {
        let mut ends = Ends::default();
        if let Some(drawn) = &self.drawn {
            drawn.find(bundle, &mut ends);
        }
        for wall in &self.walls {
            wall.find(bundle, self.scene, &mut ends);
        }
        ends
    }
}

impl Ends {
    fn add(&mut self, l: usize, t: f64, color: Option<[f64; 4]>) {
        if t > self.t[l] {
            return;
        }
        if t < self.t[l] {
            self.hits[l].clear();
        }
        self.t[l] = t;
        self.met |= u32::from(color.is_some()) << l;
        self.hits[l].extend(color.map(|color| Hit { t, color }));
        // A fixed order, so that sums do not depend on the order of drawing.
        self.hits[l].sort_by(|a, b| {
            let by = |c: usize| a.color[c].total_cmp(&b.color[c]);
            by(0).then(by(1)).then(by(2)).then(by(3))
        });
    }
}

impl Drawn<'_> {
    fn find(&self, bundle: &Bundle, ends: &mut Ends) {
        for l in (0..LANES).filter(|l| bundle.span.active >> l & 1 == 1) {
            let [x, y] = [bundle.pixel[0] + l % SIDE, bundle.pixel[1] + l / SIDE];
            let at = (self.viewport.y + y) * self.width + self.viewport.x + x;
            let color = self.picture.color.as_ref().map(|_| self.picture.color_at(at));
            let t = self.limits[y * self.viewport.width + x];
            if t < f64::INFINITY && mutated!("forgotten_opaque_depth") {
                continue;
            } else if t < f64::INFINITY {
                ends.add(l, t, color.map(|c| c.map(f64::from)));
            } else {
                ends.behind[l] = if mutated!("forgotten_backdrop") { [0.0; 4] } else { color.unwrap_or_default() };
            }
        }
    }
}

impl Wall<'_> {
    fn find(&self, bundle: &Bundle, scene: &Clip, ends: &mut Ends) {
        let rays = bundle.through(&self.to_object);
        // Open ends are made finite, or nothing would be left of them.
        let far = bundle.span.end.map(|t| t.min(f64::MAX / 4.0));
        let near = bundle.span.start.map(|t| t.max(-f64::MAX / 4.0));
        let mut seen = Stretches::one(Span { start: near, end: far, active: bundle.span.active });
        seen.clip(self.clip, &rays);
        seen.clip(scene, &[bundle.origin, bundle.direction]);
        for l in (0..LANES).filter(|l| seen.active() >> l & 1 == 1) {
            let [origin, direction] = lane(&rays, l);
            let span = [near[l], far[l].min(ends.t[l])];
            let keep = |t: f64| seen.holds(l, t);
            if let Some(met) = self.skin.nearest(origin, direction, span, keep) {
                let color = self.lit(&met, bundle.ray(l)[1]);
                ends.add(l, met.t, Some(color));
            }
        }
    }

    fn lit(&self, met: &Meeting, direction: DVec3) -> [f64; 4] {
        // Normals go with the inverse transpose of object to world space.
        let normal = (self.to_object.matrix3.transpose() * met.normal).normalize_or_zero();
        let normal = if mutated!("normals_not_transposed") {
            (self.to_object.matrix3.inverse() * met.normal).normalize_or_zero()
        } else {
            normal
        };
        let light = self.light.unwrap_or(-direction);
        let shade = self.ambient + (1.0 - self.ambient) * normal.dot(light).abs();
        let [r, g, b] = self.color.map(|c| c * shade);
        [r, g, b, 1.0]
    }
}
