//! Scenes of one ray, and what the tests hold the reference to.

use volact_core::{
    Appearance, Camera, ControlPoint, FrameDesc, LookupTable, Registry, ScalarType, Shape, Volume, VolumeDesc,
    VolumeTexture, glam::DVec3, resolve::ResolvedShape,
};
use volact_cpu::reference::{ReferenceOptions, ReferencePicture, integrate};

/// A volume of f64 voxels with spacing 1.
pub fn volume(dims: [usize; 3], voxels: Vec<f64>) -> Volume {
    Volume::new(VolumeDesc::new(dims, ScalarType::F64, 1), voxels).unwrap()
}

/// A volume whose voxels are a function of their place.
pub fn volume_of(dims: [usize; 3], f: impl Fn([usize; 3]) -> f64) -> Volume {
    let n = dims[0] * dims[1] * dims[2];
    let at = |i: usize| [i % dims[0], i / dims[0] % dims[1], i / (dims[0] * dims[1])];
    volume(dims, (0..n).map(|i| f(at(i))).collect())
}

/// A control point: value, colour, opacity.
pub fn point(value: f64, color: [f64; 3], opacity: f64) -> ControlPoint {
    ControlPoint { value, color, opacity }
}

/// A table of control points.
pub fn table(points: &[ControlPoint]) -> LookupTable {
    LookupTable::from_points(points.to_vec()).unwrap()
}

/// A shape drawn through a table.
pub fn lut(volume: &Volume, table: LookupTable, unit: f64) -> Shape {
    lut_of(&VolumeTexture::new(volume), table, unit)
}

/// A shape of a texture drawn through a table.
pub fn lut_of(texture: &VolumeTexture, table: LookupTable, unit: f64) -> Shape {
    Shape::around_texture(texture, Appearance::new("lut").with("lookup_table", table).with("unit_distance", unit))
}

/// Shapes looked up.
pub fn resolve(shapes: &[Shape]) -> Vec<ResolvedShape> {
    let registry = Registry::with_core();
    shapes.iter().map(|s| ResolvedShape::new(s, registry.shaders()).unwrap()).collect()
}

/// A picture by the certified method.
pub fn picture(shapes: &[Shape], frame: &FrameDesc) -> ReferencePicture {
    integrate(&resolve(shapes), frame, &ReferenceOptions::default()).unwrap()
}

/// A frame of one pixel whose ray goes through two points.
pub fn one_ray(from: DVec3, to: DVec3) -> FrameDesc {
    let up = if (to - from).normalize().z.abs() < 0.9 { DVec3::Z } else { DVec3::X };
    FrameDesc::new(Camera::orthographic(from, to, up, 1e-3), 1, 1)
}

/// A ray along z through (x, y), which begins 3 before the origin.
pub fn along_z(x: f64, y: f64) -> FrameDesc {
    one_ray(DVec3::new(x, y, -3.0), DVec3::new(x, y, 1.0))
}

/// What the frame's one pixel shows must enclose the truth, and be certified.
#[track_caller]
pub fn certify(shapes: &[Shape], frame: &FrameDesc, truth: [f64; 4]) {
    enclose(&picture(shapes, frame), truth, 1e-9, 0.0);
}

/// The one pixel must be no wider than `width` and enclose a truth that is itself off by `error`.
#[track_caller]
pub fn enclose(made: &ReferencePicture, truth: [f64; 4], width: f64, error: f64) {
    let (lower, upper) = (made.lower[0], made.upper[0]);
    for c in 0..4 {
        assert!(upper[c] - lower[c] <= width, "channel {c}: {:e} wide: {lower:?} {upper:?}", upper[c] - lower[c]);
        // 4e-15 for the truth's own rounding.
        let slack = error + 4e-15 * truth[c].abs().max(1.0);
        assert!(
            lower[c] <= truth[c] + slack && truth[c] - slack <= upper[c],
            "channel {c}: {} not in {:?}, off by {:e}",
            truth[c],
            [lower[c], upper[c]],
            truth[c] - 0.5 * (lower[c] + upper[c])
        );
    }
}

/// The definition, integrated on its own: a trilinear cell of corners (x fastest) along the
/// straight line between two points of the unit cube, which is `length` long in the world.
///
/// The line is cut where the scan of a fine grid sees the value change its place in the table or
/// its direction; every piece is mapped by tanh(π/2·sinh u), which flattens what happens at its
/// ends, and integrated by six-point Gauss collocation (order 12) over equal panels of u.
pub fn truth(
    corner: &[f64; 8],
    from: [f64; 3],
    to: [f64; 3],
    length: f64,
    unit: f64,
    points: &[ControlPoint],
) -> [f64; 4] {
    let value = |s: f64| {
        let f = [0, 1, 2].map(|a| from[a] * (1.0 - s) + to[a] * s);
        let weight = |i: usize| (0..3).map(|a| if i >> a & 1 == 1 { f[a] } else { 1.0 - f[a] }).product::<f64>();
        (0..8).map(|i| corner[i] * weight(i)).sum::<f64>()
    };
    let mut light = Truth { transmittance: 1.0, color: [0.0; 3] };
    let cuts = cuts(&value, points);
    for w in cuts.windows(2) {
        let (a, b) = (value(w[0]), value(w[1]));
        let middle = points.partition_point(|p| p.value <= value(0.5 * (w[0] + w[1])));
        if !light.piece(&value, [w[0], w[1]], [a, b], middle, length / unit, points) {
            break;
        }
    }
    let [r, g, b] = light.color;
    [r, g, b, 1.0 - light.transmittance]
}

/// Where the value crosses a control point, and 0 and 1.
fn cuts(value: &impl Fn(f64) -> f64, points: &[ControlPoint]) -> Vec<f64> {
    let place = |s: f64| points.partition_point(|p| p.value <= value(s));
    let steps = 8192;
    let mut cuts = vec![0.0];
    for i in 0..steps {
        let (mut a, b) = (i as f64 / steps as f64, (i + 1) as f64 / steps as f64);
        while place(a) != place(b) {
            let (mut lo, mut hi) = (a, b);
            while hi - lo > 1e-17 && 0.5 * (lo + hi) != lo && 0.5 * (lo + hi) != hi {
                let middle = 0.5 * (lo + hi);
                if place(middle) == place(a) { lo = middle } else { hi = middle }
            }
            cuts.push(hi);
            a = hi;
        }
        // Next to an extremum the value may come near to a pole of the logarithm.
        let h = 1.0 / steps as f64;
        if i > 0 && (value(a + h) - value(a)) * (value(a) - value(a - h)) < 0.0 {
            cuts.push(a);
        }
    }
    cuts.push(1.0);
    cuts.sort_by(f64::total_cmp);
    cuts
}

struct Truth {
    transmittance: f64,
    color: [f64; 3],
}

impl Truth {
    /// One smooth piece; `false` where the ray ends.
    fn piece(
        &mut self,
        value: &impl Fn(f64) -> f64,
        [s0, s1]: [f64; 2],
        ends: [f64; 2],
        place: usize,
        scale: f64,
        points: &[ControlPoint],
    ) -> bool {
        let rgba = |p: &ControlPoint| [p.color[0], p.color[1], p.color[2], p.opacity];
        let (lo, hi) = (points[place.max(1) - 1], points[place.min(points.len() - 1)]);
        // Colour, and 1 − opacity without cancellation.
        let line = |v: f64| {
            let width = hi.value - lo.value;
            let (near, far) = if width > 0.0 { ((hi.value - v) / width, (v - lo.value) / width) } else { (1.0, 0.0) };
            let mix = |a: f64, b: f64| a * near + b * far;
            let (a, b) = (rgba(&lo), rgba(&hi));
            [mix(a[0], b[0]), mix(a[1], b[1]), mix(a[2], b[2]), mix(1.0 - a[3], 1.0 - b[3])]
        };
        if lo.opacity == 1.0 && hi.opacity == 1.0 {
            let start = line(ends[0]);
            (0..3).for_each(|c| self.color[c] += self.transmittance * start[c]);
            self.transmittance = 0.0;
            return false;
        }
        let (nodes, matrix, weights) = collocation();
        let (panels, reach) = (192, 3.7);
        let h = 2.0 * reach / panels as f64;
        for panel in 0..panels {
            let sample = |node: f64| {
                let u = -reach + h * (panel as f64 + node);
                let inner = std::f64::consts::FRAC_PI_2 * u.sinh();
                let s = s0 + (s1 - s0) * 0.5 * (1.0 + inner.tanh());
                let rate = 0.5 * (s1 - s0) * std::f64::consts::FRAC_PI_2 * u.cosh() / inner.cosh().powi(2);
                let [r, g, b, rest] = line(value(s));
                let sigma = if rest > 0.0 { -rest.ln() * scale } else { 0.0 };
                ([r, g, b], sigma * rate * h)
            };
            let at = nodes.map(sample);
            let mut absorbed = [0.0; 3];
            for j in 0..6 {
                let depth: f64 = (0..6).map(|k| matrix[j][k] * at[k].1).sum();
                for (sum, c) in absorbed.iter_mut().zip(at[j].0) {
                    *sum += weights[j] * at[j].1 * (-depth).exp() * c;
                }
            }
            (0..3).for_each(|c| self.color[c] += self.transmittance * absorbed[c]);
            self.transmittance *= (-(0..6).map(|k| weights[k] * at[k].1).sum::<f64>()).exp();
        }
        true
    }
}

/// Gauss's six nodes on 0 to 1, the integrals of their Lagrange polynomials up to each node, and
/// up to 1.
fn collocation() -> ([f64; 6], [[f64; 6]; 6], [f64; 6]) {
    let half = [0.932_469_514_203_152, 0.661_209_386_466_264_5, 0.238_619_186_083_196_9];
    let x = [-half[0], -half[1], -half[2], half[2], half[1], half[0]].map(|v: f64| 0.5 * (1.0 + v));
    let integral = |k: usize, to: f64| {
        // Gauss's own rule on [0, to] integrates the Lagrange polynomial of degree 5 exactly.
        let weight = [0.171_324_492_379_170_3, 0.360_761_573_048_138_6, 0.467_913_934_572_691];
        let weights = [weight[0], weight[1], weight[2], weight[2], weight[1], weight[0]];
        let lagrange = |t: f64| (0..6).filter(|&i| i != k).map(|i| (t - x[i]) / (x[k] - x[i])).product::<f64>();
        (0..6).map(|i| weights[i] * 0.5 * to * lagrange(x[i] * to)).sum::<f64>()
    };
    let matrix = std::array::from_fn(|j| std::array::from_fn(|k| integral(k, x[j])));
    (x, matrix, std::array::from_fn(|k| integral(k, 1.0)))
}
