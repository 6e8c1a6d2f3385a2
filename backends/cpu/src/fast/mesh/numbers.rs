//! What a shape shows of its vertices' numbers, made anew when numbers, table or unit change.

use volact_core::{Attribute, glam::DVec3, resolve::ResolvedShape};

use super::{exact::Look, table::Table};

/// What the table of a shape's numbers depends on.
#[derive(Clone, Debug, PartialEq)]
struct Key {
    scalars: Attribute,
    component: usize,
    table: u64,
    unit: f64,
    /// World size: what can be seen at all along the longest way.
    size: DVec3,
}

/// The numbers of a mesh's vertices, and their look.
#[derive(Debug)]
pub struct Numbers {
    key: Key,
    /// What stretches add.
    pub table: Table,
    /// The numbers, as the table counts them.
    pub numbers: Vec<f32>,
}

impl Numbers {
    /// Those of a resolved shape; `None` where opacity is that of other numbers or another table,
    /// or there are no numbers. `last` is kept where it is the same, else `anew` set.
    pub fn new(shape: &ResolvedShape, last: Option<Self>, anew: &mut bool) -> Option<Self> {
        let mixed = shape.attribute("opacity_scalars").is_some() || shape.table("opacity_table").is_some();
        let scalars = shape.attribute("scalars").filter(|_| !mixed)?;
        let (table, unit) = (shape.table("lookup_table")?, shape.float("unit_distance")?);
        let component = shape.int("component").unwrap_or(0) as usize;
        let size = shape.state.world_bounds().size();
        let key = Key { scalars: scalars.clone(), component, table: table.id(), unit, size };
        *anew = last.as_ref().is_none_or(|l| l.key != key);
        if !*anew {
            return last;
        }
        let values: Vec<f64> = (0..scalars.len()).map(|v| scalars.value(v, component)).collect();
        let range = scalars.range(component).unwrap_or([0.0, 1.0]);
        let mut known: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
        let middle = known.len() / 2;
        let middle = if known.is_empty() { 0.0 } else { *known.select_nth_unstable_by(middle, f64::total_cmp).1 };
        let look = Look::new(&table.resolve(range), None, unit);
        let table = Table::new(look, range, middle, size.length());
        let numbers = values.iter().map(|&v| table.number(v)).collect();
        Some(Self { key, table, numbers })
    }

    /// Bytes held.
    pub fn bytes(&self) -> usize {
        self.table.bytes() + size_of_val(self.numbers.as_slice())
    }
}
