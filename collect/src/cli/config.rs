//! `--config FILE.toml`: the file's keys are the long options, and what is typed overrides them.
//!
//! In: the arguments as typed. Out: the same with the file's options put before them, so that clap checks both alike and names a key that is
//! no option.

use std::ffi::OsString;
use std::path::Path;

use anyhow::{Context, Result, bail};

/// Puts the options of `--config FILE` before those that were typed.
pub(super) fn with_config_file(arguments: Vec<OsString>) -> Result<Vec<OsString>> {
    let Some(place) = arguments.iter().position(|argument| argument == "--config") else { return Ok(arguments) };
    let Some(path) = arguments.get(place + 1).map(Path::new) else { return Ok(arguments) };
    let text = std::fs::read_to_string(path).with_context(|| format!("cannot read the options: {}", path.display()))?;
    let table: toml::Table = text.parse().with_context(|| format!("the options are not TOML: {}", path.display()))?;
    let mut all = vec![arguments[0].clone()];
    for (key, value) in &table {
        let key = key.replace('_', "-");
        match value {
            toml::Value::Boolean(true) => all.push(format!("--{key}").into()),
            toml::Value::Boolean(false) => {}
            toml::Value::Table(_) => bail!("{key} is a table; options are plain values: {}", path.display()),
            toml::Value::Array(parts) => {
                all.push(format!("--{key}={}", parts.iter().map(plain).collect::<Vec<_>>().join(",")).into());
            }
            value => all.push(format!("--{key}={}", plain(value)).into()),
        }
    }
    all.extend(
        arguments
            .into_iter()
            .enumerate()
            .filter(|(at, _)| ![0, place, place + 1].contains(at))
            .map(|(_, argument)| argument),
    );
    Ok(all)
}

fn plain(value: &toml::Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_comes_first_and_what_is_typed_last() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("grid.toml");
        std::fs::write(
            &path,
            "grid = \"3x2\"\nseed = 4\nstatic = true\ndynamic = false\ndistract = [\"camera\", \"color\"]\n",
        )
        .unwrap();
        let typed =
            ["vibes-collect", "--seed", "5", "--config"].map(OsString::from).into_iter().chain([path.into_os_string()]);
        let all = with_config_file(typed.collect()).unwrap();
        assert_eq!(
            all,
            ["vibes-collect", "--distract=camera,color", "--grid=3x2", "--seed=4", "--static", "--seed", "5"]
        );
    }
}
