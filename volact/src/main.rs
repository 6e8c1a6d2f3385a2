//! The `volact` command: draws, compares and measures volumes from the command line.
//!
//! Exit codes: 0 fine, 1 pictures differ, 2 failed. The command prints the whole error chain.

mod commands;

use std::process::ExitCode;

use clap::Parser;
use log::LevelFilter;

use commands::Command;

/// Draw volumes: describe once, draw with any action.
#[derive(Parser)]
#[command(name = "volact", version, about = "Draw volumes: describe once, draw with any action", max_term_width = 100)]
#[command(after_help = "Exit codes: 0 fine, 1 pictures differ, 2 failed.\n\
    VOLACT_LOG sets what is logged (e.g. `debug` or `volact_cpu=trace`), VOLACT_CONFIG names the config file,\n\
    VOLACT_PLUGIN_PATH folders of plugins, searched after the config's.")]
struct Cli {
    /// Say more: -v what is done, -vv settings, -vvv everything
    #[arg(short, long, action = clap::ArgAction::Count, global = true, conflicts_with = "quiet")]
    verbose: u8,
    /// Say nothing but errors
    #[arg(short, long, global = true)]
    quiet: bool,
    #[command(subcommand)]
    command: Command,
}

fn main() -> ExitCode {
    let cli = Cli::parse();
    start_log(cli.verbose, cli.quiet);
    commands::set_quiet(cli.quiet);
    match cli.command.run() {
        Ok(code) => code,
        Err(error) => {
            commands::print_error(&error);
            ExitCode::from(2)
        }
    }
}

/// Flags choose the level; `VOLACT_LOG`, where set, chooses instead and may do so by module.
fn start_log(verbose: u8, quiet: bool) {
    let level = match (quiet, verbose) {
        (true, _) => LevelFilter::Error,
        (false, 0) => LevelFilter::Warn,
        (false, 1) => LevelFilter::Info,
        (false, 2) => LevelFilter::Debug,
        (false, _) => LevelFilter::Trace,
    };
    env_logger::Builder::new()
        .filter_level(level)
        // What naga finds wrong with a shader is told by the error, at its place.
        .filter_module("naga", LevelFilter::Off)
        .parse_env("VOLACT_LOG")
        .format_timestamp(None)
        .format_target(verbose > 1)
        .init();
}
