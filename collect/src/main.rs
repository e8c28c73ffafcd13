//! `vibes-collect`: records MuJoCo rollouts under the Distracting Control Suite's distractors.

use std::process::ExitCode;

fn main() -> ExitCode {
    vibes_collect::cli::main()
}
