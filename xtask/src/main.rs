//! What people who work on Volact repeat: `cargo xtask --help`.

mod check;
mod docs;
mod evaluator;
mod gpu_report;
mod header;
mod mesh_peers;
mod new_plugin;
mod packages;
mod peer;
mod peer_scene;
mod peers;
mod scaling;

use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(name = "cargo xtask", about = "What people who work on Volact repeat")]
struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Run the whole test suite.
    Test,
    /// Run the suite, the formatter, the linter and the documentation, as .ci/run does.
    Check,
    /// Hold the project's own actions to the contract, and see that faults made in them are caught.
    Conformance,
    /// Draw one scene of the peers' folder and print its row.
    Peer(peer::Args),
    /// Compare with other renderers in one run, interleaved, and write the tables.
    Peers(peers::Args),
    /// Compare with VTK's mappers of unstructured grids on real meshes, in turn, and write the table.
    MeshPeers(mesh_peers::Args),
    /// Write docs/reference anew: pages and pictures of all that is registered.
    Docs(docs::Args),
    /// Generate the C header of the plugin boundary.
    Header,
    /// Make a plugin's crate that builds, tests itself and draws something.
    NewPlugin(new_plugin::Args),
    /// Time shaders that are drawn by evaluating their sources, beside a kernel.
    Evaluator(evaluator::Args),
    /// Write what the actions on GPUs do on this machine: adapter, figures, the suite's result.
    GpuReport(gpu_report::Args),
    /// Time `cpu` over picture sizes, volume sizes and threads.
    Scaling,
}

fn main() -> anyhow::Result<()> {
    match Args::parse().task {
        Task::Test => check::test(),
        Task::Check => check::all(),
        Task::Conformance => check::conformance(),
        Task::Peer(args) => peer::run(&args),
        Task::Peers(args) => peers::run(&args),
        Task::MeshPeers(args) => mesh_peers::run(&args),
        Task::Docs(args) => docs::run(&args),
        Task::Header => header::run(),
        Task::NewPlugin(args) => new_plugin::run(&args),
        Task::Evaluator(args) => evaluator::run(&args),
        Task::GpuReport(args) => gpu_report::run(&args),
        Task::Scaling => scaling::run(),
    }
}
