//! The program `vibes-analyze`: looks into latent spaces. The only place that makes an exit code: 0 done, 1 failed, 2 wrong arguments.

use std::process::ExitCode;

use vibes_analyze::cli;

fn main() -> ExitCode {
    match cli::run(std::env::args_os()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(cli::Stop::Parse(error)) => {
            // Help and version are asked for, not wrong.
            let _ = error.print();
            if error.use_stderr() { ExitCode::from(2) } else { ExitCode::SUCCESS }
        }
        Err(cli::Stop::Wrong(error)) => fail(&error, 2),
        Err(cli::Stop::Failed(error)) => fail(&error, 1),
    }
}

#[allow(clippy::print_stderr, reason = "the one place that reports an error")]
fn fail(error: &anyhow::Error, code: u8) -> ExitCode {
    let mut parts: Vec<String> = Vec::new();
    for part in error.chain().map(ToString::to_string) {
        // Transparent errors repeat their source's text.
        if !parts.last().is_some_and(|last| last.contains(&part)) {
            parts.push(part);
        }
    }
    eprintln!("vibes-analyze: {}", parts.join(": "));
    ExitCode::from(code)
}
