//! Surfaces: polygons of any number of corners, cut into triangles.

use std::{ops::Range, path::Path};

use volact_core::{Buffer, LoadError, Points, Surface, Warning, glam::DVec3};

use super::{CellLayout, note};
use crate::numbers::Numbers;

/// The most corners of a polygon that is not convex. Cutting one takes time with their cube.
const MOST_CORNERS: usize = 64;

/// Collects the triangles of polygons between vertices.
pub(crate) struct Triangles<'a> {
    path: &'a Path,
    points: &'a Points,
    triangles: Vec<u32>,
    /// Polygons of fewer than three corners.
    thin: usize,
    faces: usize,
}

impl<'a> Triangles<'a> {
    pub(crate) fn new(path: &'a Path, points: &'a Points) -> Self {
        Self { path, points, triangles: Vec::new(), thin: 0, faces: 0 }
    }

    /// Takes a polygon, or a strip of triangles, whose corners count from the first of `vertices`.
    ///
    /// # Errors
    /// If a vertex is not there, or a polygon of very many corners is not convex.
    pub(crate) fn add(
        &mut self,
        corners: impl ExactSizeIterator<Item = Option<i64>>,
        strip: bool,
        vertices: Range<usize>,
    ) -> Result<(), LoadError> {
        let face = self.faces;
        self.faces += 1;
        let count = vertices.len();
        let mut known = Vec::with_capacity(corners.len());
        for corner in corners {
            match corner.and_then(|c| usize::try_from(c).ok()).filter(|&c| c < count) {
                Some(index) => known.push((vertices.start + index) as u32),
                None => {
                    let found = corner.map_or("no whole number".into(), |c| c.to_string());
                    let what = format!("vertex index of face {face}");
                    return Err(LoadError::invalid(self.path, what, found, format!("from 0, below {count}")));
                }
            }
        }
        match known[..] {
            [] | [_] | [_, _] => self.thin += 1,
            [a, b, c] => self.triangles.extend([a, b, c]),
            _ if strip => {
                for (n, t) in known.windows(3).enumerate() {
                    // Every second triangle of a strip is turned.
                    self.triangles.extend(if n % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] });
                }
            }
            _ => self.polygon(face, known)?,
        }
        Ok(())
    }

    /// Takes `count` polygons or strips of VTK's arrays, whose corners are numbers of `vertices`.
    ///
    /// # Errors
    /// As [`add`](Self::add), and if corners are not where the connectivity has them.
    pub(crate) fn add_all(
        &mut self,
        connectivity: &Numbers,
        layout: &CellLayout,
        count: u64,
        strip: bool,
        vertices: Range<usize>,
    ) -> Result<(), LoadError> {
        let mut at = 0;
        for cell in 0..usize::try_from(count).unwrap_or(usize::MAX) {
            let face = self.faces;
            let range = layout.range(self.path, &|| format!("face {face}"), connectivity, cell, &mut at)?;
            self.add(range.map(|i| connectivity.integer(i)), strip, vertices.clone())?;
        }
        Ok(())
    }

    /// The surface of all triangles taken.
    pub(crate) fn finish(self, file: &str, warnings: &mut Vec<Warning>) -> Result<Surface, LoadError> {
        if self.thin > 0 {
            warnings.push(note(file, format!("{} faces of fewer than three corners are left out", self.thin)));
        }
        if self.triangles.is_empty() {
            let what = format!("number of triangles (of {} faces)", self.faces);
            return Err(LoadError::invalid(self.path, what, 0, "at least 1"));
        }
        Surface::new(self.points.clone(), Buffer::from_vec(self.triangles))
            .map_err(|source| LoadError::geometry(self.path, source))
    }

    fn polygon(&mut self, face: usize, corners: Vec<u32>) -> Result<(), LoadError> {
        let flat = flatten(self.points, &corners);
        let n = corners.len();
        let turn = |i: usize| cross(flat[(i + n - 1) % n], flat[i], flat[(i + 1) % n]);
        if (0..n).all(|i| turn(i) >= 0.0) && winds_once(&flat) {
            for i in 1..n - 1 {
                self.triangles.extend([corners[0], corners[i], corners[i + 1]]);
            }
            return Ok(());
        }
        if n > MOST_CORNERS {
            let what = format!("face {face}, of {n} corners and not convex,");
            let cure = format!("cut it into faces of at most {MOST_CORNERS} corners");
            return Err(LoadError::Unsupported { path: self.path.into(), what, cure });
        }
        self.clip_ears(&corners, &flat);
        Ok(())
    }

    /// Cuts off one corner after another that no other corner lies in; where there is none, as in
    /// polygons that cross themselves, the most open one.
    fn clip_ears(&mut self, corners: &[u32], flat: &[[f64; 2]]) {
        let mut left: Vec<usize> = (0..corners.len()).collect();
        while left.len() > 3 {
            let n = left.len();
            let around = |i: usize| [left[(i + n - 1) % n], left[i], left[(i + 1) % n]];
            let area = |i: usize| {
                let [a, b, c] = around(i).map(|k| flat[k]);
                cross(a, b, c)
            };
            let ear = |i: &usize| {
                let triangle = around(*i);
                let [a, b, c] = triangle.map(|k| flat[k]);
                area(*i) > 0.0 && !left.iter().any(|&k| !triangle.contains(&k) && inside(flat[k], a, b, c))
            };
            let widest = |a: &usize, b: &usize| area(*a).total_cmp(&area(*b));
            let at = (0..n).find(ear).or_else(|| (0..n).max_by(widest)).unwrap_or(0);
            self.triangles.extend(around(at).map(|k| corners[k]));
            left.remove(at);
        }
        self.triangles.extend(left.iter().map(|&k| corners[k]));
    }
}

/// A polygon's corners in its own plane, counter-clockwise (M. E. Newell's normal).
fn flatten(points: &Points, corners: &[u32]) -> Vec<[f64; 2]> {
    let at = |i: usize| points.at(corners[i % corners.len()] as usize);
    let origin = at(0);
    let normal: DVec3 = (0..corners.len()).map(|i| (at(i) - origin).cross(at(i + 1) - origin)).sum();
    let size = (0..corners.len()).map(|i| (at(i) - origin).length()).fold(0.0, f64::max).max(f64::MIN_POSITIVE);
    let Some(normal) = (normal / (size * size)).try_normalize() else { return vec![[0.0; 2]; corners.len()] };
    let (u, v) = normal.any_orthonormal_pair();
    (0..corners.len()).map(|i| (at(i) - origin) / size).map(|p| [p.dot(u), p.dot(v)]).collect()
}

fn cross([ax, ay]: [f64; 2], [bx, by]: [f64; 2], [cx, cy]: [f64; 2]) -> f64 {
    (bx - ax) * (cy - by) - (by - ay) * (cx - bx)
}

fn inside(p: [f64; 2], a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> bool {
    cross(a, b, p) >= 0.0 && cross(b, c, p) >= 0.0 && cross(c, a, p) >= 0.0
}

/// Whether the edges of a polygon that turns left everywhere make one whole turn, not several.
fn winds_once(flat: &[[f64; 2]]) -> bool {
    let n = flat.len();
    let up = |i: usize| flat[(i + 1) % n][1] > flat[i % n][1];
    (0..n).filter(|&i| up(i) != up(i + 1)).count() <= 2
}

#[cfg(test)]
mod tests {
    use super::*;

    fn areas(corners: &[[f64; 2]]) -> (f64, usize) {
        let points: Points = corners.iter().map(|[x, y]| DVec3::new(*x, *y, x + 2.0 * y)).collect();
        let mut triangles = Triangles::new(Path::new("p"), &points);
        triangles.add((0..corners.len()).map(|i| Some(i as i64)), false, 0..corners.len()).unwrap();
        let surface = triangles.finish("p", &mut Vec::new()).unwrap();
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|i| corners[i as usize]);
            let area = cross(a, b, c) / 2.0;
            assert!(area >= -1e-12, "{t:?} is turned");
            area
        };
        (surface.triangles().iter().map(area).sum(), surface.triangles().len())
    }

    #[test]
    fn polygons_keep_their_area_whatever_their_shape() {
        let square = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        assert_eq!(areas(&square), (1.0, 2));
        // A fan from the first corner would leave this arrow.
        let arrow = [[0.0, 0.0], [2.0, -1.0], [0.5, 0.0], [2.0, 1.0]];
        assert!((areas(&[arrow[1], arrow[2], arrow[3], arrow[0]]).0 - 0.5).abs() < 1e-12);
        let comb = [
            [0.0, 0.0],
            [5.0, 0.0],
            [5.0, 3.0],
            [4.0, 3.0],
            [4.0, 1.0],
            [3.0, 1.0],
            [3.0, 3.0],
            [2.0, 3.0],
            [2.0, 1.0],
            [1.0, 1.0],
            [1.0, 3.0],
            [0.0, 3.0],
        ];
        for first in 0..comb.len() {
            let mut turned = comb;
            turned.rotate_left(first);
            let (area, count) = areas(&turned);
            assert!((area - 11.0).abs() < 1e-12 && count == 10, "{first}: {area} in {count}");
        }
    }

    #[test]
    fn strips_turn_every_second_triangle() {
        let points: Points = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [1.0, 1.0], [2.0, 0.0]]
            .map(|[x, y]| DVec3::new(x, y, 0.0))
            .into_iter()
            .collect();
        let mut triangles = Triangles::new(Path::new("p"), &points);
        triangles.add((0..5u8).map(|i| Some(i64::from(i))), true, 0..5).unwrap();
        let surface = triangles.finish("p", &mut Vec::new()).unwrap();
        assert_eq!(surface.triangles(), [[0, 1, 2], [2, 1, 3], [2, 3, 4]]);
    }

    #[test]
    fn faces_that_are_none_are_left_out_or_refused() {
        let points: Points = [DVec3::ZERO, DVec3::X, DVec3::Y].into_iter().collect();
        let mut triangles = Triangles::new(Path::new("p"), &points);
        triangles.add([Some(0), Some(1)].into_iter(), false, 0..3).unwrap();
        let error = triangles.add([Some(0), Some(1), Some(3)].into_iter(), false, 0..3).unwrap_err().to_string();
        assert_eq!(error, "p: vertex index of face 1 is 3, wanted from 0, below 3");
        let error = triangles.finish("p", &mut Vec::new()).unwrap_err().to_string();
        assert_eq!(error, "p: number of triangles (of 2 faces) is 0, wanted at least 1");
    }
}
