//! Malformed meshes and surfaces, each with the one message that it gets.

use crate::{
    Case, case,
    mesh_samples::{
        OBJ, PLAIN, Plot3d, Spec, VtuWriter, Xml, block, ply, small, stl_binary, stl_text, tetrahedron, vtk, vtu,
    },
};

/// The loaders of meshes.
pub const LOADERS: [&str; 9] = ["vtu", "vts", "vtp", "vtk-mesh", "plot3d", "exodus", "obj", "ply", "stl"];

/// Format, input and message.
pub const MESSAGES: &[(&str, &str, &str)] = &[
    (
        "vtu",
        "another kind of file",
        r#"m.vtu: VTK file type "ImageData" is not supported; name the loader for it, or save it as an unstructured grid"#,
    ),
    ("vtu", "no piece", "m.vtu: element Piece is missing, wanted one"),
    ("vtu", "no points", "m.vtu: array of Points is missing, wanted one"),
    ("vtu", "no cells", "m.vtu: number of cells that hold volume (of 0) is 0, wanted at least 1"),
    ("vtu", "cells without volume only", "m.vtu: number of cells that hold volume (of 2) is 0, wanted at least 1"),
    ("vtu", "an index out of range", "m.vtu: vertex index of cell 1 is 8, wanted from 0, below 8"),
    ("vtu", "a negative index", "m.vtu: vertex index of cell 0 is -4, wanted from 0, below 8"),
    (
        "vtu",
        "an index beyond 64 bits",
        r#"m.vtu: number 3 of array "connectivity" is "99999999999999999999", wanted a number of type i64"#,
    ),
    (
        "vtu",
        "a type that nobody knows",
        "m.vtu: type of cell 1 is 99, wanted a type of VTK, e.g. 10 (tetrahedron), 12 (hexahedron), 13 (wedge), 14 (pyramid)",
    ),
    (
        "vtu",
        "a polyhedron",
        "m.vtu: cell 1 of type 42 (polyhedron) is not supported; cut it into tetrahedra, hexahedra, wedges or pyramids",
    ),
    (
        "vtu",
        "a quadratic tetrahedron",
        "m.vtu: cell 1 of type 24 (quadratic tetrahedron) is not supported; cut it into tetrahedra, hexahedra, wedges or pyramids",
    ),
    ("vtu", "a tetrahedron of five corners", "m.vtu: number of corners of cell 1 is 5, wanted 4 for its type 10"),
    (
        "vtu",
        "offsets that go back",
        "m.vtu: place of the corners of cell 1 is numbers 4 to 3, wanted between 4 and the 14 numbers of the connectivity",
    ),
    (
        "vtu",
        "offsets beyond the connectivity",
        r#"m.vtu: holds 112 bytes of array "connectivity", as text of 15 numbers at most, wanted 120"#,
    ),
    (
        "vtu",
        "a vertex that is no number",
        "m.vtu: vertex 5 (of cell 1) is [1.0, NaN, 1.0], wanted three finite numbers",
    ),
    ("vtu", "an infinite vertex", "m.vtu: vertex 1 (of cell 0) is [1.0, 0.0, inf], wanted three finite numbers"),
    (
        "vtu",
        "an attribute too short",
        r#"m.vtu: holds 28 bytes of array "s", as text of 12 numbers at most, wanted 32"#,
    ),
    ("vtu", "an attribute too short, binary", r#"m.vtu: array "s" is 28 bytes, wanted 32 bytes"#),
    ("vtu", "an attribute of no components", r#"m.vtu: NumberOfComponents of "s" is 0, wanted at least 1"#),
    (
        "vtu",
        "two billion cells, as text",
        r#"m.vtu: holds 0 bytes of array "types", as text of 2 numbers at most, wanted 2000000000"#,
    ),
    ("vtu", "two billion cells, raw", r#"m.vtu: array "types" is 64 bytes, wanted 2000000000 bytes"#),
    (
        "vtu",
        "two billion cells, raw, that the arrays claim",
        r#"m.vtu: holds 236 bytes of array "types", wanted 2000000000"#,
    ),
    (
        "vtu",
        "two billion cells, zlib",
        "m.vtu: compressed blocks is 1 of 64 bytes, the last of 0, wanted 2000000000 bytes altogether",
    ),
    (
        "vtu",
        "two billion points",
        r#"m.vtu: holds 0 bytes of array "Points", as text of 29 numbers at most, wanted 24000000000"#,
    ),
    ("vtu", "more points than 32 bits count", "m.vtu: NumberOfPoints is 5000000000, wanted at most 4294967295"),
    ("vtu", "cut in its appended data", "m.vtu: holds 0 bytes of array header, wanted 4"),
    (
        "vtu",
        "cut in its elements",
        "m.vtu: cannot be decoded: syntax error: tag not closed: `>` not found before end of input",
    ),
    ("vtu", "fractions as connectivity", "m.vtu: connectivity is of type f32, wanted whole numbers"),
    (
        "vtu",
        "a word among the numbers",
        r#"m.vtu: number 2 of array "connectivity" is "two", wanted a number of type i64"#,
    ),
    (
        "vtu",
        "lzma",
        r#"m.vtu: compressor "vtkLZMADataCompressor" is not supported; save it with zlib, with LZ4 or uncompressed"#,
    ),
    ("vtu", "LZ4: damaged", "m.vtu: cannot be decoded: literal is out of bounds of the input"),
    (
        "vts",
        "an extent of one vertex",
        r#"m.vts: describes no mesh: geometry "structured_mesh": dimensions is [2, 4, 1], wanted at least 2 vertices an axis"#,
    ),
    ("vts", "an extent turned round", "m.vts: Piece Extent is [2, 0, 2], wanted sizes from 1 to 2147483648"),
    ("vts", "2^62 vertices", "m.vts: Piece Extent is [2147483647, 2147483647, 1], wanted a grid that memory can hold"),
    ("vts", "too few vertices", r#"m.vts: holds 0 bytes of array "Points", as text of 24 numbers at most, wanted 144"#),
    ("vts", "several pieces", "m.vts: a structured grid of several pieces is not supported; save it as one piece"),
    (
        "vts",
        "a vertex that is no number",
        "m.vts: vertex 3 (at [1, 1, 0] of the grid) is [1.0, NaN, 0.0], wanted three finite numbers",
    ),
    ("vtp", "no faces", "m.vtp: number of triangles (of 0 faces) is 0, wanted at least 1"),
    ("vtp", "lines only", "m.vtp: number of triangles (of 2 faces) is 0, wanted at least 1"),
    ("vtp", "an index out of range", "m.vtp: vertex index of face 1 is 4, wanted from 0, below 4"),
    (
        "vtp",
        "offsets that go back",
        "m.vtp: place of the corners of face 0 is numbers 0 to 3, wanted between 0 and the 1 numbers of the connectivity",
    ),
    ("vtp", "offsets below zero", "m.vtp: last of offsets is -3, wanted the length of connectivity"),
    (
        "vtp",
        "a crossed polygon of 80 corners",
        "m.vtp: face 0, of 80 corners and not convex, is not supported; cut it into faces of at most 64 corners",
    ),
    (
        "vtk-mesh",
        "a volume",
        "m.vtk: dataset STRUCTURED_POINTS is not supported; only UNSTRUCTURED_GRID, STRUCTURED_GRID, POLYDATA are meshes or surfaces",
    ),
    (
        "vtk-mesh",
        "version 9",
        r##"m.vtk: first line is "# vtk DataFile Version 9.0", wanted # vtk DataFile Version 1.0 to 5.x"##,
    ),
    ("vtk-mesh", "no points", "m.vtk: section POINTS is missing, wanted one"),
    ("vtk-mesh", "no cells", "m.vtk: section CELLS is missing, wanted one"),
    ("vtk-mesh", "no cell types", "m.vtk: section CELL_TYPES is missing, wanted one"),
    ("vtk-mesh", "fewer types than cells", "m.vtk: number of CELL_TYPES is 2, wanted 3, one for each of CELLS"),
    (
        "vtk-mesh",
        "two billion cells",
        "m.vtk: holds 0 bytes of CELLS, as text of 124 numbers at most, wanted 40000000000",
    ),
    (
        "vtk-mesh",
        "two billion points",
        "m.vtk: holds 0 bytes of POINTS, as text of 183 numbers at most, wanted 24000000000",
    ),
    ("vtk-mesh", "more points than 32 bits count", "m.vtk: number of POINTS is 5000000000, wanted at most 4294967295"),
    ("vtk-mesh", "an index out of range", "m.vtk: vertex index of cell 0 is 44, wanted from 0, below 8"),
    ("vtk-mesh", "a negative index", "m.vtk: vertex index of cell 0 is -4, wanted from 0, below 8"),
    (
        "vtk-mesh",
        "counts that reach too far",
        "m.vtk: place of the corners of cell 0 is numbers 1 to 91, wanted between 0 and the 17 numbers of the connectivity",
    ),
    (
        "vtk-mesh",
        "a negative count",
        "m.vtk: place of the corners of cell 0 is numbers 1 to -1, wanted between 0 and the 17 numbers of the connectivity",
    ),
    (
        "vtk-mesh",
        "a type that nobody knows",
        "m.vtk: type of cell 1 is 130, wanted a type of VTK, e.g. 10 (tetrahedron), 12 (hexahedron), 13 (wedge), 14 (pyramid)",
    ),
    ("vtk-mesh", "a type beyond 8 bits", "m.vtk: type of cell 1 is 1300, wanted 0 to 255"),
    ("vtk-mesh", "an unknown keyword", r#"m.vtk: keyword is "METADATE", wanted a keyword of legacy VTK files"#),
    ("vtk-mesh", "an unknown data type", r#"m.vtk: data type is "quad", wanted a type of VTK, e.g. float"#),
    ("vtk-mesh", "a field array of the wrong length", r#"m.vtk: tuples of "s" is 7, wanted 8"#),
    (
        "vtk-mesh",
        "attributes of other points",
        r#"m.vtk: length of attribute "s" is 3 numbers, wanted 4 vertices of 1"#,
    ),
    ("vtk-mesh", "cut in its points", "m.vtk: holds 12 bytes of POINTS, wanted 96"),
    ("vtk-mesh", "cut in its cells", "m.vtk: holds 59 bytes of CELLS, wanted 68"),
    ("vtk-mesh", "cut in its attributes", r#"m.vtk: holds 65 bytes of array "v w", wanted 96"#),
    (
        "vtk-mesh",
        "a structured grid of too few points",
        r#"m.vtk: describes no mesh: geometry "structured_mesh": number of vertices is 4, wanted 2 × 2 × 2"#,
    ),
    ("vtk-mesh", "a surface of lines", "m.vtk: number of triangles (of 0 faces) is 0, wanted at least 1"),
    (
        "plot3d",
        "nothing",
        "m.xyz: size is 0 bytes, wanted a grid of PLOT3D: dimensions, then x, y and z of all vertices",
    ),
    ("plot3d", "text", "m.xyz: size is 12 bytes, wanted a grid of PLOT3D: dimensions, then x, y and z of all vertices"),
    (
        "plot3d",
        "one byte short",
        "m.xyz: size is 155 bytes, wanted 156 for [3, 2, 2] of little-endian f32 of one block; 204 for [3, 2, 2] of little-endian f32 of one block, with iblank; 300 for [3, 2, 2] of little-endian f64 of one block; 348 for [3, 2, 2] of little-endian f64 of one block, with iblank",
    ),
    (
        "plot3d",
        "one byte short, with record marks",
        "m.xyz: size is 231 bytes, wanted 232 for [3, 2, 2] of big-endian f32 of several blocks, with record marks, with iblank",
    ),
    (
        "plot3d",
        "2^93 vertices",
        "m.xyz: size is 1012 bytes, wanted a grid of PLOT3D: dimensions, then x, y and z of all vertices",
    ),
    (
        "plot3d",
        "a vertex that is no number",
        "m.xyz: vertex 7 (at [1, 0, 1] of block 0) is [NaN, 0.10000000149011612, 1.5], wanted three finite numbers",
    ),
    (
        "plot3d",
        "a grid of two dimensions",
        r#"m.xyz: describes no mesh: geometry "structured_mesh": dimensions is [3, 2, 1], wanted at least 2 vertices an axis"#,
    ),
    ("plot3d", "all blanked", "m.xyz: number of cells that are not blanked is 0, wanted at least 1"),
    ("exodus", "no NetCDF at all", "m.exo: cannot be decoded: invalid NetCDF magic bytes"),
    (
        "exodus",
        "cut in its head",
        "m.exo: cannot be decoded: unexpected end of file at offset 16: need 304 bytes, available 184",
    ),
    (
        "exodus",
        "cut in its data",
        "m.exo: cannot be decoded: invalid data: classic header declares 3 records (2552 bytes) but the file has only 2252 bytes",
    ),
    ("exodus", "HDF5, cut", "m.exo: dimension num_nodes is missing, wanted one, as Exodus II has"),
    ("exodus", "NetCDF of something else", "m.exo: dimension num_nodes is missing, wanted one, as Exodus II has"),
    (
        "exodus",
        "two billion nodes",
        "m.exo: cannot be decoded: invalid data: classic header declares 3 records (96000001928 bytes) but the file has only 2552 bytes",
    ),
    (
        "exodus",
        "two billion elements in a block",
        "m.exo: cannot be decoded: invalid data: selection of variable 'connect1' (16000000000 elements) exceeds the 2552-byte file; the header is corrupt",
    ),
    ("exodus", "two billion blocks", "m.exo: num_el_blk is 2000000000, wanted at most 65536"),
    ("exodus", "two dimensions", "m.exo: num_dim is 2, wanted 3"),
    ("exodus", "node 0", "m.exo: node of element 0 (block 1) is 0, wanted 1 to 13"),
    ("exodus", "a node out of range", "m.exo: node of element 0 (block 1) is 14, wanted 1 to 13"),
    ("exodus", "curved elements", r#"m.exo: elements "HEXX" of block 1 is not supported; cut them into linear cells"#),
    (
        "exodus",
        "a node that is no number",
        "m.exo: vertex 12 (of volume element 3) is [NaN, 0.4, 2.5], wanted three finite numbers",
    ),
    ("obj", "nothing", "m.obj: number of triangles (of 0 faces) is 0, wanted at least 1"),
    ("obj", "no faces", "m.obj: number of triangles (of 0 faces) is 0, wanted at least 1"),
    ("obj", "a vertex of two numbers", r#"m.obj: vertex in line 7 is "v 1 1", wanted three numbers"#),
    ("obj", "a vertex of words", r#"m.obj: vertex in line 7 is "one", wanted numbers"#),
    ("obj", "an index out of range", "m.obj: vertex index of face 1 in line 14 is 6, wanted 1 to 5, or -1 to -5"),
    ("obj", "index 0", "m.obj: vertex index of face 1 in line 14 is 0, wanted 1 to 5, or -1 to -5"),
    (
        "obj",
        "a negative index out of range",
        "m.obj: vertex index of face 2 in line 15 is -6, wanted 1 to 5, or -1 to -5",
    ),
    ("obj", "a normal out of range", "m.obj: normal index of face 0 in line 13 is 2, wanted 1 to 1, or -1 to -1"),
    ("obj", "a corner of words", r#"m.obj: normal index in line 13 is "4/1/x", wanted whole numbers between slashes"#),
    ("obj", "an infinite vertex", "m.obj: vertex 1 (of the surface) is [1.0, inf, 0.0], wanted three finite numbers"),
    ("ply", "no PLY at all", "m.ply: cannot be decoded: Line 1: Expected magic number 'ply'. String: 'plx '"),
    (
        "ply",
        "no end of the head",
        "m.ply: cannot be decoded: Line 20: Couldn't parse line. String: '0 0 0 0 0.6 0 0 0 0 '",
    ),
    ("ply", "no vertices", "m.ply: element vertex is missing, wanted one"),
    ("ply", "no z", "m.ply: properties x, y and z of vertex is missing, wanted all three"),
    ("ply", "no faces", "m.ply: list vertex_indices of face is missing, wanted one"),
    ("ply", "two billion vertices", r#"m.ply: holds 538 bytes of 2000000000 elements "vertex", wanted 36000000000"#),
    (
        "ply",
        "two billion faces of nothing",
        r#"m.ply: holds 512 bytes of 2000000000 elements "face", wanted 2000000000"#,
    ),
    ("ply", "an index out of range", "m.ply: vertex index of face 0 is 4, wanted from 0, below 4"),
    ("ply", "a negative index", "m.ply: vertex index of face 0 is -1, wanted from 0, below 4"),
    (
        "ply",
        "a row too short",
        "m.ply: cannot be decoded: face 0 to 2: Line 24: Couldn't read element line. String: '3 0 2 ' Error: Expected 3 list elements, but found only 2.",
    ),
    (
        "ply",
        "a word among the numbers",
        "m.ply: cannot be decoded: face 0 to 2: Line 24: Couldn't read element line. String: '3 0 two 1 7 ' Error: Couldn't parse element line. String: '3 0 two 1 7 '",
    ),
    (
        "ply",
        "a vertex that is no number",
        "m.ply: cannot be decoded: vertex 0 to 3: Line 23: Couldn't read element line. String: '0.25 nan 2 0 0.6 2.4 240 -900 3 0.5 0.5 0.5 ' Error: Couldn't parse element line. String: '0.25 nan 2 0 0.6 2.4 240 -900 3 0.5 0.5 0.5 '",
    ),
    (
        "ply",
        "cut in its faces",
        "m.ply: cannot be decoded: face 0 to 2: Line 26: Unexpected end of file while reading binary element 'face' (expected 3, got 2). Error: Couldn't find a list element at index 0. Error: failed to fill whole buffer",
    ),
    (
        "ply",
        "a list of 4 billion corners",
        "m.ply: cannot be decoded: face 0 to 2: Line 25: Unexpected end of file while reading binary element 'face' (expected 3, got 1). Error: Couldn't find a list element at index 7. Error: failed to fill whole buffer",
    ),
    ("stl", "nothing", "m.stl: holds 0 bytes of 0 triangles, wanted 84"),
    ("stl", "two billion triangles", "m.stl: holds 284 bytes of 2000000000 triangles, wanted 100000000084"),
    ("stl", "cut in its triangles", "m.stl: holds 200 bytes of 4 triangles, wanted 284"),
    ("stl", "no triangles", "m.stl: number of triangles is 0, wanted at least 1"),
    (
        "stl",
        "a vertex that is no number",
        "m.stl: vertex 4 (of triangle 2) is [NaN, 1.0, 0.0], wanted three finite numbers",
    ),
    ("stl", "text: cut in a triangle", r#"m.stl: word in triangle 0 is "e", wanted endfacet"#),
    ("stl", "text: four corners", r#"m.stl: word in triangle 0 is "vertex", wanted endloop"#),
    ("stl", "text: a word among the numbers", r#"m.stl: coordinate of triangle 0 is "zero", wanted a number"#),
    (
        "stl",
        "text: an infinite vertex",
        "m.stl: vertex 2 (of triangle 0) is [1.0, inf, 0.0], wanted three finite numbers",
    ),
];

fn replaced(bytes: Vec<u8>, pairs: &[(&str, &str)]) -> Vec<u8> {
    let text = String::from_utf8(bytes).unwrap();
    pairs
        .iter()
        .fold(text, |text, (from, to)| {
            assert!(text.contains(from), "{from:?} is not there");
            text.replace(from, to)
        })
        .into_bytes()
}

fn vtu_cases() -> Vec<Case> {
    let one = |what, bytes| case("vtu", what, vec![("m.vtu", bytes)]);
    let text = |pairs: &[(&str, &str)]| replaced(vtu(&small(), PLAIN), pairs);
    let raw = Xml { mode: 2, ..PLAIN };
    let cut = |settings: Xml, bytes: usize| {
        let mut file = vtu(&small(), settings);
        let end = file.len() - bytes;
        file.truncate(end);
        file
    };
    let with = |cell: (u8, Vec<u32>)| {
        let mut spec = small();
        spec.cells.insert(1, cell);
        vtu(&spec, PLAIN)
    };
    let nan = |n: usize| {
        let mut spec = small();
        spec.points[n][1] = f32::NAN;
        vtu(&spec, raw)
    };
    let infinite = |n: usize| {
        let mut spec = small();
        spec.points[n][2] = f32::INFINITY;
        vtu(&spec, PLAIN)
    };
    // Two billion cells, of which each array says that it has them.
    let huge = |settings: Xml| {
        let mut out = VtuWriter::new(settings, 4, 2_000_000_000);
        out.open("Points");
        out.array("Float32", "Points", 3, "0 0 0 1 0 0 0 1 0 0 0 1", &[0; 48]);
        out.close("Points");
        out.open("Cells");
        ["types", "offsets", "connectivity"].iter().for_each(|name| out.array("UInt8", name, 1, "10", &[10; 64]));
        out.close("Cells");
        out.finish()
    };
    let mut lying = huge(Xml { wide_header: true, ..raw });
    let at = lying.windows(8).rposition(|w| w == 64u64.to_le_bytes()).unwrap();
    for place in 0..=at {
        if lying[place..place + 8] == 64u64.to_le_bytes() {
            lying[place..place + 8].copy_from_slice(&2_000_000_000u64.to_le_bytes());
        }
    }
    let short = |name: &str| {
        let mut spec = small();
        spec.attributes[0].0 = name.into();
        spec.attributes[0].2.pop();
        spec
    };
    vec![
        one("another kind of file", text(&[("type=\"UnstructuredGrid\"", "type=\"ImageData\"")])),
        one("no piece", text(&[("Piece", "Part")])),
        one("no points", text(&[("Points>", "Places>")])),
        one("no cells", text(&[("NumberOfCells=\"3\"", "NumberOfCells=\"0\"")])),
        one(
            "cells without volume only",
            vtu(&Spec { cells: vec![(9, vec![0, 1, 3, 2]), (3, vec![0, 1])], ..small() }, PLAIN),
        ),
        one("an index out of range", with((10, vec![0, 1, 2, 8]))),
        one("a negative index", text(&[("0 1 2 4 1 3", "0 1 2 -4 1 3")])),
        one("an index beyond 64 bits", text(&[("0 1 2 4 1 3", "0 1 2 99999999999999999999 1 3")])),
        one("a type that nobody knows", with((99, vec![0, 1, 2, 3]))),
        one("a polyhedron", with((42, vec![0, 1, 2, 3]))),
        one("a quadratic tetrahedron", with((24, (0..8).chain(0..2).collect()))),
        one("a tetrahedron of five corners", with((10, vec![0, 1, 2, 3, 4]))),
        one("offsets that go back", text(&[("4 10 14", "4 3 14")])),
        one("offsets beyond the connectivity", text(&[("4 10 14", "4 10 15")])),
        one("a vertex that is no number", nan(5)),
        one("an infinite vertex", infinite(1)),
        one("an attribute too short", vtu(&short("s"), PLAIN)),
        one("an attribute too short, binary", vtu(&short("s"), raw)),
        one(
            "an attribute of no components",
            text(&[("Name=\"s\" NumberOfComponents=\"1\"", "Name=\"s\" NumberOfComponents=\"0\"")]),
        ),
        one("two billion cells, as text", huge(PLAIN)),
        one("two billion cells, raw", huge(raw)),
        one("two billion cells, raw, that the arrays claim", lying),
        one("two billion cells, zlib", huge(Xml { compressor: 1, ..raw })),
        one("two billion points", text(&[("NumberOfPoints=\"8\"", "NumberOfPoints=\"2000000000\"")])),
        one("more points than 32 bits count", text(&[("NumberOfPoints=\"8\"", "NumberOfPoints=\"5000000000\"")])),
        one("cut in its appended data", cut(raw, 60)),
        one("cut in its elements", cut(PLAIN, 30)),
        one("fractions as connectivity", text(&[("Int64\" Name=\"conn", "Float32\" Name=\"conn")])),
        one("a word among the numbers", text(&[("0 1 2 4 1 3", "0 1 two 4 1 3")])),
        one("lzma", replaced(vtu(&small(), Xml { mode: 1, compressor: 1, ..PLAIN }), &[("ZLib", "LZMA")])),
        one("LZ4: damaged", {
            let mut file = vtu(&small(), Xml { compressor: 2, block: 4096, ..raw });
            let at = file.windows(3).rposition(|w| w == b"\x0a\x0d\x0a").unwrap();
            file[at - 1] = 0xff;
            file
        }),
    ]
}

fn vts_cases() -> Vec<Case> {
    let one = |what, text: String| case("vts", what, vec![("m.vts", text.into_bytes())]);
    let grid = |extent: &str, points: &str| {
        format!(
            "<VTKFile type=\"StructuredGrid\"><StructuredGrid WholeExtent=\"{extent}\"><Piece Extent=\"{extent}\">\
             <Points><DataArray type=\"Float32\" NumberOfComponents=\"3\" format=\"ascii\">{points}</DataArray></Points>\
             </Piece></StructuredGrid></VTKFile>"
        )
    };
    let cube: String = (0..8).map(|i| format!("{} {} {} ", i % 2, i / 2 % 2, i / 4)).collect();
    let several = grid("0 1 0 1 0 1", &cube).replace("</Piece>", "</Piece><Piece Extent=\"0 1 0 1 0 1\"></Piece>");
    vec![
        one("an extent of one vertex", grid("0 1 0 3 2 2", &cube)),
        one("an extent turned round", grid("0 1 1 0 0 1", &cube)),
        one("2^62 vertices", grid("0 2147483646 0 2147483646 0 0", &cube)),
        one("too few vertices", grid("0 1 0 1 0 2", &cube)),
        one("several pieces", several),
        one("a vertex that is no number", grid("0 1 0 1 0 1", &cube.replacen("1 1 0", "1 nan 0", 1))),
    ]
}

fn vtp_cases() -> Vec<Case> {
    let one = |what, text: String| case("vtp", what, vec![("m.vtp", text.into_bytes())]);
    let array = |kind: &str, name: &str, text: &str| {
        format!("<DataArray type=\"{kind}\" Name=\"{name}\" format=\"ascii\">{text}</DataArray>")
    };
    let surface = |count: usize, corners: &str, ends: &str| {
        format!(
            "<VTKFile type=\"PolyData\"><PolyData><Piece NumberOfPoints=\"4\" NumberOfPolys=\"{count}\"><Points>{}</Points>\
             <Polys>{}{}</Polys></Piece></PolyData></VTKFile>",
            array("Float32", "Points", "0 0 0 1 0 0 0 1 0 0 0 1"),
            array("Int32", "connectivity", corners),
            array("Int32", "offsets", ends)
        )
    };
    let star: Vec<String> = (0..80).map(|i| (i * 7 % 4).to_string()).collect();
    vec![
        one("no faces", surface(0, "", "")),
        one("lines only", surface(2, "0 1 1 2", "2 4")),
        one("an index out of range", surface(2, "0 1 2 0 1 4", "3 6")),
        one("offsets that go back", surface(2, "0 1 2 0 1 3", "3 1")),
        one("offsets below zero", surface(1, "0 1 2", "-3")),
        one("a crossed polygon of 80 corners", surface(1, &star.join(" "), "80")),
    ]
}

fn vtk_mesh_cases() -> Vec<Case> {
    let one = |what, bytes| case("vtk-mesh", what, vec![("m.vtk", bytes)]);
    let text = |offsets: bool, pairs: &[(&str, &str)]| replaced(vtk(&small(), true, offsets), pairs);
    let cut = |offsets: bool, part: f64| {
        let mut file = vtk(&small(), false, offsets);
        file.truncate((file.len() as f64 * part) as usize);
        file
    };
    vec![
        one("a volume", text(true, &[("UNSTRUCTURED_GRID", "STRUCTURED_POINTS")])),
        one("version 9", text(true, &[("Version 5.1", "Version 9.0")])),
        one("no points", b"# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nCELLS 0 0\nCELL_TYPES 0\n".to_vec()),
        one("no cells", b"# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 1 float 0 0 0\n".to_vec()),
        one("no cell types", text(false, &[("CELL_TYPES 3\n10 13 10\n", "")])),
        one("fewer types than cells", text(false, &[("CELL_TYPES 3\n10 13 10\n", "CELL_TYPES 2\n10 13\n")])),
        one("two billion cells", text(false, &[("CELLS 3 17", "CELLS 2000000000 10000000000")])),
        one("two billion points", text(true, &[("POINTS 8", "POINTS 2000000000")])),
        one("more points than 32 bits count", text(true, &[("POINTS 8", "POINTS 5000000000")])),
        one("an index out of range", text(false, &[("4 0 1 2 4", "4 0 1 2 44")])),
        one("a negative index", text(true, &[("0 1 2 4 1 3", "0 1 2 -4 1 3")])),
        one("counts that reach too far", text(false, &[("4 0 1 2 4", "90 0 1 2 4")])),
        one("a negative count", text(false, &[("4 0 1 2 4", "-4 0 1 2 4")])),
        one("a type that nobody knows", text(true, &[("10 13 10", "10 130 10")])),
        one("a type beyond 8 bits", text(true, &[("10 13 10", "10 1300 10")])),
        one("an unknown keyword", text(true, &[("METADATA", "METADATE")])),
        one("an unknown data type", text(true, &[("8 float\n0 0 0", "8 quad\n0 0 0")])),
        one("a field array of the wrong length", text(true, &[("s 1 8 float", "s 1 7 float")])),
        one("attributes of other points", b"# vtk DataFile Version 3.0\nt\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 0 0 1\nCELLS 1 5\n4 0 1 2 3\nCELL_TYPES 1\n10\nPOINT_DATA 3\nSCALARS s float\nLOOKUP_TABLE default\n1 2 3\n".to_vec()),
        one("cut in its points", cut(true, 0.15)),
        one("cut in its cells", cut(false, 0.5)),
        one("cut in its attributes", cut(true, 0.95)),
        one("a structured grid of too few points", b"# vtk DataFile Version 3.0\nt\nASCII\nDATASET STRUCTURED_GRID\nDIMENSIONS 2 2 2\nPOINTS 4 float\n0 0 0 1 0 0 0 1 0 1 1 0\n".to_vec()),
        one("a surface of lines", b"# vtk DataFile Version 3.0\nt\nASCII\nDATASET POLYDATA\nPOINTS 2 float\n0 0 0 1 0 0\nLINES 1 3\n2 0 1\n".to_vec()),
    ]
}

fn plot3d_cases() -> Vec<Case> {
    let one = |what, bytes| case("plot3d", what, vec![("m.xyz", bytes)]);
    let layout = Plot3d { big: false, records: false, multi: false, double: false, iblank: false };
    let marked = Plot3d { records: true, multi: true, iblank: true, big: true, ..layout };
    let blocks = [block([3, 2, 2], 0.0)];
    let cut = |layout: Plot3d, bytes: usize| {
        let mut file = layout.grid(&blocks);
        let end = file.len() - bytes;
        file.truncate(end);
        file
    };
    let mut nan = block([3, 2, 2], 0.0);
    nan.1[7][0] = f32::NAN;
    let mut blanked = block([3, 2, 2], 0.0);
    blanked.2[1] = 0;
    let mut huge = 2_000_000_000i32.to_le_bytes().repeat(3);
    huge.extend([0; 1000]);
    vec![
        one("nothing", Vec::new()),
        one("text", b"3 2 2\n0 0 0\n".to_vec()),
        one("one byte short", cut(layout, 1)),
        one("one byte short, with record marks", cut(marked, 1)),
        one("2^93 vertices", huge),
        one("a vertex that is no number", layout.grid(&[nan])),
        one("a grid of two dimensions", layout.grid(&[block([3, 2, 1], 0.0)])),
        one("all blanked", Plot3d { iblank: true, ..layout }.grid(&[blanked])),
    ]
}

fn exodus_cases() -> Vec<Case> {
    let one = |what, bytes| case("exodus", what, vec![("m.exo", bytes)]);
    let classic = include_bytes!("../fixtures/mesh_classic.exo").to_vec();
    let hdf5 = include_bytes!("../fixtures/mesh_hdf5.exo").to_vec();
    let patch = |from: &[u8], to: &[u8]| {
        let mut file = classic.clone();
        let mut at = 0;
        while let Some(found) = file[at..].windows(from.len()).position(|w| w == from) {
            file[at + found..at + found + to.len()].copy_from_slice(to);
            at += found + to.len();
        }
        assert!(at > 0);
        file
    };
    // Dimensions stand as name and size.
    let size = |name: &str, to: u32| {
        let mut padded = name.as_bytes().to_vec();
        padded.resize(name.len().div_ceil(4) * 4, 0);
        let at = classic.windows(padded.len()).position(|w| w == padded).unwrap() + padded.len();
        let mut file = classic.clone();
        file[at..at + 4].copy_from_slice(&to.to_be_bytes());
        file
    };
    let corners = [1, 2, 5, 4, 7, 8, 11, 10u32].iter().flat_map(|n| n.to_be_bytes()).collect::<Vec<_>>();
    let wrong = |n: u32| patch(&corners, &n.to_be_bytes());
    vec![
        one("no NetCDF at all", b"CDX\x01 and more".to_vec()),
        one("cut in its head", classic[..200].to_vec()),
        one("cut in its data", classic[..classic.len() - 300].to_vec()),
        one("HDF5, cut", hdf5[..hdf5.len() / 2].to_vec()),
        one("NetCDF of something else", patch(b"num_nodes", b"num_modes")),
        one("two billion nodes", size("num_nodes", 2_000_000_000)),
        one("two billion elements in a block", size("num_el_in_blk1", 2_000_000_000)),
        one("two billion blocks", size("num_el_blk", 2_000_000_000)),
        one("two dimensions", size("num_dim", 2)),
        one("node 0", wrong(0)),
        one("a node out of range", wrong(14)),
        one("curved elements", patch(b"HEX8", b"HEXX")),
        one("a node that is no number", patch(&2.25f64.to_be_bytes(), &f64::NAN.to_be_bytes())),
    ]
}

fn surface_cases() -> Vec<Case> {
    let obj = |what, text: &str| case("obj", what, vec![("m.obj", text.as_bytes().to_vec())]);
    let from = |what, bytes| case("ply", what, vec![("m.ply", bytes)]);
    let stl = |what, bytes| case("stl", what, vec![("m.stl", bytes)]);
    let text = |pairs: &[(&str, &str)]| replaced(ply("ascii"), pairs);
    let binary = |pairs: &[(&[u8], &[u8])], cut: usize| {
        let mut file = ply("binary_little_endian");
        for (from, to) in pairs {
            let at = file.windows(from.len()).position(|w| w == *from).unwrap();
            file.splice(at..at + from.len(), to.iter().copied());
        }
        let end = file.len() - cut;
        file.truncate(end);
        file
    };
    let mut bad = tetrahedron();
    bad[2][1][0] = f32::NAN;
    let mut many = stl_binary(&tetrahedron(), "x");
    many[80..84].copy_from_slice(&2_000_000_000u32.to_le_bytes());
    let solid = |pairs: &[(&str, &str)]| replaced(stl_text(&tetrahedron(), "t"), pairs);
    vec![
        obj("nothing", ""),
        obj("no faces", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
        obj("a vertex of two numbers", &OBJ.replace("v 1 1 0", "v 1 1")),
        obj("a vertex of words", &OBJ.replace("v 1 1 0", "v 1 one 0")),
        obj("an index out of range", &OBJ.replace("f 1 2 5", "f 1 2 6")),
        obj("index 0", &OBJ.replace("f 1 2 5", "f 1 0 5")),
        obj("a negative index out of range", &OBJ.replace("f -4 -3 -1", "f -4 -6 -1")),
        obj("a normal out of range", &OBJ.replace("4/1/1", "4/1/2")),
        obj("a corner of words", &OBJ.replace("4/1/1", "4/1/x")),
        obj("an infinite vertex", &OBJ.replace("v 1 1 0", "v 1 1e999 0")),
        from("no PLY at all", b"plx\n".to_vec()),
        from("no end of the head", text(&[("end_header", "comment")])),
        from("no vertices", text(&[("element vertex 4", "element point 4")])),
        from("no z", text(&[("property float z", "property float height")])),
        from("no faces", text(&[("vertex_indices", "indices")])),
        from("two billion vertices", text(&[("element vertex 4", "element vertex 2000000000")])),
        from(
            "two billion faces of nothing",
            binary(
                &[(b"face 3\nproperty list uchar int vertex_indices\nproperty uchar quality\n", b"face 2000000000\n")],
                0,
            ),
        ),
        from("an index out of range", text(&[("3 0 2 1 7", "3 0 4 1 7")])),
        from("a negative index", text(&[("3 0 2 1 7", "3 0 -1 1 7")])),
        from("a row too short", text(&[("3 0 2 1 7", "3 0 2")])),
        from("a word among the numbers", text(&[("3 0 2 1 7", "3 0 two 1 7")])),
        from("a vertex that is no number", text(&[("0.25 0.25 2", "0.25 nan 2")])),
        from("cut in its faces", binary(&[], 20)),
        from("a list of 4 billion corners", binary(&[(b"uchar int vertex_indices", b"uint int vertex_indices")], 0)),
        stl("nothing", Vec::new()),
        stl("two billion triangles", many),
        stl("cut in its triangles", stl_binary(&tetrahedron(), "x")[..200].to_vec()),
        stl("no triangles", stl_binary(&[], "x")),
        stl("a vertex that is no number", stl_binary(&bad, "x")),
        stl("text: cut in a triangle", stl_text(&tetrahedron(), "t")[..120].to_vec()),
        stl("text: four corners", solid(&[("    endloop", "      vertex 0 0 0\n    endloop")])),
        stl("text: a word among the numbers", solid(&[("vertex 1 0 0", "vertex 1 zero 0")])),
        stl("text: an infinite vertex", solid(&[("vertex 1 0 0", "vertex 1 inf 0")])),
    ]
}

pub fn cases() -> Vec<Case> {
    [vtu_cases(), vts_cases(), vtp_cases(), vtk_mesh_cases(), plot3d_cases(), exodus_cases(), surface_cases()]
        .into_iter()
        .flatten()
        .collect()
}
