//! `vibes-collect`: records MuJoCo rollouts under the Distracting Control Suite's distractors.

use std::process::ExitCode;

fn main() -> ExitCode {
    vibes_command::products_on_one_thread();
    vibes_env::render::without_rasteriser_threads();
    vibes_collect::cli::main()
}
