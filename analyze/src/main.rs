//! The program `vibes-analyze`: looks into latent spaces.

use std::process::ExitCode;

fn main() -> ExitCode {
    vibes_analyze::cli::main()
}
