//! How the runs of a sweep ended, all together. In: the runs that are not done, by what became of them. Out: one sentence and the exit code.

use std::collections::BTreeSet;

use anyhow::{Result, bail};
use vibes_command::Ending;

use super::say;
use crate::cli::Context;

/// The runs that are not done, by number.
#[derive(Debug, Default)]
pub(super) struct Tally {
    /// How many were asked for.
    pub(super) runs: usize,
    /// Those of which a stage failed.
    pub(super) failed: Vec<usize>,
    /// Those that another process owns.
    pub(super) busy: Vec<usize>,
    /// Those that were stopped and saved.
    pub(super) saved: Vec<usize>,
    /// How many were not begun, because of a stop.
    pub(super) unbegun: usize,
}

impl Tally {
    pub(super) fn of(runs: usize) -> Self {
        Self { runs, ..Self::default() }
    }

    /// Says what is not done, and what that means for whoever started the sweep. What was stopped goes on with the same command, also where a run failed; that
    /// another process owns a run is no reason to pass over one that failed.
    pub(super) fn end(&self, context: &Context) -> Result<Ending> {
        let is_stopped = self.unbegun > 0 || !self.saved.is_empty();
        if !self.failed.is_empty() && !is_stopped {
            bail!("{}; the same command tries again", self.sentence());
        }
        if !is_stopped && self.busy.is_empty() {
            return Ok(Ending::Done);
        }
        say(context, &format!("{}; the same command goes on", self.sentence()));
        Ok(Ending::Again)
    }

    fn sentence(&self) -> String {
        let lists = [
            ("failed", &self.failed),
            ("are busy with another process", &self.busy),
            ("were stopped and saved", &self.saved),
        ];
        let lists = lists.into_iter().filter(|(_, runs)| !runs.is_empty());
        let mut parts: Vec<String> = lists.map(|(what, runs)| self.part(what, runs)).collect();
        if self.unbegun > 0 {
            parts.push(format!("{} of {} were not begun", self.unbegun, self.runs));
        }
        if self.failed.len() + self.busy.len() + self.saved.len() + self.unbegun < self.runs {
            parts.push("the others are done".to_owned());
        }
        parts.join("; ")
    }

    fn part(&self, what: &str, runs: &[usize]) -> String {
        // By number, in whatever order they ended.
        let numbers: BTreeSet<usize> = runs.iter().copied().collect();
        let numbers: Vec<String> = numbers.iter().map(usize::to_string).collect();
        format!("{} of {} runs {what}: {}", runs.len(), self.runs, numbers.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quiet() -> Context {
        Context { verbose: false, quiet: true, json: false }
    }

    #[test]
    fn what_failed_is_told_from_what_was_stopped_and_from_what_is_busy() {
        let busy = Tally { busy: vec![0], ..Tally::of(3) };
        assert_eq!(busy.sentence(), "1 of 3 runs are busy with another process: 0; the others are done");
        assert_eq!(busy.end(&quiet()).unwrap(), Ending::Again);
        let failed = Tally { failed: vec![2, 1], ..busy };
        let told = failed.end(&quiet()).unwrap_err().to_string();
        let wanted =
            "2 of 3 runs failed: 1, 2; 1 of 3 runs are busy with another process: 0; the same command tries again";
        assert_eq!(told, wanted, "no other is done");
        let stopped = Tally { saved: vec![3], unbegun: 1, ..failed };
        assert_eq!(stopped.end(&quiet()).unwrap(), Ending::Again, "what was stopped goes on, also where a run failed");
        assert_eq!(Tally::of(3).end(&quiet()).unwrap(), Ending::Done);
    }
}
