//! Models of methods that Volact does not have, because they fail: a plain ray caster of one block in f64
//! that makes one mistake on request. It is never taken for true.

use volact_core::{
    Ray, Shape,
    glam::{DAffine3, DVec3},
    lattice::Lattice,
    resolve::ResolvedShape,
    table::ResolvedTable,
};

use super::Missing;
use crate::{
    metrics::Picture,
    rig::{Scene, registry},
};

/// What is done wrongly.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Mistake {
    /// Nothing: to know that all else is right.
    None,
    /// Positions in the world are f32.
    WorldF32,
    /// Stretches of less than a millionth are nothing.
    Small,
    /// What is accumulated is rounded to so many bits of fixed point after each sample.
    Fixed(i32),
    /// What is accumulated is rounded to f16 after each sample.
    Half,
    /// Weights of interpolation have so many bits.
    Weights(i32),
    /// The table is so many entries over the values that it spans.
    Entries(usize),
    /// α = τh, at most 1.
    Linear,
    /// Planes across the view axis, with the same opacity in every pixel.
    NoCosine,
    /// Segments count whole or not at all at the ends of the volume.
    Whole,
    /// So, and they are counted from where a ray enters each part.
    Anew,
    /// The first and last sample lie half a voxel inside, as texel centres do.
    TexelCentres,
    /// Values are rounded to f32, and read on from there.
    ValuesF32,
    /// Values are rounded to f16.
    ValuesF16,
    /// A value that is no number is 0.
    NanIsZero,
    /// Planes across that axis of the data along which the view looks most.
    AxisAligned,
}

/// A ray caster with a mistake.
#[derive(Clone, Copy, Debug)]
pub struct Naive {
    /// World distance of samples; in voxels for planes along an axis of the data.
    pub step: f64,
    /// The mistake.
    pub mistake: Mistake,
}

/// Where samples lie on a ray: number u = offset + rate·t.
#[derive(Clone, Copy)]
struct Numbers {
    offset: f64,
    rate: f64,
}

struct Block<'a> {
    shape: &'a ResolvedShape,
    table: ResolvedTable,
    to_index: DAffine3,
    /// Samples along each axis.
    dims: DVec3,
    unit: f64,
    forward: DVec3,
}

impl Naive {
    /// A picture of the scene's shapes, each laid over those behind: one, or several that are apart.
    ///
    /// # Errors
    /// If a shape or the frame is wrong.
    pub fn draw(&self, scene: &Scene) -> Result<Picture, Missing> {
        let mut picture = vec![[0.0; 4]; scene.desc.width * scene.desc.height];
        for shape in &scene.shapes {
            let back = self.one(shape, scene)?;
            picture.iter_mut().zip(back).for_each(|(front, back)| {
                *front = std::array::from_fn(|c| front[c] + (1.0 - front[3]) * back[c]);
            });
        }
        Ok(picture)
    }

    fn one(&self, shape: &Shape, scene: &Scene) -> Result<Picture, Missing> {
        let wrong = |what: &str| Missing::Refused(format!("the model draws no {what}"));
        let resolved = ResolvedShape::new(shape, registry().shaders()).map_err(|e| Missing::Refused(e.to_string()))?;
        let texture = resolved.volume("volume").ok_or_else(|| wrong("shape without a volume"))?;
        let table = resolved.table("lookup_table").ok_or_else(|| wrong("shape without a table"))?;
        let desc = &scene.desc;
        let rays = desc.camera.rays(&desc.viewport()).map_err(|e| Missing::Refused(e.to_string()))?;
        let block = Block {
            table: self.table(table.resolve(texture.range())),
            to_index: texture.object_to_index() * resolved.to_object,
            dims: DVec3::from_array(texture.data_roi().dims().map(|n| n as f64)),
            unit: resolved.float("unit_distance").unwrap_or(1.0),
            forward: rays.ray(desc.width as f64 / 2.0, desc.height as f64 / 2.0).direction,
            shape: &resolved,
        };
        let pixel = |i: usize| rays.ray((i % desc.width) as f64 + 0.5, (i / desc.width) as f64 + 0.5);
        Ok((0..desc.width * desc.height).map(|i| self.march(&block, &pixel(i))).collect())
    }

    fn table(&self, table: ResolvedTable) -> ResolvedTable {
        let Mistake::Entries(count) = self.mistake else { return table };
        let ends = [0, table.points().len() - 1].map(|i| table.points()[i].value);
        let at = |i: usize| ends[0] + (ends[1] - ends[0]) * i as f64 / (count - 1) as f64;
        let entries: Vec<[f32; 4]> = (0..count).map(|i| table.classify(at(i)).map(|v| v as f32)).collect();
        volact_core::LookupTable::from_entries(entries, Some(ends)).map_or(table, |t| t.resolve(ends))
    }

    fn march(&self, block: &Block<'_>, ray: &Ray) -> [f64; 4] {
        let to_object = &block.shape.to_object;
        let (origin, direction) = (to_object.transform_point3(ray.origin), to_object.transform_vector3(ray.direction));
        let clipped = block.shape.block().and_then(|b| b.clip_line(origin, direction));
        let Some([t0, t1]) = clipped else { return [0.0; 4] };
        let [t0, t1] = [t0.max(ray.near), t1.min(ray.far)];
        if self.mistake == Mistake::Small && t1 - t0 < 1e-6 {
            return [0.0; 4];
        }
        let numbers = self.numbers(block, ray, t0);
        let mut out = [0.0; 4];
        for s in (Lattice { step: 1.0 }).segments(numbers.at(t0), numbers.at(t1)) {
            let whole = matches!(self.mistake, Mistake::Whole | Mistake::Anew);
            let middle = if whole { s.k as f64 + 0.5 } else { s.middle() };
            if whole && !(s.start..s.end).contains(&middle) {
                continue;
            }
            let length = match self.mistake {
                Mistake::Whole | Mistake::Anew => self.step,
                Mistake::NoCosine => s.length() * self.step,
                _ => s.length() / numbers.rate,
            };
            let added = self.classify(block, self.value(block, ray, (middle - numbers.offset) / numbers.rate), length);
            out = std::array::from_fn(|c| self.kept(out[c] + (1.0 - out[3]) * added[c]));
        }
        out
    }

    fn numbers(&self, block: &Block<'_>, ray: &Ray, t0: f64) -> Numbers {
        match self.mistake {
            Mistake::Anew => Numbers { offset: -t0 / self.step, rate: 1.0 / self.step },
            Mistake::NoCosine => Numbers { offset: 0.0, rate: ray.direction.dot(block.forward) / self.step },
            Mistake::AxisAligned => {
                let along = block.to_index.transform_vector3(block.forward).abs();
                let axis = (0..3).max_by(|&a, &b| along[a].total_cmp(&along[b])).unwrap_or(0);
                let rate = block.to_index.transform_vector3(ray.direction)[axis] / self.step;
                let offset = block.to_index.transform_point3(ray.origin)[axis] / self.step + 0.5;
                if rate < 0.0 { Numbers { offset: -offset, rate: -rate } } else { Numbers { offset, rate } }
            }
            _ => Numbers { offset: 0.0, rate: 1.0 / self.step },
        }
    }

    fn value(&self, block: &Block<'_>, ray: &Ray, t: f64) -> f64 {
        let mut at = block.to_index.transform_point3(ray.origin + ray.direction * t);
        match self.mistake {
            Mistake::WorldF32 => {
                let world = ray.origin.as_vec3() + ray.direction.as_vec3() * t as f32;
                let (map, moved) = (block.to_index.matrix3.as_mat3(), block.to_index.translation.as_vec3());
                at = (map * world + moved).as_dvec3();
            }
            Mistake::Weights(bits) => {
                let steps = 2f64.powi(bits);
                at = at.floor() + ((at - at.floor()) * steps).round() / steps;
            }
            Mistake::TexelCentres => at = at / (block.dims - 1.0).max(DVec3::ONE) * block.dims - 0.5,
            _ => {}
        }
        let value = block.shape.volume("volume").map_or(0.0, |v| v.sample(at, 0));
        match self.mistake {
            Mistake::ValuesF32 => f64::from(value as f32),
            Mistake::ValuesF16 => half::f16::from_f64(value).to_f64(),
            Mistake::NanIsZero if value.is_nan() => 0.0,
            _ => value,
        }
    }

    fn classify(&self, block: &Block<'_>, value: f64, length: f64) -> [f64; 4] {
        let [r, g, b, a] = block.table.classify(value);
        let depth = -(-a).ln_1p() * length / block.unit;
        let alpha = if self.mistake == Mistake::Linear { depth.min(1.0) } else { -(-depth).exp_m1() };
        [r * alpha, g * alpha, b * alpha, alpha]
    }

    fn kept(&self, value: f64) -> f64 {
        match self.mistake {
            Mistake::Fixed(bits) => {
                let most = 2f64.powi(bits) - 1.0;
                (value.clamp(0.0, 1.0) * most).round() / most
            }
            Mistake::Half => half::f16::from_f64(value).to_f64(),
            _ => value,
        }
    }
}

impl Numbers {
    fn at(self, t: f64) -> f64 {
        self.offset + self.rate * t
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        cases::stock::{around, shape, through},
        metrics::max_error,
        rig::integrate_with,
    };
    use volact_cpu::reference::{Method, ReferenceOptions};

    #[test]
    fn without_a_mistake_it_is_the_lattice() {
        for scene in [around([shape()]), through([shape()])] {
            let found = Naive { step: 0.3, mistake: Mistake::None }.draw(&scene).unwrap();
            let options = ReferenceOptions { method: Method::Rays, sample_distance: 0.3, ..Default::default() };
            let wanted = integrate_with(&scene.shapes, &scene.desc, &options).color;
            assert!(max_error(&found, &wanted) < 1e-9, "{}", max_error(&found, &wanted));
        }
    }
}
