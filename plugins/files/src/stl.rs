//! STL surfaces.
//!
//! # Reads
//! Binary (little-endian, known by its size even where its head says `solid`) and text, of one
//! solid or several, in capitals or not. Corners in the same place become one vertex.
//!
//! # Options
//! None.
//!
//! # Limits
//! The normals in the file are not used: they are those of the triangles, whose corners turn about
//! them. The two bytes that a binary file has for each triangle, in use for colours, are not used.

use std::{collections::HashMap, path::Path, sync::Arc};

use volact_core::{
    Buffer, LoadError, LoadOptions, MeshData, Points, Progress, ScalarType, Surface,
    loader::{Confidence, Probe},
};

use crate::{
    format::{Format, confidence, name_of},
    mesh::{Meter, check_count, finite_points, note},
    numbers::{NumberType, Numbers},
    storage::Storage,
    text::Scanner,
};

/// Bytes before the triangles of a binary file, and of each.
const HEAD: u64 = 84;
const FACET: u64 = 50;

/// The loader.
pub(crate) fn format() -> Format {
    Format::of_meshes("stl", "STL surfaces, binary or text (.stl)", probe, read)
}

fn probe(probe: &Probe<'_>) -> Confidence {
    let lower: Vec<u8> = probe.head.iter().take(1024).map(u8::to_ascii_lowercase).collect();
    let facets = lower.windows(12).any(|w| w == b"facet normal");
    confidence(lower.trim_ascii_start().starts_with(b"solid") && facets, probe, &[".stl"])
}

fn read(
    storage: &Storage,
    path: &Path,
    _options: &LoadOptions,
    progress: &dyn Progress,
) -> Result<MeshData, LoadError> {
    let contents = storage.contents(path)?;
    let bytes = contents.bytes();
    let meter = Meter::new(storage, path, progress, 1)?;
    let name = name_of(path);
    let mut warnings = Vec::new();
    let mut welded = Welded::default();
    let claimed = bytes.get(80..84).map(|n| u64::from(u32::from_le_bytes([n[0], n[1], n[2], n[3]])));
    let stated = claimed.map(|n| HEAD + n * FACET);
    let head = &bytes[..bytes.len().min(1024)];
    let text = head.trim_ascii_start().to_ascii_lowercase().starts_with(b"solid") && !head.contains(&0);
    let kind = if text && stated != Some(bytes.len() as u64) {
        if !facets_of_text(path, bytes, &meter, &mut welded)? {
            warnings.push(note(&name, "the last solid has no end: the file may be cut"));
        }
        ScalarType::F64
    } else {
        let stated = stated.unwrap_or(HEAD);
        if stated > bytes.len() as u64 {
            let what = format!("{} triangles", claimed.unwrap_or(0));
            return Err(LoadError::Truncated { path: path.into(), what, found: bytes.len() as u64, wanted: stated });
        }
        if stated < bytes.len() as u64 {
            let surplus = bytes.len() as u64 - stated;
            warnings.push(note(&name, format!("{surplus} bytes after the triangles are not read")));
        }
        facets_of_bytes(path, &bytes[HEAD as usize..stated as usize], &meter, &mut welded)?;
        ScalarType::F32
    };
    let count = welded.triangles.len() / 3;
    let numbers = Numbers {
        kind: NumberType::Scalar(kind),
        data: match kind {
            ScalarType::F32 => Buffer::from_vec(welded.vertices.iter().map(|v| *v as f32).collect::<Vec<_>>()),
            _ => Buffer::from_vec(welded.vertices),
        },
    };
    let triangles = welded.triangles;
    let owner = |v: usize| {
        let corner = triangles.iter().position(|&t| t as usize == v);
        format!("of triangle {}", corner.unwrap_or(0) / 3)
    };
    let points: Points = finite_points(path, numbers, owner)?;
    if count == 0 {
        return Err(LoadError::invalid(path, "number of triangles", 0, "at least 1"));
    }
    let surface =
        Surface::new(points, Buffer::from_vec(triangles)).map_err(|source| LoadError::geometry(path, source))?;
    let mut meter = meter;
    meter.step()?;
    Ok(MeshData { name, geometry: Arc::new(surface), attributes: Vec::new(), warnings })
}

/// Triangles between vertices, of which those in the same place are one.
#[derive(Default)]
struct Welded {
    places: HashMap<[u64; 3], u32>,
    vertices: Vec<f64>,
    triangles: Vec<u32>,
}

impl Welded {
    fn corner(&mut self, path: &Path, corner: [f64; 3]) -> Result<(), LoadError> {
        check_count(path, "number of vertices", (self.vertices.len() / 3) as u64 + 1)?;
        // Adding zero makes one of both zeros.
        let key = corner.map(|v| (v + 0.0).to_bits());
        let place = *self.places.entry(key).or_insert_with(|| {
            self.vertices.extend(corner);
            (self.vertices.len() / 3 - 1) as u32
        });
        self.triangles.push(place);
        Ok(())
    }
}

fn facets_of_bytes(path: &Path, bytes: &[u8], meter: &Meter<'_>, out: &mut Welded) -> Result<(), LoadError> {
    for (n, facet) in bytes.chunks_exact(FACET as usize).enumerate() {
        // The normal comes first.
        for corner in facet[12..48].chunks_exact(12) {
            let number = |a: usize| {
                f64::from(f32::from_le_bytes([corner[4 * a], corner[4 * a + 1], corner[4 * a + 2], corner[4 * a + 3]]))
            };
            out.corner(path, [number(0), number(1), number(2)])?;
        }
        if n.is_multiple_of(1 << 16) {
            meter.at(n * FACET as usize)?;
        }
    }
    Ok(())
}

/// `facet normal x y z`, `outer loop`, three times `vertex x y z`, `endloop`, `endfacet`, between
/// `solid` and `endsolid`, whose names go to the end of their lines. Gives whether the last solid
/// has its end.
fn facets_of_text(path: &Path, bytes: &[u8], meter: &Meter<'_>, out: &mut Welded) -> Result<bool, LoadError> {
    let mut scan = Scanner::new(path, bytes);
    let (mut facet, mut closed) = (0, false);
    while let Some(word) = lower(&mut scan) {
        match word.as_str() {
            "solid" | "endsolid" => {
                closed = word == "endsolid";
                scan.end_line();
            }
            "facet" => {
                expect(&mut scan, facet, "normal")?;
                let _ = [0; 3].map(|_| scan.word());
                expect(&mut scan, facet, "outer")?;
                expect(&mut scan, facet, "loop")?;
                for _ in 0..3 {
                    expect(&mut scan, facet, "vertex")?;
                    let [x, y, z] = [0; 3].map(|_| coordinate(&mut scan, facet));
                    out.corner(path, [x?, y?, z?])?;
                }
                expect(&mut scan, facet, "endloop")?;
                expect(&mut scan, facet, "endfacet")?;
                facet += 1;
                if facet.is_multiple_of(1 << 16) {
                    meter.at(scan.offset())?;
                }
            }
            other => {
                let found: String = other.chars().take(40).collect();
                let what = format!("word after triangle {}", facet as i64 - 1);
                return Err(LoadError::invalid(path, what, format!("{found:?}"), "facet, solid or endsolid"));
            }
        }
    }
    Ok(closed)
}

fn lower(scan: &mut Scanner<'_>) -> Option<String> {
    scan.word().map(|word| String::from_utf8_lossy(&word[..word.len().min(64)]).to_lowercase())
}

fn expect(scan: &mut Scanner<'_>, facet: usize, wanted: &str) -> Result<(), LoadError> {
    let found = lower(scan);
    if found.as_deref() == Some(wanted) {
        return Ok(());
    }
    let found = found.map_or("the end of the file".into(), |word| format!("{word:?}"));
    Err(LoadError::invalid(scan.path, format!("word in triangle {facet}"), found, wanted))
}

fn coordinate(scan: &mut Scanner<'_>, facet: usize) -> Result<f64, LoadError> {
    let word = lower(scan);
    let number = word.as_deref().and_then(|word| word.parse::<f64>().ok());
    number.ok_or_else(|| {
        let found = word.map_or("the end of the file".into(), |word| format!("{word:?}"));
        LoadError::invalid(scan.path, format!("coordinate of triangle {facet}"), found, "a number")
    })
}
