//! `vibes-train`: fit VIBES and its ablations to recordings, and encode recordings into latents.

mod cli;

fn main() -> std::process::ExitCode {
    cli::main()
}
