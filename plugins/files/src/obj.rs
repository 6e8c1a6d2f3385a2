//! Wavefront OBJ surfaces.
//!
//! # Reads
//! Text: vertices (`v`), normals (`vn`) and faces (`f`) of any number of corners, with indices from
//! 1 on or, negative, from the last backwards; lines continued by a backslash. Where faces have
//! normals, a vertex with several becomes several vertices, and the corners of faces without get
//! their face's. Vertices with colours get an attribute `color`. All objects and groups are one
//! surface.
//!
//! # Options
//! None.
//!
//! # Limits
//! Points, lines and free-form curves and surfaces are left out, with a warning. Texture
//! coordinates and materials are not used.

use std::{
    collections::{BTreeMap, HashMap},
    path::Path,
    sync::Arc,
};

use volact_core::{
    Buffer, LoadError, LoadOptions, MeshData, Points, Progress, ScalarType, Warning,
    glam::DVec3,
    loader::{Confidence, Probe},
};

use crate::{
    format::{Format, confidence, name_of},
    mesh::{Attributes, Meter, Named, Triangles, check_count, finite_points, note},
    numbers::{NumberType, Numbers},
    storage::Storage,
    text::Scanner,
};

const F64: NumberType = NumberType::Scalar(ScalarType::F64);

/// The loader.
pub(crate) fn format() -> Format {
    Format::of_meshes("obj", "Wavefront OBJ surfaces (.obj)", probe, read)
}

/// The format has no mark.
fn probe(probe: &Probe<'_>) -> Confidence {
    if probe.head.contains(&0) { Confidence::No } else { confidence(false, probe, &[".obj"]) }
}

/// A corner of a face: a vertex and its normal, from 0 on.
#[derive(Clone, Copy)]
struct Corner {
    vertex: u32,
    normal: Option<u32>,
}

/// What the lines of a file say.
struct File<'a> {
    path: &'a Path,
    line: usize,
    vertices: Vec<f64>,
    colors: Vec<f64>,
    normals: Vec<f64>,
    corners: Vec<Corner>,
    ends: Vec<usize>,
    left_out: BTreeMap<String, usize>,
}

fn read(
    storage: &Storage,
    path: &Path,
    _options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<MeshData, LoadError> {
    let contents = storage.contents(path)?;
    let mut scan = Scanner::new(path, contents.bytes());
    let mut meter = Meter::new(storage, path, progress, 1)?;
    let mut file = File {
        path,
        line: 0,
        vertices: Vec::new(),
        colors: Vec::new(),
        normals: Vec::new(),
        corners: Vec::new(),
        ends: Vec::new(),
        left_out: BTreeMap::new(),
    };
    while let Some(mut line) = scan.line() {
        file.line += 1;
        let first = file.line;
        while let Some(begun) = line.trim_end().strip_suffix('\\') {
            file.line += 1;
            line = format!("{begun} {}", scan.line().unwrap_or_default());
        }
        file.statement(first, line.split('#').next().unwrap_or_default())?;
        if file.line.is_multiple_of(1 << 16) {
            meter.at(scan.offset())?;
        }
    }
    let made = file.build(name_of(path))?;
    meter.step()?;
    Ok(made)
}

impl File<'_> {
    fn invalid(&self, line: usize, what: &str, found: &str, wanted: &str) -> LoadError {
        let found: String = found.chars().take(60).collect();
        LoadError::invalid(self.path, format!("{what} in line {line}"), format!("{found:?}"), wanted)
    }

    fn statement(&mut self, line: usize, text: &str) -> Result<(), LoadError> {
        let mut words = text.split_whitespace();
        let Some(keyword) = words.next() else { return Ok(()) };
        match keyword {
            "v" => {
                let values = self.numbers(line, "vertex", words)?;
                if values.len() < 3 {
                    return Err(self.invalid(line, "vertex", text, "three numbers"));
                }
                self.vertices.extend(&values[..3]);
                if values.len() >= 6 {
                    self.colors.extend(&values[values.len() - 3..]);
                }
            }
            "vn" => {
                let values = self.numbers(line, "normal", words)?;
                let [x, y, z] = values[..] else { return Err(self.invalid(line, "normal", text, "three numbers")) };
                self.normals.extend([x, y, z]);
            }
            "f" | "fo" => {
                for word in words {
                    let corner = self.corner(line, word)?;
                    self.corners.push(corner);
                }
                self.ends.push(self.corners.len());
            }
            // Names, groups, materials and texture coordinates.
            "vt" | "o" | "g" | "s" | "usemtl" | "mtllib" | "mg" | "lod" | "d_interp" | "c_interp" | "bevel"
            | "shadow_obj" | "trace_obj" | "maplib" | "usemap" => {}
            other => {
                let other: String = other.chars().take(20).collect();
                // What is no OBJ at all has many words.
                let key =
                    if self.left_out.len() < 16 || self.left_out.contains_key(&other) { other } else { "…".into() };
                *self.left_out.entry(key).or_default() += 1;
            }
        }
        Ok(())
    }

    fn numbers<'w>(
        &self,
        line: usize,
        what: &str,
        words: impl Iterator<Item = &'w str>,
    ) -> Result<Vec<f64>, LoadError> {
        words.map(|w| w.parse().map_err(|_| self.invalid(line, what, w, "numbers"))).collect()
    }

    /// `vertex`, `vertex/texture`, `vertex//normal` or `vertex/texture/normal`.
    fn corner(&self, line: usize, word: &str) -> Result<Corner, LoadError> {
        let index = |what: &str, text: &str, count: usize| {
            let number: i64 =
                text.parse().map_err(|_| self.invalid(line, what, word, "whole numbers between slashes"))?;
            let index = if number < 0 { number.saturating_add(count as i64) } else { number.saturating_sub(1) };
            match usize::try_from(index).ok().filter(|&i| i < count) {
                Some(index) => Ok(index as u32),
                None => {
                    let what = format!("{what} of face {} in line {line}", self.ends.len());
                    let wanted = format!("1 to {count}, or -1 to -{count}");
                    Err(LoadError::invalid(self.path, what, number, wanted))
                }
            }
        };
        let mut parts = word.split('/');
        let vertex = index("vertex index", parts.next().unwrap_or_default(), self.vertices.len() / 3)?;
        let normal = parts.nth(1).filter(|text| !text.is_empty());
        let normal = normal.map(|text| index("normal index", text, self.normals.len() / 3)).transpose()?;
        Ok(Corner { vertex, normal })
    }

    fn build(mut self, name: String) -> Result<MeshData, LoadError> {
        let mut warnings = Vec::new();
        if !self.left_out.is_empty() {
            let counts: Vec<_> = self.left_out.iter().map(|(word, n)| format!("{n} {word:?}")).collect();
            warnings.push(note(&name, format!("statements are left out: {}", counts.join(", "))));
        }
        let count = check_count(self.path, "number of vertices", (self.vertices.len() / 3) as u64)?;
        if !self.colors.is_empty() && self.colors.len() != self.vertices.len() {
            warnings.push(note(&name, "colours that only some vertices have are left out"));
        }
        let colors = (self.colors.len() == self.vertices.len()).then(|| std::mem::take(&mut self.colors));
        if self.corners.iter().all(|c| c.normal.is_none()) {
            let corners: Vec<u32> = self.corners.iter().map(|c| c.vertex).collect();
            let vertices = std::mem::take(&mut self.vertices);
            return self.surface(name, vertices, None, colors, &corners, warnings);
        }
        let flat = self.face_normals();
        let mut split = Split { places: HashMap::new(), sources: Vec::new(), normals: Vec::new() };
        let mut corners = Vec::with_capacity(self.corners.len());
        let mut start = 0;
        for (face, &end) in self.ends.iter().enumerate() {
            for corner in &self.corners[start..end] {
                let normal = match corner.normal {
                    Some(n) => (n, std::array::from_fn(|a| self.normals[3 * n as usize + a])),
                    None => (u32::MAX - face as u32, flat[face].to_array()),
                };
                corners.push(split.place(corner.vertex, normal));
            }
            start = end;
        }
        check_count(self.path, "number of vertices with normals", split.sources.len() as u64)?;
        debug_assert!(split.sources.iter().all(|s| (*s as usize) < count));
        let gather = |values: &[f64]| -> Vec<f64> {
            split.sources.iter().flat_map(|&s| values[3 * s as usize..3 * s as usize + 3].to_vec()).collect()
        };
        let (vertices, colors) = (gather(&self.vertices), colors.map(|c| gather(&c)));
        self.surface(name, vertices, Some(split.normals), colors, &corners, warnings)
    }

    /// The normals of all faces (M. E. Newell).
    fn face_normals(&self) -> Vec<DVec3> {
        let at = |c: &Corner| DVec3::from_slice(&self.vertices[3 * c.vertex as usize..]);
        let mut start = 0;
        let normal = |&end: &usize| {
            let corners = &self.corners[start..end];
            start = end;
            let Some(first) = corners.first().map(at) else { return DVec3::ZERO };
            let next = corners.iter().cycle().skip(1);
            let normal: DVec3 = corners.iter().zip(next).map(|(a, b)| (at(a) - first).cross(at(b) - first)).sum();
            normal.normalize_or_zero()
        };
        self.ends.iter().map(normal).collect()
    }

    fn surface(
        &self,
        name: String,
        vertices: Vec<f64>,
        normals: Option<Vec<f64>>,
        colors: Option<Vec<f64>>,
        corners: &[u32],
        mut warnings: Vec<Warning>,
    ) -> Result<MeshData, LoadError> {
        let numbers = |values: Vec<f64>| Numbers { kind: F64, data: Buffer::from_vec(values) };
        let points: Points = finite_points(self.path, numbers(vertices), |_| "of the surface".into())?;
        let mut triangles = Triangles::new(self.path, &points);
        let mut start = 0;
        for &end in &self.ends {
            triangles.add(corners[start..end].iter().map(|c| Some(i64::from(*c))), false, 0..points.len())?;
            start = end;
        }
        let mut surface = triangles.finish(&name, &mut warnings)?;
        if let Some(normals) = normals {
            let normals = finite_points(self.path, numbers(normals), |_| "its normal".into())?;
            let wrong = |source| LoadError::geometry(self.path, source);
            surface = surface.with_normals(normals).map_err(wrong)?;
        }
        let mut attributes = Attributes::new(self.path, &name);
        if let Some(colors) = colors {
            let named = Named { name: "color".into(), components: 3, numbers: numbers(colors) };
            attributes.add(named, points.len(), &mut warnings)?;
        }
        let attributes = attributes.finish();
        Ok(MeshData { name, geometry: Arc::new(surface), attributes, warnings })
    }
}

/// Vertices, one for each normal that a vertex of the file has.
struct Split {
    places: HashMap<(u32, u32), u32>,
    sources: Vec<u32>,
    normals: Vec<f64>,
}

impl Split {
    fn place(&mut self, vertex: u32, (number, normal): (u32, [f64; 3])) -> u32 {
        *self.places.entry((vertex, number)).or_insert_with(|| {
            self.sources.push(vertex);
            self.normals.extend(normal);
            self.sources.len() as u32 - 1
        })
    }
}
