//! What a plan stands for, with nothing done: its runs, and the script that hands them to an engine. In: the plan's runs. Out: a list on standard output, a
//! script's text.

use anyhow::{Context as _, Result};
use serde_json::json;
use vibes_command::Ending;
use vibes_train::sweep::{self, Element, Engine, line};

use super::{EngineName, SweepArgs, cores};
use crate::cli::Context;

pub(super) fn list(context: &Context, elements: &[Element]) -> Ending {
    if context.json {
        let all = elements.iter().map(|element| {
            json!({ "index": element.index, "name": element.name, "digest": element.digest(), "folder": element.folder,
                "settings": element.settings, "stages": element.stages.iter().map(|words| line(words)).collect::<Vec<_>>() })
        });
        println!("{}", serde_json::Value::from(all.collect::<Vec<_>>()));
    } else {
        for element in elements {
            println!("{}  {}", element.index, element.folder.display());
            for words in &element.stages {
                println!("     {}", line(words));
            }
        }
    }
    Ending::Done
}

pub(super) fn script(args: &SweepArgs, engine: EngineName, elements: &[Element]) -> Result<String> {
    let engine = match engine {
        EngineName::Slurm => Engine::Slurm,
        EngineName::Xargs => Engine::Xargs,
        EngineName::Parallel => Engine::Parallel,
    };
    let folder = std::env::current_dir().context("cannot tell the present folder")?;
    let jobs = args.jobs.map_or_else(cores, usize::from);
    Ok(sweep::script(engine, &args.plan.to_string_lossy(), &folder.to_string_lossy(), elements, jobs))
}
