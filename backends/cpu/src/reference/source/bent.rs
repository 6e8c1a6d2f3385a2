//! Volumes that are read elsewhere than where they are asked for.

use volact_core::glam::{DAffine3, DVec3};
use volact_shaders::{Environment, eval::Function, plain::Plain, signatures::Derived};

/// What a program asks for where a mesh deforms the volumes that it carries: every position goes
/// through the tetrahedron's map to texture coordinates and from there to where the volume lies.
pub(super) struct Bent<'p> {
    plain: &'p mut Plain,
    functions: &'p [Function],
    unbent: &'p [Option<DAffine3>],
    /// From local space to texture coordinates.
    map: DAffine3,
    rows: [Vec<f64>; 3],
}

impl<'p> Bent<'p> {
    /// A plain environment seen through a map.
    pub fn new(plain: &'p mut Plain, functions: &'p [Function], unbent: &'p [Option<DAffine3>], map: DAffine3) -> Self {
        Self { plain, functions, unbent, map, rows: Default::default() }
    }
}

impl Environment<f64> for Bent<'_> {
    fn call(&mut self, function: usize, arguments: &[&[f64]], results: &mut [&mut [f64]], live: Option<&[u32]>) {
        let Function { parameter, derived } = self.functions[function];
        let (Some(Some(unbent)), [x, y, z]) = (self.unbent.get(parameter), arguments) else {
            return self.plain.call(function, arguments, results, live);
        };
        let map = *unbent * self.map;
        self.rows.iter_mut().for_each(Vec::clear);
        for ((x, y), z) in x.iter().zip(*y).zip(*z) {
            let p = map.transform_point3(DVec3::new(*x, *y, *z));
            self.rows.iter_mut().zip(p.to_array()).for_each(|(row, v)| row.push(v));
        }
        let rows = self.rows.each_ref().map(Vec::as_slice);
        if derived != Derived::Gradient {
            return self.plain.call(function, &rows, results, live);
        }
        // All three, whichever are wanted: each depends on all.
        let mut slopes: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; rows[0].len()]);
        let mut made = slopes.each_mut().map(Vec::as_mut_slice);
        self.plain.call(function, &rows, &mut made, live);
        let [along_x, along_y, along_z] = &slopes;
        for (i, ((x, y), z)) in along_x.iter().zip(along_y).zip(along_z).enumerate() {
            let slope = map.matrix3.transpose() * DVec3::new(*x, *y, *z);
            for (row, v) in results.iter_mut().zip(slope.to_array()) {
                if let Some(place) = row.get_mut(i) {
                    *place = v;
                }
            }
        }
    }
}
