//! Writers of every mesh format, which share nothing with the readers.

#![expect(dead_code, reason = "each test file uses a part of this")]

use std::{fmt::Write as _, io::Write as _};

use base64::{Engine, engine::general_purpose::STANDARD};

/// A mesh as a file would have it. Positions and values are `f32`.
#[derive(Clone, Debug, Default)]
pub struct Spec {
    pub points: Vec<[f32; 3]>,
    pub cells: Vec<(u8, Vec<u32>)>,
    /// Name, components and numbers.
    pub attributes: Vec<(String, usize, Vec<f32>)>,
}

/// Two tetrahedra and a wedge, with a scalar and a vector.
pub fn small() -> Spec {
    let points: Vec<[f32; 3]> = (0..8).map(|i| [(i % 2) as f32, (i / 2 % 2) as f32 * 1.5, (i / 4) as f32]).collect();
    let scalar = (0..8).map(|i| i as f32 * 0.5 - 1.0).collect();
    let vector = (0..24).map(|i| (i * i) as f32).collect();
    Spec {
        points,
        cells: vec![(10, vec![0, 1, 2, 4]), (13, vec![1, 3, 2, 5, 7, 6]), (10, vec![1, 2, 4, 6])],
        attributes: vec![("s".into(), 1, scalar), ("v w".into(), 3, vector)],
    }
}

/// How a VTU file is written.
#[derive(Clone, Copy, Debug)]
pub struct Xml {
    /// ascii, binary, raw or base64.
    pub mode: usize,
    /// None, zlib or LZ4.
    pub compressor: usize,
    pub big: bool,
    pub wide_header: bool,
    pub wide_ids: bool,
    /// Bytes of a compressed block.
    pub block: usize,
}

pub const PLAIN: Xml = Xml { mode: 0, compressor: 0, big: false, wide_header: false, wide_ids: true, block: 64 };

fn order(bytes: &[u8], big: bool) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    if big {
        bytes.reverse();
    }
    bytes
}

fn floats(values: &[f32], big: bool) -> Vec<u8> {
    values.iter().flat_map(|v| order(&v.to_le_bytes(), big)).collect()
}

fn integers(values: &[u64], wide: bool, big: bool) -> Vec<u8> {
    let bytes = |v: &u64| if wide { v.to_le_bytes().to_vec() } else { (*v as u32).to_le_bytes().to_vec() };
    values.iter().flat_map(|v| order(&bytes(v), big)).collect()
}

pub fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

impl Xml {
    fn header(self, values: &[u64]) -> Vec<u8> {
        integers(values, self.wide_header, self.big)
    }

    /// An array's head and its body.
    fn encode(self, bytes: &[u8]) -> (Vec<u8>, Vec<u8>) {
        if self.compressor == 0 {
            return (self.header(&[bytes.len() as u64]), bytes.to_vec());
        }
        let pack = |block: &[u8]| match self.compressor {
            1 => zlib(block),
            _ => lz4_flex::block::compress(block),
        };
        let blocks: Vec<_> = bytes.chunks(self.block).map(pack).collect();
        let last = bytes.len() % self.block;
        let mut head = vec![blocks.len() as u64, self.block as u64, last as u64];
        head.extend(blocks.iter().map(|b| b.len() as u64));
        (self.header(&head), blocks.concat())
    }

    fn text(self, bytes: &[u8]) -> String {
        let (head, body) = self.encode(bytes);
        if self.compressor == 0 {
            return STANDARD.encode([head, body].concat());
        }
        STANDARD.encode(head) + &STANDARD.encode(body)
    }
}

/// The whole numbers and floats that a VTU file has.
pub struct VtuWriter {
    settings: Xml,
    elements: String,
    appended: Vec<u8>,
}

impl VtuWriter {
    pub fn new(settings: Xml, points: usize, cells: usize) -> Self {
        let order = if settings.big { "BigEndian" } else { "LittleEndian" };
        let header = if settings.wide_header { "UInt64" } else { "UInt32" };
        let compressor = ["", " compressor=\"vtkZLibDataCompressor\"", " compressor=\"vtkLZ4DataCompressor\""];
        let elements = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"{order}\" \
             header_type=\"{header}\"{}>\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"{points}\" \
             NumberOfCells=\"{cells}\">\n",
            compressor[settings.compressor]
        );
        Self { settings, elements, appended: Vec::new() }
    }

    pub fn open(&mut self, section: &str) {
        writeln!(self.elements, "<{section}>").unwrap();
    }

    pub fn close(&mut self, section: &str) {
        writeln!(self.elements, "</{section}>").unwrap();
    }

    pub fn array(&mut self, kind: &str, name: &str, components: usize, words: &str, bytes: &[u8]) {
        let head = format!("<DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\"");
        match self.settings.mode {
            0 => writeln!(self.elements, "{head} format=\"ascii\">\n{words}\n</DataArray>"),
            1 => writeln!(self.elements, "{head} format=\"binary\">\n  {}\n</DataArray>", self.settings.text(bytes)),
            mode => {
                let offset = self.appended.len();
                if mode == 2 {
                    let (head, body) = self.settings.encode(bytes);
                    self.appended.extend([head, body].concat());
                } else {
                    self.appended.extend(self.settings.text(bytes).into_bytes());
                }
                writeln!(self.elements, "{head} format=\"appended\" offset=\"{offset}\"/>")
            }
        }
        .unwrap();
    }

    pub fn finish(mut self) -> Vec<u8> {
        self.elements += "</Piece>\n</UnstructuredGrid>\n";
        if self.settings.mode < 2 {
            return (self.elements + "</VTKFile>\n").into_bytes();
        }
        let encoding = if self.settings.mode == 2 { "raw" } else { "base64" };
        let head = format!("{}<AppendedData encoding=\"{encoding}\">\n   _", self.elements);
        [head.as_bytes(), &self.appended, b"\n</AppendedData>\n</VTKFile>\n"].concat()
    }
}

fn words<T: ToString>(values: &[T]) -> String {
    values.iter().map(T::to_string).collect::<Vec<_>>().join(" ")
}

pub fn vtu(spec: &Spec, settings: Xml) -> Vec<u8> {
    let mut out = VtuWriter::new(settings, spec.points.len(), spec.cells.len());
    let big = settings.big;
    out.open("PointData");
    for (name, components, values) in &spec.attributes {
        out.array("Float32", name, *components, &words(values), &floats(values, big));
    }
    out.close("PointData");
    out.open("Points");
    let points: Vec<f32> = spec.points.iter().flatten().copied().collect();
    out.array("Float32", "Points", 3, &words(&points), &floats(&points, big));
    out.close("Points");
    out.open("Cells");
    let kind = if settings.wide_ids { "Int64" } else { "Int32" };
    let corners: Vec<u64> = spec.cells.iter().flat_map(|(_, c)| c).map(|i| u64::from(*i)).collect();
    let mut end = 0;
    let mut ends: Vec<u64> = Vec::new();
    for (_, corners) in &spec.cells {
        end += corners.len() as u64;
        ends.push(end);
    }
    let types: Vec<u8> = spec.cells.iter().map(|(t, _)| *t).collect();
    out.array(kind, "connectivity", 1, &words(&corners), &integers(&corners, settings.wide_ids, big));
    out.array(kind, "offsets", 1, &words(&ends), &integers(&ends, settings.wide_ids, big));
    out.array("UInt8", "types", 1, &words(&types), &types);
    out.close("Cells");
    out.finish()
}

/// A legacy file, as text or binary, with cells as counted lists or as offsets and connectivity.
pub fn vtk(spec: &Spec, text: bool, offsets: bool) -> Vec<u8> {
    let version = if offsets { "5.1" } else { "3.0" };
    let coding = if text { "ASCII" } else { "BINARY" };
    let mut out =
        format!("# vtk DataFile Version {version}\ntitle\n{coding}\nDATASET UNSTRUCTURED_GRID\n").into_bytes();
    fn put(out: &mut Vec<u8>, text: bool, words: String, bytes: Vec<u8>) {
        out.extend(if text { words.into_bytes() } else { bytes });
        out.push(b'\n');
    }
    let points: Vec<f32> = spec.points.iter().flatten().copied().collect();
    out.extend(format!("POINTS {} float\n", spec.points.len()).bytes());
    put(&mut out, text, words(&points), floats(&points, true));
    let corners: Vec<u64> = spec.cells.iter().flat_map(|(_, c)| c).map(|i| u64::from(*i)).collect();
    if offsets {
        let mut bounds = vec![0];
        spec.cells.iter().for_each(|(_, c)| bounds.push(bounds.last().unwrap() + c.len() as u64));
        out.extend(format!("CELLS {} {}\nOFFSETS vtktypeint64\n", bounds.len(), corners.len()).bytes());
        put(&mut out, text, words(&bounds), integers(&bounds, true, true));
        out.extend(b"CONNECTIVITY vtktypeint64\n");
        put(&mut out, text, words(&corners), integers(&corners, true, true));
    } else {
        let list = |(_, c): &(u8, Vec<u32>)| {
            std::iter::once(c.len() as u64).chain(c.iter().map(|i| u64::from(*i))).collect::<Vec<_>>()
        };
        let all: Vec<u64> = spec.cells.iter().flat_map(list).collect();
        out.extend(format!("CELLS {} {}\n", spec.cells.len(), all.len()).bytes());
        put(&mut out, text, words(&all), integers(&all, false, true));
    }
    let types: Vec<u64> = spec.cells.iter().map(|(t, _)| u64::from(*t)).collect();
    out.extend(format!("CELL_TYPES {}\n", types.len()).bytes());
    put(&mut out, text, words(&types), integers(&types, false, true));
    out.extend(
        format!(
            "POINT_DATA {}\nMETADATA\nINFORMATION 0\n\nFIELD FieldData {}\n",
            spec.points.len(),
            spec.attributes.len()
        )
        .bytes(),
    );
    for (name, components, values) in &spec.attributes {
        let name = name.replace(' ', "%20");
        out.extend(format!("{name} {components} {} float\n", spec.points.len()).bytes());
        put(&mut out, text, words(values), floats(values, true));
    }
    out
}

/// How a PLOT3D file is written.
#[derive(Clone, Copy, Debug)]
pub struct Plot3d {
    pub big: bool,
    pub records: bool,
    pub multi: bool,
    pub double: bool,
    pub iblank: bool,
}

/// A block: dimensions, x, y and z of each vertex, and whether it counts.
pub type Block = ([u32; 3], Vec<[f32; 3]>, Vec<i32>);

impl Plot3d {
    fn record(self, body: Vec<u8>) -> Vec<u8> {
        let mark = if self.records { order(&(body.len() as u32).to_le_bytes(), self.big) } else { Vec::new() };
        [mark.clone(), body, mark].concat()
    }

    fn word(self, n: i32) -> Vec<u8> {
        order(&n.to_le_bytes(), self.big)
    }

    fn float(self, v: f32) -> Vec<u8> {
        if self.double { order(&f64::from(v).to_le_bytes(), self.big) } else { order(&v.to_le_bytes(), self.big) }
    }

    fn head(self, blocks: &[Block], variables: Option<i32>) -> Vec<u8> {
        let mut out = Vec::new();
        if self.multi {
            out.extend(self.record(self.word(blocks.len() as i32)));
        }
        let row = |(dims, ..): &Block| {
            dims.iter().map(|n| *n as i32).chain(variables).flat_map(|n| self.word(n)).collect::<Vec<_>>()
        };
        out.extend(self.record(blocks.iter().flat_map(row).collect()));
        out
    }

    pub fn grid(self, blocks: &[Block]) -> Vec<u8> {
        let mut out = self.head(blocks, None);
        for (_, points, flags) in blocks {
            let mut body: Vec<u8> = (0..3).flat_map(|a| points.iter().flat_map(move |p| self.float(p[a]))).collect();
            if self.iblank {
                body.extend(flags.iter().flat_map(|f| self.word(*f)));
            }
            out.extend(self.record(body));
        }
        out
    }

    /// Density, momentum and energy of each vertex: `q(block, vertex, variable)`.
    pub fn solution(self, blocks: &[Block], q: impl Fn(usize, usize, usize) -> f32) -> Vec<u8> {
        let mut out = self.head(blocks, None);
        for (n, (_, points, _)) in blocks.iter().enumerate() {
            out.extend(self.record([0.5f32, 1.0, 2.0, 3.0].iter().flat_map(|v| self.float(*v)).collect()));
            let values = (0..5).flat_map(|k| (0..points.len()).map(move |v| (v, k)));
            out.extend(self.record(values.flat_map(|(v, k)| self.float(q(n, v, k))).collect()));
        }
        out
    }

    /// Any number of variables.
    pub fn function(self, blocks: &[Block], variables: usize, f: impl Fn(usize, usize, usize) -> f32) -> Vec<u8> {
        let mut out = self.head(blocks, Some(variables as i32));
        for (n, (_, points, _)) in blocks.iter().enumerate() {
            let values = (0..variables).flat_map(|k| (0..points.len()).map(move |v| (v, k)));
            out.extend(self.record(values.flat_map(|(v, k)| self.float(f(n, v, k))).collect()));
        }
        out
    }
}

/// A block of `dims` vertices at a place.
pub fn block(dims: [u32; 3], at: f32) -> Block {
    let [nx, ny, nz] = dims;
    let rows = (0..nz).flat_map(|z| (0..ny).map(move |y| (y, z)));
    let points: Vec<_> = rows
        .flat_map(|(y, z)| (0..nx).map(move |x| [x as f32 + at, y as f32 + 0.1 * x as f32, z as f32 * 1.5]))
        .collect();
    let flags = vec![1; points.len()];
    (dims, points, flags)
}

pub const OBJ: &str = "# a pyramid\nmtllib p.mtl\no p\nv 0 0 0\nv 1 0 0 \\\n 1.0\nv 1 1 0\nv 0 1 0\nv 0.5 0.5 1\n\
                       vt 0 0\nvn 0 0 -1\nusemtl red\nf 4/1/1 3/1/1 2/1/1 1/1/1\nf 1 2 5\nf -4 -3 -1\nf 3// 4// 5//\n\
                       f 4 1 5\nl 1 2\np 5\ncurv 0 1 1 2\n";

/// A tetrahedron with colours, normals and lists, in the encoding named.
pub fn ply(encoding: &str) -> Vec<u8> {
    let mut out = format!(
        "ply\nformat {encoding} 1.0\ncomment made by a test\nelement vertex 4\nproperty float x\nproperty float y\n\
         property float z\nproperty float nx\nproperty float ny\nproperty float nz\nproperty uchar red\n\
         property short level\nproperty list uchar float weights\nelement face 3\n\
         property list uchar int vertex_indices\nproperty uchar quality\nelement edge 1\nproperty int vertex1\nend_header\n"
    )
    .into_bytes();
    let points = [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.25, 0.25, 2.0]];
    let faces: [&[i32]; 3] = [&[0, 2, 1], &[0, 1, 3], &[1, 2, 0, 3]];
    let big = encoding == "binary_big_endian";
    for (n, p) in points.iter().enumerate() {
        let normal = [0.0, 0.6, 0.8 * n as f32];
        let (red, level, weights) = (n as u8 * 80, -300 * n as i16, vec![0.5f32; n]);
        if encoding == "ascii" {
            let list = format!("{} {}", weights.len(), words(&weights));
            writeln!(out, "{} {} {red} {level} {list}", words(p), words(&normal)).unwrap();
        } else {
            out.extend(floats(p, big));
            out.extend(floats(&normal, big));
            out.push(red);
            out.extend(order(&level.to_le_bytes(), big));
            out.push(weights.len() as u8);
            out.extend(floats(&weights, big));
        }
    }
    for face in faces {
        if encoding == "ascii" {
            writeln!(out, "{} {} 7", face.len(), words(face)).unwrap();
        } else {
            out.push(face.len() as u8);
            face.iter().for_each(|i| out.extend(order(&i.to_le_bytes(), big)));
            out.push(7);
        }
    }
    out.extend(if encoding == "ascii" { b"2\n".to_vec() } else { order(&2i32.to_le_bytes(), big) });
    out
}

/// Triangles in each form; `head` fills the first bytes of the binary one.
pub fn stl_binary(triangles: &[[[f32; 3]; 3]], head: &str) -> Vec<u8> {
    let mut out = format!("{head:80}").into_bytes();
    out.extend((triangles.len() as u32).to_le_bytes());
    for t in triangles {
        out.extend(floats(&[0.0, 0.0, 1.0], false));
        t.iter().for_each(|p| out.extend(floats(p, false)));
        out.extend([0, 0]);
    }
    out
}

pub fn stl_text(triangles: &[[[f32; 3]; 3]], name: &str) -> Vec<u8> {
    let mut out = format!("solid {name}\n");
    for t in triangles {
        out += "  facet normal nan 0 1e0\n    outer loop\n";
        t.iter().for_each(|p| writeln!(out, "      vertex {}", words(p)).unwrap());
        out += "    endloop\n  endfacet\n";
    }
    (out + &format!("endsolid {name}\n")).into_bytes()
}

/// The four faces of a tetrahedron.
pub fn tetrahedron() -> Vec<[[f32; 3]; 3]> {
    let p = [[0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-0.0, 0.0, 1.0]];
    [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]].map(|f| f.map(|i: usize| p[i])).to_vec()
}

/// Loader, path and files.
pub type Sample = (&'static str, &'static str, Vec<(&'static str, Vec<u8>)>);

/// One valid mesh of each kind.
pub fn all() -> Vec<Sample> {
    let one = |loader, path, bytes| (loader, path, vec![(path, bytes)]);
    let xml = |mode, compressor, big| {
        one("vtu", "m.vtu", vtu(&small(), Xml { mode, compressor, big, wide_header: big, wide_ids: !big, block: 48 }))
    };
    let plot3d = |big, records, multi, double, iblank| {
        let layout = Plot3d { big, records, multi, double, iblank };
        let blocks =
            if multi { vec![block([3, 2, 2], 0.0), block([2, 2, 3], 2.0)] } else { vec![block([4, 3, 2], 0.0)] };
        let q = layout.solution(&blocks, |n, v, k| (n + v * k) as f32);
        ("plot3d", "mxyz.bin", vec![("mxyz.bin", layout.grid(&blocks)), ("mq.bin", q)])
    };
    let mut all = vec![];
    for mode in 0..4 {
        all.extend((0..3).map(|compressor| xml(mode, compressor, (mode + compressor) % 2 == 1)));
    }
    for (text, offsets) in [(true, true), (true, false), (false, true), (false, false)] {
        all.push(one("vtk-mesh", "m.vtk", vtk(&small(), text, offsets)));
    }
    all.push(plot3d(false, false, false, false, false));
    all.push(plot3d(true, true, true, true, true));
    all.push(one("obj", "m.obj", OBJ.into()));
    all.extend(["ascii", "binary_little_endian", "binary_big_endian"].map(|e| one("ply", "m.ply", ply(e))));
    all.push(one("stl", "m.stl", stl_binary(&tetrahedron(), "solid in name only")));
    all.push(one("stl", "m.stl", stl_text(&tetrahedron(), "a b")));
    all
}
