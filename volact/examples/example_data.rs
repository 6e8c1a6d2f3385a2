//! Writes the data sets of `examples/` anew: `cargo run --example example_data -- examples`.

use std::{fs, io, path::PathBuf};

#[path = "../../examples/generate.rs"]
mod generate;

fn main() -> io::Result<()> {
    let folder = PathBuf::from(std::env::args_os().nth(1).unwrap_or_else(|| "examples".into()));
    for example in generate::EXAMPLES {
        let path = folder.join(example.path);
        fs::create_dir_all(path.parent().unwrap_or(&folder))?;
        fs::write(&path, example.nrrd())?;
        println!("{}: {:?} samples", path.display(), example.dims);
    }
    for (name, made) in generate::FILES {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap_or(&folder))?;
        fs::write(&path, made())?;
        println!("{}", path.display());
    }
    Ok(())
}
