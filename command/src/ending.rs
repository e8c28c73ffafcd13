//! How a program ended, and what its exit code says about it.

use std::process::ExitCode;

/// How a program ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// Everything asked for is there: 0.
    Done,
    /// It went wrong, or it ran and the answer is no: 1.
    Failed,
    /// The arguments cannot be: 2.
    Wrong,
    /// It finished, but something recorded is damaged or missing: 3.
    DataLost,
    /// It was stopped and has saved what it had, or somebody else is writing where it would: the same command is to be given again, 75.
    Again,
}

impl Ending {
    /// The exit code.
    pub fn code(self) -> u8 {
        match self {
            Self::Done => 0,
            Self::Failed => 1,
            Self::Wrong => 2,
            Self::DataLost => 3,
            // EX_TEMPFAIL: schedulers' scripts know it as "start me again".
            Self::Again => 75,
        }
    }
}

impl From<Ending> for ExitCode {
    fn from(ending: Ending) -> Self {
        Self::from(ending.code())
    }
}

/// The error with its causes, each said once: an error whose text already holds its cause's is not followed by it.
pub fn error_text(error: &anyhow::Error) -> String {
    let mut parts: Vec<String> = Vec::new();
    for part in error.chain().map(ToString::to_string) {
        if !parts.iter().any(|said| said.contains(&part)) {
            parts.push(part);
        }
    }
    parts.join(": ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cause_that_was_said_is_not_said_again() {
        let cause = std::io::Error::other("the disk is full");
        let error = anyhow::Error::from(cause).context("cannot write: the disk is full: a.arrow").context("stopped");
        assert_eq!(error_text(&error), "stopped: cannot write: the disk is full: a.arrow");
    }
}
