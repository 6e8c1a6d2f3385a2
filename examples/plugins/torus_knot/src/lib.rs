//! The geometry `torus-knot`: a solid tube along a curve that winds `p` times around the axis of a
//! torus and `q` times around its circle.
//!
//! # Computes
//! The curve ((R + r cos qt) cos pt, (R + r cos qt) sin pt, r sin qt) lies on a torus. The torus' normal
//! n = (cos qt cos pt, cos qt sin pt, sin qt) is at right angles to it, as is n × tangent: in these two
//! directions lies the tube's cross-section, a regular polygon. Each of its triangles from one cross-section
//! to the next is a wedge.
//!
//! Texture coordinates wind a volume along the tube: x runs from 0 to 1 over one half of the curve and back
//! over the other, so that it closes without a seam; y and z run over the cross-section.
//!
//! # Parameters
//! `radius` R, `swing` r, `thickness` (the tube's radius), `turns` p, `windings` q, `steps`, `sides`.
//!
//! # Example
//! `Geometry(name: "torus-knot", parameters: {"turns": 2, "windings": 3})`
//!
//! # Limits
//! A tube that is too thick for its bends runs into itself; Volact's report of meshes counts such cells.

use std::{f64::consts::TAU, sync::Arc};

use volact_plugin::{
    Buffer, CellType, CellTypes, Declaration, Geometry, Mesh, ParameterDecl, ParameterType, Points, Registry,
    geometry::GeometryError,
    glam::DVec3,
    parameter::{Kind, ParameterMap, ParameterValue},
    registry::RegisterError,
};

const NAME: &str = "torus-knot";

struct Knot {
    radius: f64,
    swing: f64,
    thickness: f64,
    turns: u32,
    windings: u32,
    steps: u32,
    sides: u32,
}

impl Knot {
    /// Parameters arrive checked against the declaration, defaults filled in.
    fn new(parameters: &ParameterMap) -> Result<Self, GeometryError> {
        let number = |name: &str| parameters.get(name).and_then(ParameterValue::as_float).unwrap_or(f64::NAN);
        let whole = |name: &str| number(name) as u32;
        let knot = Self {
            radius: number("radius"),
            swing: number("swing"),
            thickness: number("thickness"),
            turns: whole("turns"),
            windings: whole("windings"),
            steps: whole("steps"),
            sides: whole("sides"),
        };
        let divisor = common_divisor(knot.turns, knot.windings);
        if divisor != 1 {
            let found = format!("{} and {}", knot.turns, knot.windings);
            return Err(GeometryError::invalid(NAME, "turns and windings", found, "two without a common divisor"));
        }
        Ok(knot)
    }

    /// Point and both directions of the cross-section at a part of the curve.
    fn frame(&self, part: f64) -> [DVec3; 3] {
        let (p, q) = (f64::from(self.turns), f64::from(self.windings));
        let ((sp, cp), (sq, cq)) = ((p * TAU * part).sin_cos(), (q * TAU * part).sin_cos());
        let reach = self.radius + self.swing * cq;
        let point = DVec3::new(reach * cp, reach * sp, self.swing * sq);
        let normal = DVec3::new(cq * cp, cq * sp, sq);
        // The derivative: around the axis, and around the circle.
        let tangent = DVec3::new(-sp, cp, 0.0) * (p * reach) + DVec3::new(-sq * cp, -sq * sp, cq) * (q * self.swing);
        [point, normal, normal.cross(tangent).normalize()]
    }

    /// The tube in wedges; ring by ring the middle, then the rim.
    fn mesh(&self) -> Result<Mesh, GeometryError> {
        let (mut points, mut coordinates, mut cells) = (Vec::new(), Vec::new(), Vec::<u32>::new());
        let ring = self.sides + 1;
        for step in 0..self.steps {
            let part = f64::from(step) / f64::from(self.steps);
            let [middle, normal, binormal] = self.frame(part);
            let along = 1.0 - (1.0 - 2.0 * part).abs();
            points.push(middle);
            coordinates.push(DVec3::new(along, 0.5, 0.5));
            for side in 0..self.sides {
                let (s, c) = (TAU * f64::from(side) / f64::from(self.sides)).sin_cos();
                points.push(middle + self.thickness * (c * normal + s * binormal));
                coordinates.push(DVec3::new(along, 0.5 + 0.5 * c, 0.5 + 0.5 * s));
                let (here, next) = (step * ring, (step + 1) % self.steps * ring);
                let rim = [1 + side, 1 + (side + 1) % self.sides];
                cells.extend([here, here + rim[0], here + rim[1], next, next + rim[0], next + rim[1]]);
            }
        }
        let mesh = Mesh::new(Points::from(points), CellTypes::All(CellType::Wedge), Buffer::from_vec(cells))?;
        mesh.with_texture_coordinates(Points::from(coordinates))
    }
}

fn common_divisor(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { common_divisor(b, a % b) }
}

fn make(parameters: &ParameterMap) -> Result<Arc<dyn Geometry>, GeometryError> {
    Ok(Arc::new(Knot::new(parameters)?.mesh()?))
}

fn declaration() -> Declaration {
    let length = |name: &str, default: f64, text: &str| {
        let length = ParameterDecl::new(name, ParameterType::Float, text).default(default).unit("object units");
        length.bounds(f64::MIN_POSITIVE, f64::MAX)
    };
    let count = |name: &str, default: i64, lowest: f64, highest: f64, text: &str| {
        ParameterDecl::new(name, ParameterType::Int, text).default(default).bounds(lowest, highest)
    };
    Declaration::new(Kind::Geometry, NAME, env!("CARGO_PKG_VERSION"), env!("CARGO_PKG_DESCRIPTION"))
        .with(length("radius", 1.0, "from the torus' axis to the middle of its circle"))
        .with(length("swing", 0.45, "the radius of the torus' circle"))
        .with(length("thickness", 0.2, "the tube's radius"))
        .with(count("turns", 2, 1.0, 64.0, "how often it goes around the axis"))
        .with(count("windings", 3, 1.0, 64.0, "how often it goes around the circle"))
        .with(count("steps", 256, 8.0, 65536.0, "cross-sections along the curve"))
        .with(count("sides", 16, 3.0, 1024.0, "corners of a cross-section"))
}

fn register(registry: &mut Registry) -> Result<(), RegisterError> {
    registry.add_geometry(declaration(), Arc::new(make))
}

volact_plugin::export!(register);
