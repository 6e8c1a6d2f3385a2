//! One component of a volume at places in local space, sixteen at once.
#![expect(unsafe_code, reason = "kernels of a vector unit")]

use volact_core::{
    Roi, VolumeTexture,
    glam::{DAffine3, DVec3, Mat3, Vec3},
};

use crate::fast::{
    classify::Units,
    dispatch,
    fetch::{Base, Fetch, Voxels},
    resources::plain_voxels,
    simd::{LANES, Simd, Unit},
};

/// One component of a volume, in local space.
#[derive(Debug)]
pub struct Field<'a> {
    unit: Unit,
    voxels: Voxels<'a>,
    base: Base,
    /// From local space to samples, relative to the base.
    linear: Mat3,
    offset: Vec3,
    units: Units,
    /// Ends of the data ROI, relative to the base.
    roi: [Vec3; 2],
    /// Ends of the data, relative to the base.
    data: Base,
    whole: Voxels<'a>,
    /// From texture coordinates to samples, relative to the base.
    carried: [Vec3; 2],
}

/// Places of a batch in the data.
#[derive(Clone, Copy, Debug)]
pub struct Places<'p> {
    /// By axis, in local space; a multiple of sixteen.
    pub p: &'p [&'p [f32]],
    /// From there to texture coordinates, where a mesh carries volumes along; one a place.
    pub maps: &'p [DAffine3],
}

impl<'a> Field<'a> {
    /// A component of a texture; `local` maps from local to object space.
    pub fn new(texture: &'a VolumeTexture, component: usize, local: &DAffine3, unit: Unit) -> Self {
        let component = component.min(texture.volume().desc().components - 1);
        let (voxels, units) = plain_voxels(texture, component);
        let to_index = texture.object_to_index() * *local;
        let base = Base::new(&voxels, to_index.translation.to_array());
        let offset = to_index.translation - DVec3::from_array(base.at.map(f64::from));
        let Roi { min, max } = texture.data_roi();
        let relative =
            |v: [usize; 3]| Vec3::from_array([0, 1, 2].map(|a| (v[a] as f64 - f64::from(base.at[a])) as f32));
        let dims = voxels.dims;
        let whole = Voxels { min: [0; 3], max: dims.map(|n| n - 1), nearest: false, ..voxels };
        let data = Base { at: base.at, lo: relative([0; 3]).to_array(), hi: relative(dims.map(|n| n - 1)).to_array() };
        Self {
            unit,
            voxels,
            base,
            linear: to_index.matrix3.as_mat3(),
            offset: offset.as_vec3(),
            units,
            roi: [relative(min), relative(max)],
            data,
            whole,
            carried: [relative(min), relative(max) - relative(min)],
        }
    }

    /// Sixteen positions relative to the base, of those that begin at `first`.
    ///
    /// # Safety
    /// Called from a function compiled for `S` on a machine that has it.
    #[inline(always)]
    unsafe fn at<S: Simd>(&self, places: Places<'_>, first: usize) -> [S::F; 3] {
        // SAFETY: the caller's promise.
        unsafe {
            if !places.maps.is_empty() {
                let at = self.carried_at(places, first);
                return [S::load(&at[0]), S::load(&at[1]), S::load(&at[2])];
            }
            let x = S::load(sixteen(places.p[0], first));
            let y = S::load(sixteen(places.p[1], first));
            let z = S::load(sixteen(places.p[2], first));
            let (m, o) = (self.linear, self.offset);
            let mut at = [x; 3];
            for a in 0..3 {
                let sum = S::fma(S::splat(m.z_axis[a]), z, S::splat(o[a]));
                let sum = S::fma(S::splat(m.y_axis[a]), y, sum);
                at[a] = S::fma(S::splat(m.x_axis[a]), x, sum);
            }
            at
        }
    }

    /// The same where a mesh carries the volume along.
    fn carried_at(&self, places: Places<'_>, first: usize) -> [[f32; LANES]; 3] {
        let mut out = [[0f32; LANES]; 3];
        let p: [&[f32; LANES]; 3] = std::array::from_fn(|a| sixteen(places.p[a], first));
        let [from, size] = self.carried.map(|v| v.as_dvec3());
        for l in 0..LANES {
            let place = DVec3::new(f64::from(p[0][l]), f64::from(p[1][l]), f64::from(p[2][l]));
            let at = from + size * places.maps[first + l].transform_point3(place);
            (0..3).for_each(|a| out[a][l] = at[a] as f32);
        }
        out
    }

    /// The linear part of the map from local space to samples.
    #[inline(always)]
    fn slope(&self, places: Places<'_>, at: usize) -> Mat3 {
        match places.maps.get(at) {
            Some(map) => Mat3::from_diagonal(self.carried[1]) * map.matrix3.as_mat3(),
            None => self.linear,
        }
    }

    /// The same with the nearest sample's value.
    pub fn nearest(mut self) -> Self {
        self.voxels.nearest = true;
        self
    }

    /// Ends of the data's region, relative to the same base as positions.
    pub fn roi(&self) -> [Vec3; 2] {
        self.roi
    }

    /// Values in data units.
    pub fn values(&self, p: Places<'_>, out: &mut [f32]) {
        dispatch::field_values(self.unit, self, p, out);
    }

    /// Gradients of the value in data units a world unit.
    pub fn gradients(&self, p: Places<'_>, out: &mut [&mut [f32]]) {
        dispatch::field_gradients(self.unit, self, p, out);
    }

    /// How voxels are read.
    pub fn voxels(&self) -> &Voxels<'a> {
        &self.voxels
    }

    /// Sixteen positions, as [`at`](Self::at), lane by lane.
    fn by_lane(&self, places: Places<'_>, first: usize) -> [[f32; LANES]; 3] {
        if !places.maps.is_empty() {
            return self.carried_at(places, first);
        }
        let p: [&[f32; LANES]; 3] = std::array::from_fn(|a| sixteen(places.p[a], first));
        let (m, o) = (self.linear, self.offset);
        let number =
            |a: usize, l: usize| m.x_axis[a] * p[0][l] + (m.y_axis[a] * p[1][l] + (m.z_axis[a] * p[2][l] + o[a]));
        std::array::from_fn(|a| std::array::from_fn(|l| number(a, l)))
    }

    /// Something of each position relative to the base.
    pub fn each(&self, p: Places<'_>, n: usize, mut take: impl FnMut(usize, Vec3)) {
        for first in (0..n).step_by(LANES) {
            let at = self.by_lane(p, first);
            (first..n.min(first + LANES)).for_each(|i| take(i, Vec3::from_array([0, 1, 2].map(|a| at[a][i - first]))));
        }
    }
}

/// [`Field::values`].
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it; `F` is the voxels' access.
#[inline(always)]
pub unsafe fn values<S: Simd, F: Fetch>(field: &Field<'_>, p: Places<'_>, out: &mut [f32]) {
    let plain = field.units.are_stored();
    for (i, out) in out.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        // SAFETY: the caller's promises.
        unsafe {
            let at = field.at::<S>(p, i * LANES);
            S::store(F::fetch::<S>(&field.voxels, &field.base, at), out);
        }
        if !plain {
            field.units.apply(out);
        }
    }
}

/// [`Field::gradients`].
///
/// # Safety
/// Called from a function compiled for `S` on a machine that has it.
#[inline(always)]
pub unsafe fn gradients<S: Simd>(field: &Field<'_>, p: Places<'_>, out: &mut [&mut [f32]]) {
    let n = out.iter().map(|row| row.len()).max().unwrap_or(0);
    let half = 0.5 * field.units.scale as f32;
    for first in (0..n).step_by(LANES) {
        let mut at = [[0f32; LANES]; 3];
        // SAFETY: the caller's promise.
        unsafe {
            let inside = field.at::<S>(p, first);
            for a in 0..3 {
                let (low, high) = (S::splat(field.roi[0][a]), S::splat(field.roi[1][a]));
                S::store(S::min(S::max(inside[a], low), high), &mut at[a]);
            }
        }
        // Along each axis of the data, over one voxel either way, up to the data's edge.
        let mut along = [[0f32; LANES]; 3];
        dispatch::slopes(field.unit, &field.whole, &field.data, &at, &mut along);
        for (c, row) in out.iter_mut().enumerate() {
            let Some(row) = row.get_mut(first..).and_then(<[f32]>::first_chunk_mut::<LANES>) else { continue };
            // The transpose of the map to samples.
            if p.maps.is_empty() {
                let column = field.linear.col(c) * half;
                // SAFETY: the caller's promise.
                unsafe {
                    let sum = S::mul(S::splat(column.x), S::load(&along[0]));
                    let sum = S::fma(S::splat(column.y), S::load(&along[1]), sum);
                    S::store(S::fma(S::splat(column.z), S::load(&along[2]), sum), row);
                }
                continue;
            }
            for (l, to) in row.iter_mut().enumerate() {
                let column = field.slope(p, first + l).col(c) * half;
                *to = column.x * along[0][l] + column.y * along[1][l] + column.z * along[2][l];
            }
        }
    }
}

/// Sixteen numbers of a row.
#[inline(always)]
pub fn sixteen(row: &[f32], first: usize) -> &[f32; LANES] {
    const NONE: &[f32; LANES] = &[f32::NAN; LANES];
    row.get(first..).and_then(<[f32]>::first_chunk).unwrap_or(NONE)
}
