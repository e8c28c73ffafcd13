//! The program `vibes-analyze`: looks into latent spaces.

use std::process::ExitCode;

fn main() -> ExitCode {
    vibes_command::products_on_one_thread();
    vibes_analyze::cli::main()
}
