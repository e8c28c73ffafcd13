//! `vibes-train`: fit VIBES and its ablations to recordings, and encode recordings into latents.

mod cli;

fn main() -> std::process::ExitCode {
    vibes_command::products_on_one_thread();
    vibes_env::render::without_rasteriser_threads();
    cli::main()
}
