//! Numbers of vertices as rows.

use volact_core::{Attribute, ParameterValue, resolve::ResolvedShape};

use super::Row;

/// Numbers beyond that are as good as infinite: products of them are.
const LARGEST: f64 = 1e37;

/// An attribute's numbers.
#[derive(Debug)]
pub struct Numbers {
    /// The parameter that it is of.
    pub parameter: String,
    value: ParameterValue,
    component: usize,
    /// The first four numbers of each vertex, then those that are read, four a row.
    rows: Vec<Row>,
    vertices: usize,
    first: u32,
}

impl Numbers {
    fn new(parameter: &str, value: &ParameterValue, attribute: &Attribute, component: usize, vertices: usize) -> Self {
        let number = |v: usize, c: usize| single(attribute.value(v, c));
        let four = |v: usize| [0, 1, 2, 3].map(|c| if c < attribute.components { number(v, c) } else { 0 });
        let mut rows: Vec<Row> = (0..vertices).map(four).collect();
        let read = |i: usize| [0, 1, 2, 3].map(|k| if 4 * i + k < vertices { number(4 * i + k, component) } else { 0 });
        rows.extend((0..vertices.div_ceil(4)).map(read));
        Self { parameter: parameter.into(), value: value.clone(), component, rows, vertices, first: 0 }
    }

    /// Puts them behind other rows.
    pub fn lay(&mut self, rows: &mut Vec<Row>) {
        self.first = rows.len() as u32;
        rows.extend_from_slice(&self.rows);
    }

    /// Where they lie: first numbers, those that are read, and that there are any.
    pub fn row(&self) -> Row {
        [self.first, self.first + self.vertices as u32, 1, 0]
    }
}

fn single(v: f64) -> u32 {
    // NaN stays what it is.
    (v.clamp(-LARGEST, LARGEST) as f32).to_bits()
}

/// Packs the attributes of a shape that have changed; gives their bytes.
pub fn update(held: &mut Vec<Numbers>, shape: &ResolvedShape, vertices: usize) -> usize {
    let component = shape.int("component").and_then(|c| usize::try_from(c).ok()).unwrap_or(0);
    let mut known = std::mem::take(held);
    let mut bytes = 0;
    for (name, value) in &shape.parameters {
        let ParameterValue::Attribute(attribute) = value else { continue };
        let same = |n: &Numbers| {
            n.parameter == *name && n.value == *value && n.component == component && n.vertices == vertices
        };
        match known.iter().position(same) {
            Some(i) => held.push(known.swap_remove(i)),
            None => {
                let made = Numbers::new(name, value, attribute, component, vertices);
                bytes += size_of_val::<[Row]>(&made.rows);
                held.push(made);
            }
        }
    }
    // One fewer lies otherwise, too.
    bytes + known.iter().map(|n| size_of_val::<[Row]>(&n.rows)).sum::<usize>()
}
