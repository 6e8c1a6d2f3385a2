//! Classification of one position in f64: the plain definition, for what happens once a ray.

use volact_core::{
    Filter, TableInterpolation, VolumeTexture, glam::DVec3, resolve::ResolvedShape, table::ResolvedTable,
    volume::Components,
};

/// How a shape makes colour and opacity of a position.
#[derive(Debug)]
enum Source {
    /// Interpolate, then classify.
    Post(ResolvedTable),
    /// Classify the voxels, then interpolate.
    Pre(ResolvedTable),
    /// The components themselves over the texture's range.
    Components,
}

/// What a volume shows.
#[derive(Debug)]
pub struct Medium<'a> {
    texture: &'a VolumeTexture,
    component: usize,
    source: Source,
}

impl<'a> Medium<'a> {
    /// What a resolved shape shows of its volume.
    pub fn new(shape: &'a ResolvedShape, texture: &'a VolumeTexture) -> Self {
        let range = texture.range();
        let source = match shape.table("lookup_table") {
            Some(table) if table.interpolation() == TableInterpolation::Pre => Source::Pre(table.resolve(range)),
            Some(table) => Source::Post(table.resolve(range)),
            None => Source::Components,
        };
        Self { texture, component: super::resources::component(shape), source }
    }

    /// Straight colour and opacity at sample coordinates; `None` where a NaN has weight.
    pub fn at(&self, at: DVec3) -> Option<[f64; 4]> {
        let rgba = match &self.source {
            Source::Post(table) => {
                let value = self.texture.sample(at, self.component);
                if value.is_nan() { [f64::NAN; 4] } else { table.classify(value) }
            }
            Source::Pre(table) => interpolated(self.texture, at, |voxel| {
                let value = self.texture.volume().value(voxel, self.component);
                if value.is_nan() { [f64::NAN; 4] } else { table.classify(value) }
            }),
            Source::Components => self.components(at),
        };
        rgba.iter().all(|v| !v.is_nan()).then_some(rgba)
    }

    fn components(&self, at: DVec3) -> [f64; 4] {
        let [lo, hi] = self.texture.range();
        let value = |c| ((self.texture.sample(at, c) - lo) / (hi - lo)).clamp(0.0, 1.0);
        match self.texture.meaning() {
            Components::Intensity => [value(0), value(0), value(0), value(0)],
            Components::Luminance => [value(0), value(0), value(0), 1.0],
            Components::LuminanceAlpha => [value(0), value(0), value(0), value(1)],
            Components::Rgb => [value(0), value(1), value(2), 1.0],
            Components::Rgba => [value(0), value(1), value(2), value(3)],
        }
    }
}

/// Trilinear interpolation of what `classify` makes of voxels; NaN where a NaN has weight.
fn interpolated(texture: &VolumeTexture, at: DVec3, classify: impl Fn([usize; 3]) -> [f64; 4]) -> [f64; 4] {
    let roi = texture.data_roi();
    let nearest = texture.filter() == Filter::Nearest;
    let mut cell = [[0usize; 2]; 3];
    let mut f = [0f64; 3];
    for a in 0..3 {
        let x = at[a].clamp(roi.min[a] as f64, roi.max[a] as f64);
        let low = if nearest { (x + 0.5) as usize } else { (x as usize).min(roi.max[a].saturating_sub(1)) };
        let low = low.clamp(roi.min[a], roi.max[a]);
        cell[a] = [low, (low + 1).min(roi.max[a])];
        f[a] = if nearest { 0.0 } else { x - low as f64 };
    }
    let mut out = [0f64; 4];
    for i in 0..8usize {
        let pick = |a: usize| i >> a & 1;
        let weight = (0..3).map(|a| if pick(a) == 1 { f[a] } else { 1.0 - f[a] }).product::<f64>();
        if weight > 0.0 {
            let voxel = classify([cell[0][pick(0)], cell[1][pick(1)], cell[2][pick(2)]]);
            out = std::array::from_fn(|c| out[c] + weight * voxel[c]);
        }
    }
    out
}
