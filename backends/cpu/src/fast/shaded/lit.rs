//! What `gradient` computes, without going through its program's instructions.
//!
//! The same formulas as in `gradient.wgsl`, which says where they come from.
#![expect(unsafe_code, reason = "kernels of a vector unit")]

use volact_core::{ParameterValue, glam::DVec3, resolve::ResolvedShape};

use super::{
    field::{Field, Places, sixteen},
    lookup::Lookup,
};
use crate::fast::{
    packet::Lanes,
    power::power,
    simd::{LANES, Simd},
    walk::ALL,
};

/// A lit table.
#[derive(Debug)]
pub struct Lit<'a> {
    field: Field<'a>,
    table: &'a Lookup,
    light: Light,
    phong: bool,
    ambient: f32,
    diffuse: f32,
    specular: f32,
    shininess: f32,
}

#[derive(Clone, Copy, Debug)]
enum Light {
    /// At the eye.
    Head,
    /// In this direction.
    Directional([f32; 3]),
    /// At this place in local space.
    Positional([f32; 3]),
}

impl<'a> Lit<'a> {
    /// What the parameters of a shape with the shader say; `origin` is that of local space.
    pub fn new(shape: &ResolvedShape, field: Field<'a>, table: &'a Lookup, origin: DVec3) -> Option<Self> {
        let number = |name| shape.float(name).map(|v| v as f32);
        let vector = |name: &str| match shape.parameters.get(name) {
            Some(ParameterValue::Vec3(v)) => Some(*v),
            _ => None,
        };
        let word = |name: &str| match shape.parameters.get(name) {
            Some(ParameterValue::Choice(word)) => Some(word.as_str()),
            _ => None,
        };
        let light = match word("light")? {
            "directional" => Light::Directional(vector("lightdir")?.as_vec3().normalize().to_array()),
            "positional" => Light::Positional((vector("light_position")? - origin).as_vec3().to_array()),
            _ => Light::Head,
        };
        Some(Self {
            field,
            table,
            light,
            phong: word("model")? == "phong",
            ambient: number("ambient")?,
            diffuse: number("diffuse")?,
            specular: number("specular")?,
            shininess: number("shininess")?,
        })
    }
}

#[inline(always)]
unsafe fn dot<S: Simd>(a: [S::F; 3], b: [S::F; 3]) -> S::F {
    // SAFETY: the caller's promise.
    unsafe { S::fma(a[2], b[2], S::fma(a[1], b[1], S::mul(a[0], b[0]))) }
}

#[inline(always)]
unsafe fn times<S: Simd>(a: [S::F; 3], factor: S::F) -> [S::F; 3] {
    // SAFETY: the caller's promise.
    unsafe { [S::mul(a[0], factor), S::mul(a[1], factor), S::mul(a[2], factor)] }
}

/// a + t·b.
#[inline(always)]
unsafe fn plus<S: Simd>(a: [S::F; 3], t: S::F, b: [S::F; 3]) -> [S::F; 3] {
    // SAFETY: the caller's promise.
    unsafe { [S::fma(t, b[0], a[0]), S::fma(t, b[1], a[1]), S::fma(t, b[2], a[2])] }
}

#[inline(always)]
unsafe fn load<S: Simd>(v: [&[f32; LANES]; 3]) -> [S::F; 3] {
    // SAFETY: the caller's promise.
    unsafe { [S::load(v[0]), S::load(v[1]), S::load(v[2])] }
}

impl Lit<'_> {
    /// Colours lit at places, seen along directions.
    #[inline(always)]
    unsafe fn colors<S: Simd>(
        &self,
        colors: [S::F; 3],
        gradient: [S::F; 3],
        place: [S::F; 3],
        direction: [S::F; 3],
    ) -> [S::F; 3] {
        // SAFETY: the caller's promise.
        unsafe {
            let (zero, one) = (S::splat(0.0), S::splat(1.0));
            let minus = S::splat(-1.0);
            let squared = dot::<S>(gradient, gradient);
            let known = S::lt_bits(zero, squared);
            // Turned to the eye.
            let behind = !S::lt_bits(dot::<S>(direction, gradient), zero) & ALL;
            let inverse = S::div(one, S::sqrt(squared));
            let normal = times::<S>(gradient, S::select(behind, S::sub(zero, inverse), inverse));
            let view = times::<S>(direction, minus);
            let to_light = match self.light {
                Light::Head => view,
                Light::Directional([x, y, z]) => [S::splat(x), S::splat(y), S::splat(z)],
                Light::Positional([x, y, z]) => {
                    let from = plus::<S>([S::splat(x), S::splat(y), S::splat(z)], minus, place);
                    times::<S>(from, S::div(one, S::sqrt(dot::<S>(from, from))))
                }
            };
            let cosine = dot::<S>(normal, to_light);
            let bright = S::lt_bits(zero, cosine) & known;
            let mirrored = if let Light::Head = self.light {
                // Light and eye are in one direction.
                if self.phong { S::fma(S::add(cosine, cosine), cosine, minus) } else { cosine }
            } else if self.phong {
                let mirror = plus::<S>(times::<S>(to_light, minus), S::add(cosine, cosine), normal);
                dot::<S>(mirror, view)
            } else {
                let half = plus::<S>(to_light, one, view);
                S::div(dot::<S>(normal, half), S::sqrt(dot::<S>(half, half)))
            };
            let mirrored = power::<S>(S::max(mirrored, zero), self.shininess);
            let ambient = S::splat(self.ambient);
            let even = S::fma(S::splat(self.diffuse), cosine, ambient);
            let mut lit = colors;
            for c in 0..3 {
                let full = S::fma(S::splat(self.specular), mirrored, S::mul(colors[c], even));
                lit[c] = S::select(bright, S::min(full, one), S::mul(colors[c], ambient));
            }
            lit
        }
    }
}

/// Media of rows of samples at values and places, seen by sixteen rays along directions.
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it.
#[inline(always)]
pub unsafe fn lit<S: Simd>(
    lit: &Lit<'_>,
    values: &[f32],
    places: [&[f32]; 3],
    directions: &[Lanes; 3],
    out: &mut [Vec<f32>; 4],
) {
    let [x, y, z] = directions;
    let directions = [x.map(|v| v as f32), y.map(|v| v as f32), z.map(|v| v as f32)];
    for first in (0..values.len()).step_by(LANES) {
        // SAFETY: the caller's promise.
        unsafe {
            let [r, g, b, extinction] = lit.table.medium::<S>(sixteen(values, first));
            let mut colors = [r, g, b];
            // Only what has an extinction is lit, as in the source, whatever is beside it.
            let seen = S::lt_bits(S::splat(0.0), extinction) & ALL;
            if seen != 0 {
                let places = [sixteen(places[0], first), sixteen(places[1], first), sixteen(places[2], first)];
                let mut gradient = [[0f32; LANES]; 3];
                let [gx, gy, gz] = &mut gradient;
                let p: [&[f32]; 3] = [places[0], places[1], places[2]];
                lit.field.gradients(Places { p: &p, maps: &[] }, &mut [gx, gy, gz]);
                let gradient = load::<S>([&gradient[0], &gradient[1], &gradient[2]]);
                let direction = load::<S>([&directions[0], &directions[1], &directions[2]]);
                let lit = lit.colors::<S>(colors, gradient, load::<S>(places), direction);
                colors = [S::select(seen, lit[0], r), S::select(seen, lit[1], g), S::select(seen, lit[2], b)];
            }
            let medium = [colors[0], colors[1], colors[2], extinction];
            for c in 0..4 {
                let row = out[c].get_mut(first..).and_then(<[f32]>::first_chunk_mut::<LANES>);
                if let Some(to) = row {
                    S::store(medium[c], to);
                }
            }
        }
    }
}
