//! Which options were given, typed or from a file, so that a verb can refuse one that has no effect beside the others. In: what clap has parsed. Out: names.

use std::collections::BTreeSet;

use clap::parser::ValueSource;
use clap::{ArgMatches, Args, Command, FromArgMatches};

/// The options that were given. Flattened into a verb's arguments, it adds none of its own. It stands first among them: clap takes the values of a field out of
/// what it has parsed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Given(BTreeSet<String>);

impl Given {
    /// The first of these options that was given, as it is typed; they are named as clap knows them, so `video_count` for `--video-count`.
    pub fn first_of<'a>(&self, options: impl IntoIterator<Item = &'a str>) -> Option<String> {
        let given = options.into_iter().find(|option| self.0.contains(*option))?;
        Some(format!("--{}", given.replace('_', "-")))
    }
}

/// The names of a group's options.
pub fn options_of<A: Args>() -> Vec<String> {
    let group = A::augment_args(Command::new("group"));
    group.get_arguments().map(|argument| argument.get_id().to_string()).collect()
}

impl Args for Given {
    fn augment_args(command: Command) -> Command {
        command
    }

    fn augment_args_for_update(command: Command) -> Command {
        command
    }
}

impl FromArgMatches for Given {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        let given = matches.ids().filter(|id| matches.value_source(id.as_str()) == Some(ValueSource::CommandLine));
        Ok(Self(given.map(ToString::to_string).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        self.0.extend(Self::from_arg_matches(matches)?.0);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Args)]
    struct Group {
        #[arg(long, default_value_t = 4)]
        video_count: u32,
        #[arg(long)]
        seed: Option<u64>,
    }

    #[derive(Debug, Parser)]
    struct Program {
        #[command(flatten)]
        given: Given,
        #[command(flatten)]
        group: Group,
    }

    #[test]
    fn a_default_is_not_given_and_a_typed_default_is() {
        let program = Program::parse_from(["program"]);
        assert_eq!((program.group.video_count, program.group.seed), (4, None));
        let all = options_of::<Group>();
        assert_eq!(all, ["video_count", "seed"]);
        assert_eq!(program.given.first_of(all.iter().map(String::as_str)), None);
        let program = Program::parse_from(["program", "--video-count", "4"]);
        assert_eq!(program.given.first_of(all.iter().map(String::as_str)), Some("--video-count".to_owned()));
        assert_eq!(program.given.first_of(["seed"]), None);
    }
}
