//! `vibes-collect verify PATH`: checksums, alignment, physics simulated again, and a sample of pictures drawn again.

use std::path::PathBuf;

use anyhow::Result;
use clap::Args;
use vibes_data::Recording;

use super::number::number;
use super::{Outcome, OutputArgs};
use crate::stored::asked;
use crate::verify::verify;

#[derive(Debug, Args)]
pub(super) struct VerifyArgs {
    /// The recording's folder.
    path: PathBuf,
    /// Check files and alignment only; simulate and draw nothing.
    #[arg(long)]
    no_simulation: bool,
}

#[allow(clippy::print_stdout, reason = "the command line's result")]
pub(super) fn run(args: &VerifyArgs, output: OutputArgs) -> Result<Outcome> {
    let recording = Recording::open(&args.path)?;
    let verdict = verify(&recording, !args.no_simulation)?;
    if output.json {
        let findings =
            verdict.findings.iter().map(|finding| serde_json::json!({ "path": finding.path, "fault": finding.fault }));
        let findings: Vec<_> = findings.collect();
        println!(
            "{}",
            serde_json::json!({ "episodes": recording.episodes().len(), "episodes_asked": asked(&recording), "findings": findings,
                "simulated": verdict.simulated, "largest_qpos_error": number(verdict.qpos_error()), "foreign": verdict.foreign,
                "pictures": verdict.pictures, "largest_picture_error": number(verdict.picture_error()),
                "undrawn": verdict.undrawn, "absent_videos": verdict.absent_videos, "mend": verdict.mend(&recording) })
        );
    } else {
        for finding in &verdict.findings {
            println!("{}: {}", finding.path.display(), finding.fault);
        }
        if !output.quiet {
            println!("{}", verdict.summary(&recording));
            if let Some(mend) = verdict.mend(&recording) {
                println!("{mend}");
            }
        }
    }
    Ok(if verdict.findings.is_empty() { Outcome::Done } else { Outcome::DataLost })
}
