//! `cargo xtask mesh-peers`: VTK's mappers of unstructured grids and `cpu` on the same meshes,
//! cameras and tables in one run, in turn, with `reference` as the truth of both.

use std::{
    collections::BTreeMap,
    env,
    fmt::Write as _,
    fs,
    path::{Path, PathBuf},
    process::Command,
    time::Instant,
};

use anyhow::{Context, Result, bail};
use serde::Deserialize;
use volact_core::{
    Appearance, Attribute, Camera, Frame, FrameDesc, MeshData, Options, Points, Registry, RenderAction, ScalarType,
    Shape, StructuredMesh, View,
    glam::{DAffine3, DVec3},
};
use volact_files::picture;

use crate::{
    peer_scene::{interpolate, table},
    peers::{median, replace},
};

const BEGIN: &str = "<!-- mesh-peers: begin -->";
const END: &str = "<!-- mesh-peers: end -->";
/// The mapper that integrates, and the one that approximates.
const MAPPERS: [&str; 2] = ["linear-ray-cast", "projected-tetrahedra"];
/// How many times as fast as the first of them `cpu` is to be.
const TIMES: f64 = 8.0;
/// Cells a side of grids that show how cost grows.
const GRIDS: [usize; 4] = [12, 24, 48, 96];

/// Arguments of `mesh-peers`.
#[derive(clap::Args)]
pub struct Args {
    /// The python of the peers' virtual environment (its setup.sh makes it); without it only
    /// `cpu` is timed, on the scenes of an earlier run.
    #[arg(long)]
    python: Option<PathBuf>,
    /// Rows and columns of the pictures.
    #[arg(long, default_value_t = 512)]
    size: usize,
    /// How often all take their turn.
    #[arg(long, default_value_t = 3)]
    rounds: usize,
    /// Frames of `cpu` a turn.
    #[arg(long, default_value_t = 9)]
    frames: usize,
    /// Draw the truth anew instead of taking that of an earlier run.
    #[arg(long)]
    fresh: bool,
    /// Where pictures, truth and rows go.
    #[arg(long, default_value = "target/mesh-peers")]
    out: PathBuf,
    /// The document whose marked part is replaced; none without it.
    #[arg(long)]
    report: Option<PathBuf>,
}

/// One line of the peers' driver.
#[derive(Clone, Debug, Deserialize)]
struct Row {
    mesh: String,
    tetrahedra: u64,
    ms: f64,
    array: String,
    opacity: Vec<[f64; 2]>,
    colour: Vec<[f64; 4]>,
    unit_distance: f64,
    camera: PeerCamera,
}

#[derive(Clone, Debug, Deserialize)]
struct PeerCamera {
    eye: [f64; 3],
    center: [f64; 3],
    up: [f64; 3],
    fovy: f64,
}

/// How far a picture is from the truth.
#[derive(Clone, Copy, Debug)]
struct Wrong {
    rmse: f64,
    max: f64,
}

/// A mesh with an action that draws it.
struct Own {
    row: Row,
    desc: FrameDesc,
    shape: Shape,
    action: Box<dyn RenderAction>,
    truth: Vec<[f32; 3]>,
    wrong: Wrong,
    /// What peers would draw that take opacity over the unit as extinction.
    meant: Vec<[f32; 3]>,
    cost: Cost,
    ms: Vec<f64>,
}

/// What drawing a mesh costs.
struct Cost {
    name: String,
    tetrahedra: u64,
    ms: f64,
    first_ms: f64,
    bytes: usize,
    rays: u64,
    crossings: u64,
}

/// Runs the comparison and writes the table.
pub fn run(args: &Args) -> Result<()> {
    let data = PathBuf::from(env::var_os("VOLACT_DATA").context("VOLACT_DATA is not set: the folder of real meshes")?);
    fs::create_dir_all(&args.out).with_context(|| format!("{}: cannot be made", args.out.display()))?;
    let mut theirs: BTreeMap<(String, String), Vec<f64>> = BTreeMap::new();
    let mut own: Vec<Own> = Vec::new();
    for _ in 0..args.rounds.max(1) {
        for mapper in MAPPERS {
            let rows = rows(args, mapper)?;
            for row in &rows {
                theirs.entry((row.mesh.clone(), mapper.into())).or_default().push(row.ms);
            }
            if own.is_empty() {
                own = rows.into_iter().map(|row| prepare(row, args, &data)).collect::<Result<_>>()?;
            }
            for one in &mut own {
                for _ in 0..args.frames.max(1) {
                    let (_, ms) = draw(&mut *one.action, &one.desc, &one.shape)?;
                    one.ms.push(ms);
                }
                one.cost.ms = median(&one.ms);
                println!("{:24} cpu {:8.1} ms", one.row.mesh, one.cost.ms);
            }
        }
    }
    let mut table = String::from(
        "| mesh | tetrahedra | mapper | ms | RMSE | max | RMSE, opacity/unit as extinction | cpu, ms | RMSE | max \
         | times as fast | wanted |\n|---|---|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for one in &own {
        for mapper in MAPPERS {
            let key = (one.row.mesh.clone(), mapper.to_owned());
            let ms = median(theirs.get(&key).map_or(&[][..], Vec::as_slice));
            let [wrong, meant] = theirs_wrong(one, mapper, args)?;
            let wanted = if mapper == MAPPERS[0] { TIMES } else { 1.0 };
            let (mine, times) = (median(&one.ms), ms / median(&one.ms));
            let _ = writeln!(
                table,
                "| {} | {} | {mapper} | {ms:.0} | {:.1e} | {:.1e} | {:.1e} | {mine:.1} | {:.1e} | {:.1e} | {times:.1} | {wanted} |",
                one.row.mesh, one.row.tetrahedra, wrong.rmse, wrong.max, meant.rmse, one.wrong.rmse, one.wrong.max
            );
        }
    }
    table.push_str(&prepared(&own));
    table.push_str(&growth(args)?);
    println!("{table}");
    match &args.report {
        Some(report) => replace(report, [BEGIN, END], &table),
        None => Ok(()),
    }
}
/// The driver's rows of one mapper, or those of an earlier run.
fn rows(args: &Args, mapper: &str) -> Result<Vec<Row>> {
    let kept = args.out.join(format!("{mapper}.jsonl"));
    if let Some(python) = &args.python {
        let peers = env::var_os("VOLACT_PEERS").context("VOLACT_PEERS is not set: the folder of the peers' driver")?;
        let out = env::current_dir()?.join(&args.out);
        let mut command = Command::new(python);
        command.current_dir(&peers).args(["mesh_peers.py", "--size", &args.size.to_string(), "--mappers", mapper]);
        let output =
            command.arg("--out").arg(&out).output().with_context(|| format!("{}: cannot be run", python.display()))?;
        if !output.status.success() {
            bail!("the peers' driver failed: {}\n{}", output.status, String::from_utf8_lossy(&output.stderr));
        }
        fs::write(&kept, output.stdout).with_context(|| format!("{}: cannot be written", kept.display()))?;
    }
    let text = fs::read_to_string(&kept).with_context(|| format!("{}: cannot be read", kept.display()))?;
    let rows: Vec<Row> = text
        .lines()
        .map(|line| serde_json::from_str(line).with_context(|| format!("the peers' driver said {line:?}")))
        .collect::<Result<_>>()?;
    rows.iter().for_each(|r| println!("{:24} {mapper} {:8.1} ms", r.mesh, r.ms));
    Ok(rows)
}

/// Reads a mesh and draws it for the first time; the truth, too, where it is not known.
fn prepare(row: Row, args: &Args, data: &Path) -> Result<Own> {
    let mut registry = Registry::with_core();
    volact_cpu::register(&mut registry)?;
    for loader in volact_files::loaders() {
        registry.add_loader(loader)?;
    }
    let mesh = mesh(&registry, &data.join(&row.mesh))?;
    let attribute = mesh.attribute(&row.array).with_context(|| format!("{} has no {:?}", row.mesh, row.array))?;
    let look = table(&row.colour, &row.opacity)?;
    let appearance = Appearance::new("attribute")
        .with("scalars", attribute.clone())
        .with("lookup_table", look)
        .with("unit_distance", row.unit_distance);
    let shape = Shape::build(&row.mesh, mesh.geometry.clone(), appearance, DAffine3::IDENTITY);
    let c = &row.camera;
    let camera = Camera::perspective(c.eye.into(), c.center.into(), DVec3::from(c.up), c.fovy);
    let desc = FrameDesc::new(camera, args.size, args.size);
    let path = args.out.join(format!("{}-truth-{}.npy", row.mesh, args.size));
    if args.fresh || !path.exists() {
        let mut reference = registry.action("reference", &Options::default())?;
        reference.manage(&shape)?;
        let (frame, ms) = draw(&mut *reference, &desc, &shape)?;
        let certificate = frame.statistics.details.iter().find(|d| d.0 == "certificate").map_or("", |d| d.1.as_str());
        println!("{:24} reference {:.1} s: {certificate}", row.mesh, ms / 1e3);
        picture::save_npy(&path, &frame)?;
    }
    let truth = read(&path, args.size)?;
    let mut action = registry.action("cpu", &Options::default())?;
    action.manage(&shape)?;
    let (frame, first_ms) = draw(&mut *action, &desc, &shape)?;
    picture::save_npy(&args.out.join(format!("{}-cpu.npy", row.mesh)), &frame)?;
    let mine: Vec<[f32; 3]> = frame.color.iter().map(|c| [c[0], c[1], c[2]]).collect();
    let stats = &frame.statistics;
    let cost = Cost {
        name: row.mesh.clone(),
        tetrahedra: mesh.geometry.tessellate()?.tetrahedra.len() as u64,
        ms: 0.0,
        first_ms,
        bytes: stats.resident_bytes,
        rays: stats.rays,
        crossings: stats.samples,
    };
    let wrong = wrong(&mine, &truth);
    // Opacity a over the unit as extinction a/unit: the table of 1 − e^(−a).
    let (first, last) = (row.opacity[0][0], row.opacity[row.opacity.len() - 1][0]);
    let fine: Vec<[f64; 2]> = (0..=4096)
        .map(|i| first + (last - first) * f64::from(i) / 4096.0)
        .map(|v| [v, -(-interpolate(&row.opacity, v)).exp_m1()])
        .collect();
    let other = Shape::build(&row.mesh, shape.state().geometry, Appearance::new("attribute"), DAffine3::IDENTITY);
    shape.state().parameters.into_iter().for_each(|(name, value)| other.set_parameter(name, value));
    other.set_parameter("lookup_table", table(&row.colour, &fine)?);
    let mut second = registry.action("cpu", &Options::default())?;
    second.manage(&other)?;
    let (frame, _) = draw(&mut *second, &desc, &other)?;
    let meant = frame.color.iter().map(|c| [c[0], c[1], c[2]]).collect();
    Ok(Own { row, desc, shape, action, truth, wrong, meant, cost, ms: Vec::new() })
}

const PREPARED: &str = "\n| mesh | tetrahedra | cells met a ray | ms | ns a cell met | first frame, ms \
    | ms more, per million tetrahedra | bytes a tetrahedron, besides the input |\n|---|---|---|---|---|---|---|---|\n";

/// What frames cost by the cells that rays meet, and what the first one does besides.
fn prepared(own: &[Own]) -> String {
    let mut table = String::from(PREPARED);
    own.iter().for_each(|one| line(&mut table, &one.cost));
    table
}

fn line(table: &mut String, one: &Cost) {
    let (ms, count) = (one.ms, one.tetrahedra as f64);
    let (more, bytes) = ((one.first_ms - ms) / count * 1e6, one.bytes as f64 / count);
    let (met, each) = (one.crossings as f64 / one.rays.max(1) as f64, ms * 1e6 / one.crossings.max(1) as f64);
    let _ = writeln!(
        table,
        "| {} | {} | {met:.0} | {ms:.1} | {each:.1} | {:.0} | {more:.0} | {bytes:.0} |",
        one.name, one.tetrahedra, one.first_ms
    );
}

/// The same field on finer and finer grids of a cube.
fn growth(args: &Args) -> Result<String> {
    let mut registry = Registry::with_core();
    volact_cpu::register(&mut registry)?;
    let mut text = format!("\nA smooth field on grids of a cube:\n{PREPARED}");
    for n in GRIDS {
        let at = |i: usize| i as f32 / n as f32;
        let side = 0..=n;
        let points: Vec<[f32; 3]> = side
            .clone()
            .flat_map(|z| side.clone().flat_map(move |y| (0..=n).map(move |x| [at(x), at(y), at(z)])))
            .collect();
        let field = |p: &[f32; 3]| (3.0 * p[0]).sin() * (2.0 * p[1]).cos() + p[2] * p[2];
        let values: Vec<f32> = points.iter().map(field).collect();
        let mesh = StructuredMesh::new([n + 1; 3], Points::new(ScalarType::F32, points.concat().into())?)?;
        let appearance = Appearance::new("attribute")
            .with("scalars", Attribute::new("field", ScalarType::F32, 1, values.into())?)
            .with("lookup_table", table(&[[-1.0, 0.0, 0.0, 1.0], [2.0, 1.0, 0.5, 0.0]], &[[-1.0, 0.0], [2.0, 0.5]])?)
            .with("unit_distance", 0.5);
        let shape = Shape::new(mesh, appearance);
        let desc = FrameDesc::fit(&shape, View::Iso, args.size, args.size);
        let mut action = registry.action("cpu", &Options::default())?;
        action.manage(&shape)?;
        let (frame, first_ms) = draw(&mut *action, &desc, &shape)?;
        let ms =
            (0..args.frames.max(1)).map(|_| Ok(draw(&mut *action, &desc, &shape)?.1)).collect::<Result<Vec<_>>>()?;
        let stats = &frame.statistics;
        let one = Cost {
            name: format!("{n}³ cubes"),
            tetrahedra: 6 * (n * n * n) as u64,
            ms: median(&ms),
            first_ms,
            bytes: stats.resident_bytes,
            rays: stats.rays,
            crossings: stats.samples,
        };
        line(&mut text, &one);
    }
    Ok(text)
}

/// The only mesh in a folder.
fn mesh(registry: &Registry, folder: &Path) -> Result<MeshData> {
    let entries = fs::read_dir(folder).with_context(|| format!("{}: cannot be read", folder.display()))?;
    let mesh = |p: &PathBuf| matches!(p.extension().and_then(|e| e.to_str()), Some("vtu" | "vts"));
    let mut paths: Vec<_> = entries.filter_map(|e| Some(e.ok()?.path())).filter(mesh).collect();
    paths.sort();
    let path = paths.first().with_context(|| format!("{}: has no .vtu or .vts file", folder.display()))?;
    Ok(registry.load_mesh(path)?)
}

fn draw(action: &mut dyn RenderAction, desc: &FrameDesc, shape: &Shape) -> Result<(Frame, f64)> {
    let start = Instant::now();
    action.begin_draw(desc)?;
    action.draw(shape)?;
    let frame = action.end_draw()?;
    Ok((frame, start.elapsed().as_secs_f64() * 1e3))
}

/// Colours over black.
fn read(path: &Path, size: usize) -> Result<Vec<[f32; 3]>> {
    let picture = picture::load_picture(path)?;
    if [picture.width, picture.height] != [size; 2] {
        bail!("{}: has {} x {} pixels, wanted {size} x {size}", path.display(), picture.width, picture.height);
    }
    Ok(picture.rgba.iter().map(|c| [c[0], c[1], c[2]]).collect())
}

/// How far a peer's picture is from the truth, and from what it may have meant.
fn theirs_wrong(one: &Own, mapper: &str, args: &Args) -> Result<[Wrong; 2]> {
    let picture = read(&args.out.join(format!("{}_{mapper}.npy", one.row.mesh)), args.size)?;
    // VTK's CPU mappers draw 512/511 too bright: that is not held against them.
    let scale = if mapper == MAPPERS[0] { 511.0 / 512.0 } else { 1.0 };
    let mended: Vec<_> = picture.iter().map(|c| c.map(|v| v * scale)).collect();
    Ok([&one.truth, &one.meant].map(|truth| {
        let [plain, mended] = [wrong(&picture, truth), wrong(&mended, truth)];
        if mended.rmse < plain.rmse { mended } else { plain }
    }))
}

fn wrong(picture: &[[f32; 3]], truth: &[[f32; 3]]) -> Wrong {
    let all = picture.iter().flatten().zip(truth.iter().flatten()).map(|(a, b)| f64::from(a - b).abs());
    let (sum, max) = all.clone().fold((0.0, 0.0f64), |(sum, max), d| (sum + d * d, max.max(d)));
    Wrong { rmse: (sum / (3 * truth.len()) as f64).sqrt(), max }
}
