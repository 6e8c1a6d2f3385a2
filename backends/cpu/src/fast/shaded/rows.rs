//! Rows of sixteen samples, one a ray.

use std::ops::Deref;

use crate::fast::{packet::Lanes, simd::LANES};

/// A sample of each of sixteen rays.
#[derive(Clone, Debug)]
pub struct Row {
    /// What the caller calls it.
    pub number: usize,
    /// Lanes that count. The others are evaluated at the place of one of these.
    pub live: u32,
    /// Where they are on their rays; the first one's for all where there is a `base`.
    t: Lanes,
    /// World lengths that they stand for; the same.
    length: [f32; LANES],
    /// What the compositing made of values; or what a volume says at the samples, in data units.
    pub value: [f32; LANES],
    /// Whether the value is that of the volume that the evaluator was told of.
    pub fetched: bool,
    /// Where all lanes have one `t` and length: a `t` a little before, from which on positions are
    /// made in single precision. It must not depend on what is skipped. Else NaN.
    base: f64,
}

impl Row {
    /// Samples at `t` for lengths, in some lanes.
    pub fn new(number: usize, live: u32, t: Lanes, length: [f32; LANES]) -> Self {
        Self { number, live, t, length, value: [0.0; LANES], fetched: false, base: f64::NAN }
    }

    /// The same with what the compositing made of values.
    pub fn with_value(self, value: [f32; LANES]) -> Self {
        Self { value, ..self }
    }

    /// Where a lane's sample is on its ray.
    pub fn t(&self, lane: usize) -> f64 {
        if self.base.is_nan() { self.t[lane] } else { self.t[0] }
    }

    /// The world length that a lane's sample stands for.
    pub fn length(&self, lane: usize) -> f32 {
        if self.base.is_nan() { self.length[lane] } else { self.length[0] }
    }

    /// The world lengths of all lanes.
    #[inline(always)]
    pub fn lengths(&self) -> [f32; LANES] {
        if self.base.is_nan() { self.length } else { [self.length[0]; LANES] }
    }

    /// See [`lanes`].
    pub fn lanes(&self) -> [usize; LANES] {
        lanes(self.live)
    }
}

/// A function of the lanes, the idle ones like the first live one: nothing may come of where they
/// are, not even an endless loop.
pub fn lanes(live: u32) -> [usize; LANES] {
    let lead = (live.trailing_zeros() as usize).min(LANES - 1);
    std::array::from_fn(|l| if live >> l & 1 == 1 { l } else { lead })
}

/// Rows of a batch. What rows do not need of their slots is left as it was.
#[derive(Debug, Default)]
pub struct Rows {
    slots: Vec<Row>,
    count: usize,
}

impl Rows {
    /// Adds a row.
    pub fn push(&mut self, row: Row) {
        match self.slots.get_mut(self.count) {
            Some(slot) => *slot = row,
            None => self.slots.push(row),
        }
        self.count += 1;
    }

    /// Adds a row of samples that all are at one `t` for one length, with the values of the volume
    /// that the evaluator was told of, where they are known. See [`Row`] for `base`.
    pub fn push_even(
        &mut self,
        (number, live): (usize, u32),
        (t, base): (f64, f64),
        length: f32,
        value: Option<&[f32; LANES]>,
    ) {
        if self.slots.len() == self.count {
            self.slots.push(Row::new(0, 0, [0.0; LANES], [0.0; LANES]));
        }
        let row = &mut self.slots[self.count];
        (row.number, row.live, row.base, row.fetched) = (number, live, base, value.is_some());
        (row.t[0], row.length[0]) = (t, length);
        row.value = value.map_or([0.0; LANES], |value| *value);
        self.count += 1;
    }

    /// Adds rows.
    pub fn extend(&mut self, rows: impl IntoIterator<Item = Row>) {
        rows.into_iter().for_each(|row| self.push(row));
    }

    /// Forgets all rows.
    pub fn clear(&mut self) {
        self.count = 0;
    }
}

impl Deref for Rows {
    type Target = [Row];

    fn deref(&self) -> &[Row] {
        &self.slots[..self.count]
    }
}

/// The positions of rows of samples: `from + along·t`, as far as `shift` of their lengths from their
/// middle.
#[inline(always)]
pub fn places(lines: &[[&Lanes; 2]; 3], rows: &[Row], shift: f64, out: [&mut [f32]; 3]) {
    let [x, y, z] = out;
    let out =
        x.as_chunks_mut::<LANES>().0.iter_mut().zip(y.as_chunks_mut::<LANES>().0).zip(z.as_chunks_mut::<LANES>().0);
    let lines = lines.map(|[from, along]| [*from, *along]);
    let along = lines.map(|[_, along]| along.map(|d| d as f32));
    let (mut base, mut start) = (f64::NAN, [[0f32; LANES]; 3]);
    for (row, ((x, y), z)) in rows.iter().zip(out) {
        // In places of its own, so that the compiler makes vectors of it.
        let mut at = [[0f32; LANES]; 3];
        if row.base.is_nan() {
            for a in 0..3 {
                for l in 0..LANES {
                    let t = row.t[l] + shift * f64::from(row.length[l]);
                    at[a][l] = (lines[a][0][l] + lines[a][1][l] * t) as f32;
                }
            }
        } else {
            if row.base != base {
                base = row.base;
                for a in 0..3 {
                    for l in 0..LANES {
                        start[a][l] = (lines[a][0][l] + lines[a][1][l] * base) as f32;
                    }
                }
            }
            let off = (row.t[0] - base) as f32 + shift as f32 * row.length[0];
            for a in 0..3 {
                for l in 0..LANES {
                    at[a][l] = start[a][l] + along[a][l] * off;
                }
            }
        }
        (*x, *y, *z) = (at[0], at[1], at[2]);
    }
}
