//! `vibes-collect --no-record`: an evaluation that leaves nothing behind. In: how a recording would be made. Out: what it would have said of its returns.

use std::path::Path;

use anyhow::Result;

use super::super::{Outcome, OutputArgs, show};
use super::said::Said;
use crate::recorder::{RecordRun, evaluate as earn};
use crate::trained::Home;

/// Acts with a progress bar, and says what was earned. `place` is where numbers come from that nobody typed, and `home` that of the run which acts, if one does.
#[allow(clippy::print_stdout, reason = "the command line's result")]
pub(super) fn evaluate(run: &RecordRun<'_>, place: &Path, home: &Home, output: OutputArgs) -> Result<Outcome> {
    let meter = show::Meter::new(u64::from(run.options.episodes), output.quiet || output.json);
    let returns = earn(run, place, &|progress| meter.tell(progress));
    meter.finish();
    let options = serde_json::to_value(run.options)?;
    let said = Said::earned(run.options.episodes as usize, Some(&options), home, (returns?, meter.seconds()));
    if output.json {
        println!("{}", serde_json::to_string(&said)?);
    } else if !output.quiet {
        println!("{}", said.in_words_alone());
    }
    Ok(Outcome::Done)
}
