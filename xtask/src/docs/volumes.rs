//! Small volumes in every format, by the rules of `examples/generate.rs`.

use anyhow::Result;

use super::File;

#[path = "../../../examples/generate.rs"]
#[expect(dead_code, reason = "only the rules of the volumes are used")]
mod generate;

use generate::{EXAMPLES, Example};

/// A coarser grid of an example.
fn coarse(index: usize, dims: [usize; 3], spacing: f64) -> Example {
    Example { dims, spacing, ..EXAMPLES[index] }
}

/// All files.
pub fn files() -> Result<Vec<File>> {
    let signal = coarse(0, [48; 3], 2.0 / 47.0);
    let head = coarse(1, [52, 64, 66], 3.3);
    let part = coarse(2, [72, 48, 48], 4.0 / 3.0);
    let mut files = vec![
        ("head.nii", nifti(&head)),
        ("part.mha", metaimage(&part)),
        ("signal.raw.ron", raw_header(&signal)),
        ("signal.raw", signal.voxels()),
        ("head.tif", tiff(&head)),
        ("part.vti", vti(&part)),
        ("head.vtk", vtk(&head)),
        ("labels.nrrd", labels(&head)),
        ("spots.nrrd", spots(&head)),
        ("colour.nrrd", colour()),
    ];
    for (z, slice) in slices(&head).enumerate() {
        files.push((leak(format!("head/{z:03}.dcm")), dicom(&head, z, slice)));
    }
    for (z, slice) in slices(&part).enumerate() {
        files.push((leak(format!("slices/{z:03}.png")), png(&part, &slice)?));
    }
    Ok(files)
}

/// Names are few, and live as long as the program.
fn leak(name: String) -> &'static str {
    Box::leak(name.into_boxed_str())
}

fn slices(example: &Example) -> impl Iterator<Item = Vec<u8>> {
    let size = example.dims[0] * example.dims[1];
    let voxels = example.voxels();
    (0..example.dims[2]).map(move |z| voxels[z * size..(z + 1) * size].to_vec())
}

fn origin(example: &Example) -> [f64; 3] {
    example.dims.map(|n| -((n - 1) as f64) / 2.0 * example.spacing)
}

fn words<T: ToString>(values: impl IntoIterator<Item = T>) -> String {
    values.into_iter().map(|v| v.to_string()).collect::<Vec<_>>().join(" ")
}

fn metaimage(e: &Example) -> Vec<u8> {
    let header = format!(
        "ObjectType = Image\nNDims = 3\nDimSize = {}\nElementSpacing = {}\nOffset = {}\nElementType = MET_UCHAR\n\
         ElementDataFile = LOCAL\n",
        words(e.dims),
        words([e.spacing; 3]),
        words(origin(e)),
    );
    [header.into_bytes(), e.voxels()].concat()
}

/// NIfTI-1, little-endian; its world has x and y the other way round.
fn nifti(e: &Example) -> Vec<u8> {
    let mut h = vec![0u8; 352];
    let mut put = |at: usize, bytes: &[u8]| h[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &348i32.to_le_bytes());
    let dims = e.dims.map(|n| n as i16);
    for (n, v) in [3, dims[0], dims[1], dims[2], 1, 1, 1, 1].iter().enumerate() {
        put(40 + 2 * n, &v.to_le_bytes());
    }
    put(70, &2i16.to_le_bytes());
    put(72, &8i16.to_le_bytes());
    let s = e.spacing as f32;
    for (n, v) in [1.0, s, s, s].iter().enumerate() {
        put(76 + 4 * n, &v.to_le_bytes());
    }
    put(108, &352f32.to_le_bytes());
    put(112, &1f32.to_le_bytes());
    put(254, &1i16.to_le_bytes());
    let [x, y, z] = origin(e).map(|v| v as f32);
    let rows = [[-s, 0.0, 0.0, -x], [0.0, -s, 0.0, -y], [0.0, 0.0, s, z]];
    for (n, v) in rows.iter().flatten().enumerate() {
        put(280 + 4 * n, &v.to_le_bytes());
    }
    put(344, b"n+1\0");
    [h, e.voxels()].concat()
}

fn raw_header(e: &Example) -> Vec<u8> {
    let ([x, y, z], s, [a, b, c]) = (e.dims, e.spacing, origin(e));
    format!(
        "RawVolume(file: \"signal.raw\", dims: ({x}, {y}, {z}), scalar: \"u8\", spacing: ({s:?}, {s:?}, {s:?}), \
         origin: ({a:?}, {b:?}, {c:?}))\n"
    )
    .into_bytes()
}

/// Uncompressed pages.
fn tiff(e: &Example) -> Vec<u8> {
    let [width, height] = [e.dims[0] as u32, e.dims[1] as u32];
    let mut out = b"II*\0\0\0\0\0".to_vec();
    let mut link = 4;
    for page in slices(e) {
        let data = out.len() as u32;
        out.extend(&page);
        out.resize(out.len().next_multiple_of(2), 0);
        let at = out.len() as u32;
        out[link..link + 4].copy_from_slice(&at.to_le_bytes());
        let entries: [(u16, u16, u32); 8] = [
            (256, 4, width),
            (257, 4, height),
            (258, 3, 8),
            (259, 3, 1),
            (262, 3, 1),
            (273, 4, data),
            (278, 4, height),
            (279, 4, page.len() as u32),
        ];
        out.extend((entries.len() as u16).to_le_bytes());
        for (tag, kind, value) in entries {
            out.extend(tag.to_le_bytes());
            out.extend(kind.to_le_bytes());
            out.extend(1u32.to_le_bytes());
            out.extend(value.to_le_bytes());
        }
        link = out.len();
        out.extend([0; 4]);
    }
    out
}

fn png(e: &Example, slice: &[u8]) -> Result<Vec<u8>> {
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, e.dims[0] as u32, e.dims[1] as u32);
    encoder.set_color(png::ColorType::Grayscale);
    let mut writer = encoder.write_header()?;
    writer.write_image_data(slice)?;
    writer.finish()?;
    Ok(out)
}

fn vti(e: &Example) -> Vec<u8> {
    let extent = e.dims.map(|n| format!("0 {}", n - 1)).join(" ");
    format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\">\n<ImageData \
         WholeExtent=\"{extent}\" Origin=\"{}\" Spacing=\"{}\">\n<Piece Extent=\"{extent}\">\n<PointData \
         Scalars=\"s\">\n<DataArray type=\"UInt8\" Name=\"s\" format=\"ascii\">\n{}\n</DataArray>\n</PointData>\n</Piece>\n\
         </ImageData>\n</VTKFile>\n",
        words(origin(e)),
        words([e.spacing; 3]),
        words(e.voxels()),
    )
    .into_bytes()
}

fn vtk(e: &Example) -> Vec<u8> {
    let header = format!(
        "# vtk DataFile Version 3.0\nby rule\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS {}\nSPACING {}\nORIGIN {}\n\
         POINT_DATA {}\nSCALARS s unsigned_char 1\nLOOKUP_TABLE default\n",
        words(e.dims),
        words([e.spacing; 3]),
        words(origin(e)),
        e.dims.iter().product::<usize>(),
    );
    [header.into_bytes(), e.voxels()].concat()
}

/// A slice in explicit little-endian, of the fewest elements that a series needs.
fn dicom(e: &Example, z: usize, slice: Vec<u8>) -> Vec<u8> {
    let [x, y, low] = origin(e);
    let place = format!("{x}\\{y}\\{}", low + z as f64 * e.spacing);
    let mut out = vec![0; 128];
    out.extend(b"DICM");
    let mut put = |group: u16, element: u16, kind: &[u8; 2], value: &[u8]| {
        let mut value = value.to_vec();
        if value.len() % 2 == 1 {
            value.push(if kind == b"UI" || kind == b"OB" { 0 } else { b' ' });
        }
        out.extend(group.to_le_bytes());
        out.extend(element.to_le_bytes());
        out.extend(kind);
        match kind {
            b"OB" | b"OW" => {
                out.extend([0, 0]);
                out.extend((value.len() as u32).to_le_bytes());
            }
            _ => out.extend((value.len() as u16).to_le_bytes()),
        }
        out.extend(value);
    };
    put(2, 0x0010, b"UI", b"1.2.840.10008.1.2.1");
    put(8, 0x0060, b"CS", b"CT");
    put(0x20, 0x000e, b"UI", b"1.2.3.4");
    put(0x20, 0x0032, b"DS", place.as_bytes());
    put(0x20, 0x0037, b"DS", b"1\\0\\0\\0\\1\\0");
    put(0x28, 0x0002, b"US", &1u16.to_le_bytes());
    put(0x28, 0x0004, b"CS", b"MONOCHROME2");
    put(0x28, 0x0010, b"US", &(e.dims[1] as u16).to_le_bytes());
    put(0x28, 0x0011, b"US", &(e.dims[0] as u16).to_le_bytes());
    put(0x28, 0x0030, b"DS", format!("{0}\\{0}", e.spacing).as_bytes());
    put(0x28, 0x0100, b"US", &16u16.to_le_bytes());
    put(0x28, 0x0101, b"US", &16u16.to_le_bytes());
    put(0x28, 0x0102, b"US", &15u16.to_le_bytes());
    put(0x28, 0x0103, b"US", &0u16.to_le_bytes());
    let pixels: Vec<u8> = slice.into_iter().flat_map(|v| u16::from(v).to_le_bytes()).collect();
    put(0x7fe0, 0x0010, b"OW", &pixels);
    out
}

/// A volume of numbers by a rule of the position, on the grid of an example.
fn nrrd(e: &Example, components: usize, value: impl Fn([f64; 3]) -> Vec<u8>) -> Vec<u8> {
    let (s, o, [x, y, z]) = (e.spacing, origin(e), e.dims);
    let (dimension, sizes, kinds, none) = match components {
        1 => (3, String::new(), "domain domain domain", ""),
        n => (4, format!("{n} "), "vector domain domain domain", "none "),
    };
    let header = format!(
        "NRRD0005\ntype: uint8\ndimension: {dimension}\nspace: left-posterior-superior\nsizes: {sizes}{x} {y} {z}\n\
         kinds: {kinds}\nspace directions: {none}({s},0,0) (0,{s},0) (0,0,{s})\nspace origin: ({},{},{})\nencoding: raw\n\n",
        o[0], o[1], o[2]
    );
    let at = |i: usize| [i % x, i / x % y, i / (x * y)];
    let place = |i: usize| std::array::from_fn(|a| o[a] + s * at(i)[a] as f64);
    [header.into_bytes(), (0..x * y * z).flat_map(|i| value(place(i))).collect()].concat()
}

fn within([x, y, z]: [f64; 3], middle: [f64; 3], radii: [f64; 3]) -> f64 {
    let part = |v: f64, i: usize| ((v - middle[i]) / radii[i]).powi(2);
    (part(x, 0) + part(y, 1) + part(z, 2)).sqrt()
}

/// Parts of the head by number: 1 to 4 the brain's quarters, 5 what is as dense as bone.
fn labels(head: &Example) -> Vec<u8> {
    nrrd(head, 1, |p| {
        let quarter = 1 + u8::from(p[0] > 0.0) + 2 * u8::from(p[1] > 4.0);
        let brain = within(p, [0.0, 6.0, 32.0], [56.0, 72.0, 60.0]) < 1.0 && p[0].abs() > 1.7;
        vec![match brain {
            true => quarter,
            false if (head.value)(p) > 180.0 => 5,
            false => 0,
        }]
    })
}

/// Two bright spots in the head.
fn spots(head: &Example) -> Vec<u8> {
    nrrd(head, 1, |p| {
        let spot = |middle, radius| (1.0 - within(p, middle, [radius; 3])).max(0.0);
        vec![(255.0 * (spot([34.0, -22.0, 44.0], 30.0) + spot([-20.0, 30.0, 58.0], 24.0))).min(255.0) as u8]
    })
}

/// Colours with opacity: a ball whose hue turns with the direction, hollow and cut open.
fn colour() -> Vec<u8> {
    let grid = Example { dims: [40; 3], spacing: 1.0, ..EXAMPLES[0] };
    nrrd(&grid, 4, |p| {
        let r = within(p, [0.0; 3], [18.0; 3]);
        let shell = (1.0 - ((r - 0.8) / 0.16).abs()).max(0.0);
        let open = p[0] > 0.0 && p[1] < 0.0 && p[2] > 0.0;
        let hue = |turn: f64| 255.0 * (0.5 + 0.5 * (p[1].atan2(p[0]) + 0.12 * p[2] + turn).cos());
        let third = std::f64::consts::TAU / 3.0;
        let opacity = if open { 0.0 } else { 200.0 * shell };
        [hue(0.0), hue(third), hue(2.0 * third), opacity].map(|v| v as u8).to_vec()
    })
}
