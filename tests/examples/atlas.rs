//! Measures the atlas of failure and writes `stability.md` with its charts into a folder:
//! `cargo run -p volact-conformance --example atlas -- docs`.

use std::{error::Error, fs, path::Path};

use volact_conformance::{
    atlas::{Curve, Family, Lab, families, page},
    rig::registry,
};

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("wanted the folder to write stability.md to")?;
    let mut registry = registry();
    volact_wgpu::register(&mut registry)?;
    volact_vulkan::register(&mut registry)?;
    let lab = Lab::new(&registry)?;
    let measured: Vec<(Family, Vec<Vec<Curve>>)> = families().into_iter().map(|f| climb(&lab, f)).collect();
    let charts = Path::new(&folder).join("stability");
    fs::create_dir_all(&charts)?;
    for (family, ladders) in &measured {
        for (ladder, curves) in family.ladders.iter().zip(ladders) {
            fs::write(charts.join(ladder.name).with_extension("svg"), page::chart(ladder, curves).svg())?;
        }
    }
    fs::write(Path::new(&folder).join("stability.md"), page::markdown(&measured))?;
    Ok(())
}

fn climb(lab: &Lab, family: Family) -> (Family, Vec<Vec<Curve>>) {
    let climb = |ladder: &volact_conformance::atlas::Ladder| {
        println!("{}: {}", page::heading(&family), ladder.title);
        let curves = ladder.climb(lab);
        curves.iter().flat_map(Curve::problems).for_each(|problem| println!("  not as said: {problem}"));
        curves
    };
    let ladders = family.ladders.iter().map(climb).collect();
    (family, ladders)
}
