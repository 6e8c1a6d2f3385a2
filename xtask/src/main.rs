//! What people who work on Volact repeat: `cargo xtask --help`.

mod peer;
mod peer_scene;

use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(name = "cargo xtask", about = "What people who work on Volact repeat")]
struct Args {
    #[command(subcommand)]
    task: Task,
}

#[derive(Subcommand)]
enum Task {
    /// Draw one scene of the peers' folder and print its row.
    Peer(peer::Args),
}

fn main() -> anyhow::Result<()> {
    match Args::parse().task {
        Task::Peer(args) => peer::run(&args),
    }
}
