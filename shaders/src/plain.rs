//! The plain meaning of parameters' functions, one sample at a time in `f64`: what every other
//! [`Environment`] is held to.

use volact_core::{
    LookupTable, ParameterValue, TableInterpolation, VolumeTexture,
    glam::{DAffine3, DVec3},
    table::ResolvedTable,
    volume::{Components, Filter, Roi},
};

use crate::{
    Environment, Kernel, Program,
    eval::{Function, Real, Uniforms},
    signatures::Derived,
};

/// Pieces that a table is cut into between two of its points, for the medium of a segment.
const PIECES: usize = 64;

/// Volumes and tables of a shape.
pub struct Plain {
    functions: Vec<(Derived, Source)>,
}

enum Source {
    Volume(Box<Placed>),
    Table(Classified),
    /// A parameter that was left out and has no meaning by itself.
    Nothing,
}

struct Placed {
    texture: VolumeTexture,
    /// The same data without a region: gradients look beyond the region's edge.
    whole: VolumeTexture,
    nearest: VolumeTexture,
    to_index: DAffine3,
    to_texture: DAffine3,
    component: usize,
}

struct Classified {
    table: ResolvedTable,
    unit: f64,
}

impl Plain {
    /// What a kernel asks for. A table that was left out is an opaque grey ramp over the range of
    /// the shader's first volume. Tables are applied after interpolation; attributes come with the
    /// samples.
    pub fn new<F: Real>(program: &Program, kernel: &Kernel<F>, uniforms: &Uniforms) -> Self {
        let source = |function: &Function| (function.derived, source(program, function, uniforms));
        Self { functions: kernel.functions().iter().map(source).collect() }
    }
}

/// Whether a program with these parameters is all that [`Plain`] knows: tables that apply to
/// voxels are not.
pub fn is_plain(uniforms: &Uniforms) -> bool {
    let post = |value: &ParameterValue| match value {
        ParameterValue::Table(table) => table.interpolation() == TableInterpolation::Post,
        _ => true,
    };
    uniforms.parameters.values().all(post)
}

fn source(program: &Program, function: &Function, uniforms: &Uniforms) -> Source {
    let Some(parameter) = program.declaration().parameters.get(function.parameter) else { return Source::Nothing };
    let value = uniforms.parameters.get(&parameter.name);
    let number = |name: &str| uniforms.parameters.get(name).and_then(ParameterValue::as_float);
    let range = || {
        let names = program.declaration().parameters.iter().map(|p| &p.name);
        let mut volumes = names.filter_map(|name| match uniforms.parameters.get(name) {
            Some(ParameterValue::Volume(texture)) => Some(texture.range()),
            _ => None,
        });
        volumes.next().unwrap_or([0.0, 1.0])
    };
    let of_table =
        matches!(function.derived, Derived::Medium | Derived::TableColor | Derived::Entry | Derived::Segment);
    match value {
        Some(ParameterValue::Volume(texture)) => {
            let component = number("component").map_or(0, |c| c as usize);
            Source::Volume(Box::new(Placed::new(texture, uniforms, component)))
        }
        Some(ParameterValue::Table(table)) => {
            Source::Table(Classified { table: table.resolve(range()), unit: number("unit_distance").unwrap_or(1.0) })
        }
        None if of_table => {
            let [a, b] = range();
            let table = LookupTable::grey([a.min(b), a.max(b)]).resolve([a, b]);
            Source::Table(Classified { table, unit: number("unit_distance").unwrap_or(1.0) })
        }
        _ => Source::Nothing,
    }
}

impl Placed {
    fn new(texture: &VolumeTexture, uniforms: &Uniforms, component: usize) -> Self {
        let to_object = uniforms.object_to_world.inverse() * DAffine3::from_translation(uniforms.origin);
        let roi = texture.geometry_roi();
        let unit = DAffine3::from_scale(1.0 / (roi.max - roi.min)) * DAffine3::from_translation(-roi.min);
        let whole = texture.clone().with_data_roi(Roi::whole(texture.volume().dims())).unwrap_or(texture.clone());
        Self {
            texture: texture.clone(),
            whole: whole.with_filter(Filter::Linear),
            nearest: texture.clone().with_filter(Filter::Nearest),
            to_index: texture.object_to_index() * to_object,
            to_texture: unit * to_object,
            component: component.min(texture.volume().desc().components - 1),
        }
    }

    fn evaluate(&self, derived: Derived, p: DVec3) -> [f64; 4] {
        let at = self.to_index.transform_point3(p);
        let one = |v: f64| [v, 0.0, 0.0, 0.0];
        let vector = |v: DVec3| [v.x, v.y, v.z, 0.0];
        match derived {
            Derived::Value => one(self.texture.sample(at, self.component)),
            Derived::Nearest => one(self.nearest.sample(at, self.component)),
            Derived::Normalized => one(self.normalized(self.texture.sample(at, self.component))),
            Derived::Components => self.components(at),
            Derived::Color => self.color(at),
            Derived::Gradient => vector(self.gradient(at)),
            Derived::Coordinates => vector(self.to_texture.transform_point3(p)),
            Derived::Inside => {
                let t = self.to_texture.transform_point3(p);
                one(f64::from(u8::from(t.cmpge(DVec3::ZERO).all() && t.cmple(DVec3::ONE).all())))
            }
            _ => [f64::NAN; 4],
        }
    }

    fn normalized(&self, value: f64) -> f64 {
        let [low, high] = self.texture.range();
        (value - low) / (high - low)
    }

    fn components(&self, at: DVec3) -> [f64; 4] {
        let count = self.texture.volume().desc().components;
        std::array::from_fn(|c| if c < count { self.texture.sample(at, c) } else { 0.0 })
    }

    fn color(&self, at: DVec3) -> [f64; 4] {
        let [a, b, c, d] = self.components(at).map(|v| self.normalized(v).clamp(0.0, 1.0));
        match self.texture.meaning() {
            Components::Intensity => [a; 4],
            Components::Luminance => [a, a, a, 1.0],
            Components::LuminanceAlpha => [a, a, a, b],
            Components::Rgb => [a, b, c, 1.0],
            Components::Rgba => [a, b, c, d],
        }
    }

    /// Central differences over one voxel either way, at the edge of the data with the edge's own
    /// value; to world units by the transpose of the map to samples.
    fn gradient(&self, at: DVec3) -> DVec3 {
        let difference = |axis: DVec3| {
            let [after, before] = [1.0, -1.0].map(|sign| self.whole.sample(at + sign * axis, self.component));
            (after - before) / 2.0
        };
        let [x, y, z] = DVec3::AXES.map(difference);
        self.to_index.matrix3.transpose() * DVec3::new(x, y, z)
    }
}

impl Classified {
    fn evaluate(&self, derived: Derived, arguments: &[f64]) -> [f64; 4] {
        let value = arguments.first().copied().unwrap_or(f64::NAN);
        match derived {
            Derived::TableColor => self.table.classify(value),
            Derived::Entry => self.table.entry(value),
            Derived::Medium => self.medium(value),
            Derived::Segment => match *arguments {
                [front, back, length] => self.segment(front, back, length),
                _ => [f64::NAN; 4],
            },
            _ => [f64::NAN; 4],
        }
    }

    /// σ = −ln(1 − a)/unit.
    fn medium(&self, value: f64) -> [f64; 4] {
        let [r, g, b, a] = self.table.classify(value);
        [r, g, b, -(-a).ln_1p() / self.unit]
    }

    /// The uniform medium with the transmittance of the segment and its emitted colour:
    /// C = ∫ T σ c ds and 1 − T over its length, by the midpoint rule on pieces between the table's
    /// points.
    fn segment(&self, front: f64, back: f64, length: f64) -> [f64; 4] {
        let crossed = |v: &f64| (*v - front) * (*v - back) < 0.0;
        let mut cuts: Vec<f64> = self.table.points().iter().map(|p| p.value).filter(crossed).collect();
        cuts.sort_by(f64::total_cmp);
        if front > back {
            cuts.reverse();
        }
        cuts.insert(0, front);
        cuts.push(back);
        let span = back - front;
        let (mut depth, mut color) = (0.0, [0.0; 3]);
        for pair in cuts.windows(2) {
            let part = if span == 0.0 { 1.0 } else { (pair[1] - pair[0]) / span };
            let ds = length * part / PIECES as f64;
            for k in 0..PIECES {
                let value = pair[0] + (pair[1] - pair[0]) * (k as f64 + 0.5) / PIECES as f64;
                let [r, g, b, extinction] = self.medium(value);
                let weight = f64::exp(-depth) * -f64::exp_m1(-extinction * ds);
                (0..3).for_each(|c| color[c] += weight * [r, g, b][c]);
                depth += extinction * ds;
            }
        }
        let opacity = -f64::exp_m1(-depth);
        if opacity == 0.0 {
            return self.medium(front);
        }
        let [r, g, b] = color.map(|c| c / opacity);
        [r, g, b, depth / length]
    }
}

impl<F: Real> Environment<F> for Plain {
    fn call(&mut self, function: usize, arguments: &[&[F]], results: &mut [&mut [F]], live: Option<&[u32]>) {
        let Some((derived, source)) = self.functions.get(function) else { return };
        let samples = results.iter().map(|row| row.len()).max().unwrap_or(0);
        for i in (0..samples).filter(|i| live.is_none_or(|live| live[*i] != 0)) {
            let given: Vec<f64> = arguments.iter().map(|row| row[i].to_f64()).collect();
            let values = match (source, given.as_slice()) {
                (Source::Volume(placed), [x, y, z]) => placed.evaluate(*derived, DVec3::new(*x, *y, *z)),
                (Source::Table(table), given) => table.evaluate(*derived, given),
                _ => [0.0; 4],
            };
            for (row, value) in results.iter_mut().zip(values) {
                if let Some(place) = row.get_mut(i) {
                    *place = F::from_f64(value);
                }
            }
        }
    }
}
