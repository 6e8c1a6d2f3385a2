//! The volumes of a scene as NRRD files (<https://teem.sourceforge.net/nrrd/format.html>).

use volact_core::{ParameterValue, ScalarType, Shape, Volume};

/// The volumes of a scene under the names that its text gives them.
#[derive(Debug, Default)]
pub struct Volumes(Vec<Volume>);

impl Volumes {
    /// Those of these shapes, each once.
    pub fn of(shapes: &[Shape]) -> Self {
        let mut found: Vec<Volume> = Vec::new();
        for shape in shapes {
            for value in shape.state().parameters.values() {
                if let ParameterValue::Volume(texture) = value
                    && !found.iter().any(|v| v.id() == texture.volume().id())
                {
                    found.push(texture.volume().clone());
                }
            }
        }
        Self(found)
    }

    /// The name of one; empty for one of another scene.
    pub fn name(&self, volume: &Volume) -> String {
        self.0.iter().position(|v| v.id() == volume.id()).map_or(String::new(), |i| format!("volume{i}"))
    }

    /// All of them with their names.
    pub fn iter(&self) -> impl Iterator<Item = (String, &Volume)> {
        self.0.iter().enumerate().map(|(i, v)| (format!("volume{i}"), v))
    }
}

/// A volume as an NRRD file: stored numbers, spacing, no placement.
pub fn nrrd(volume: &Volume) -> Vec<u8> {
    let desc = volume.desc();
    let [x, y, z] = desc.dims;
    let s = desc.spacing;
    let vectors = desc.components > 1;
    let (lead, gap) = if vectors { (format!("{} ", desc.components), "nan ") } else { (String::new(), "") };
    let kinds = if vectors { "kinds: vector domain domain domain\n" } else { "" };
    let endian = if cfg!(target_endian = "little") { "little" } else { "big" };
    let mut file = format!(
        "NRRD0004\ntype: {}\ndimension: {}\nsizes: {lead}{x} {y} {z}\nspacings: {gap}{} {} {}\n{kinds}endian: {endian}\n\
         encoding: raw\n\n",
        type_name(desc.scalar),
        3 + usize::from(vectors),
        s.x,
        s.y,
        s.z
    )
    .into_bytes();
    if desc.scalar == ScalarType::F16 {
        // The format has no such type; f32 holds the same numbers.
        let count = x * y * z * desc.components;
        let bytes = volume.data().bytes();
        file.extend((0..count).flat_map(|i| (desc.scalar.read(bytes, i) as f32).to_ne_bytes()));
    } else {
        file.extend_from_slice(volume.data().bytes());
    }
    file
}

fn type_name(scalar: ScalarType) -> &'static str {
    match scalar {
        ScalarType::U8 => "uint8",
        ScalarType::I8 => "int8",
        ScalarType::U16 => "uint16",
        ScalarType::I16 => "int16",
        ScalarType::U32 => "uint32",
        ScalarType::I32 => "int32",
        ScalarType::F16 | ScalarType::F32 => "float",
        ScalarType::F64 => "double",
    }
}
