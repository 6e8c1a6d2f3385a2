//! `volact completions SHELL`.

use std::process::ExitCode;

use clap::CommandFactory;
use clap_complete::Shell;
use volact::Registry;

/// Arguments of `volact completions`.
#[derive(clap::Args)]
#[command(after_help = "Bash: volact completions bash > ~/.local/share/bash-completion/completions/volact\n\
    Fish: volact completions fish > ~/.config/fish/completions/volact.fish")]
pub struct Args {
    /// The shell
    shell: Shell,
}

/// Prints the script.
pub fn run(args: Args, _: &Registry) -> anyhow::Result<ExitCode> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut crate::Cli::command(), "volact", &mut script);
    super::print(&String::from_utf8(script)?)?;
    Ok(ExitCode::SUCCESS)
}
