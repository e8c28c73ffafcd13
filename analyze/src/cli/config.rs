//! `--config FILE.toml`: the file's keys become options in front of those that were typed, so that typed ones win.

use std::ffi::OsString;
use std::path::Path;

use anyhow::Context;
use toml::Value;

use super::wrong;

/// The arguments with those of the configuration file inserted after the verb.
pub(super) fn expand(args: Vec<OsString>) -> anyhow::Result<Vec<OsString>> {
    let Some(file) = named(&args) else { return Ok(args) };
    let text = std::fs::read_to_string(&file)
        .with_context(|| format!("cannot read the configuration {}", Path::new(&file).display()))?;
    let table: toml::Table = text.parse().map_err(|e| wrong(format!("{}: {e}", Path::new(&file).display())))?;
    let Some(at) = args.iter().skip(1).position(|a| !a.to_string_lossy().starts_with('-') && *a != file).map(|i| i + 1)
    else {
        return Ok(args);
    };
    let verb = args[at].to_string_lossy().into_owned();
    let mut inserted = Vec::new();
    let of_all = table.iter().filter(|(_, v)| !v.is_table());
    let of_verb = table.get(&verb).and_then(Value::as_table).into_iter().flatten();
    for (key, value) in of_all.chain(of_verb) {
        let typed = args.iter().any(|a| a.to_string_lossy().split('=').next() == Some(&format!("--{key}")));
        if !typed {
            inserted.extend(option(key, value)?);
        }
    }
    let mut all = args;
    all.splice(at + 1..at + 1, inserted.into_iter().map(OsString::from));
    Ok(all)
}

/// The file after `--config`, or in `--config=FILE`.
fn named(args: &[OsString]) -> Option<OsString> {
    let at = args.iter().position(|a| a == "--config" || a.to_string_lossy().starts_with("--config="))?;
    match args[at].to_str().and_then(|a| a.strip_prefix("--config=")) {
        Some(file) => Some(file.into()),
        None => args.get(at + 1).cloned(),
    }
}

fn option(key: &str, value: &Value) -> anyhow::Result<Vec<String>> {
    let flag = format!("--{key}");
    let text = |v: &Value| match v {
        Value::String(s) => Ok(s.clone()),
        Value::Integer(_) | Value::Float(_) => Ok(v.to_string()),
        _ => Err(wrong(format!(
            "configuration key {key}: a text, a number, true, false or a list of texts and numbers is expected"
        ))),
    };
    Ok(match value {
        Value::Boolean(true) => vec![flag],
        Value::Boolean(false) => Vec::new(),
        Value::Array(values) => vec![flag, values.iter().map(text).collect::<Result<Vec<_>, _>>()?.join(",")],
        value => vec![flag, text(value)?],
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str) -> Vec<OsString> {
        text.split(' ').map(OsString::from).collect()
    }

    #[test]
    fn keys_become_options_and_typed_ones_win() {
        let dir = tempfile::tempdir().expect("folder");
        let file = dir.path().join("a.toml");
        std::fs::write(
            &file,
            "seed = 3\nquiet = true\nnote = 'two words'\n[nn]\nk = 7\nrows = ['0:1', '2:3']\n[umap]\nneighbours = 9\n",
        )
        .expect("file");
        let got = expand(words(&format!("vibes-analyze --config {} nn --k 5", file.display()))).expect("expanded");
        let got: Vec<String> = got.into_iter().skip(3).map(|a| a.into_string().expect("text")).collect();
        assert_eq!(got[0], "nn");
        let mut rest = got[1..].join(" ");
        for part in ["--seed 3", "--quiet", "--note two words", "--rows 0:1,2:3"] {
            assert!(rest.contains(part), "{rest}");
            rest = rest.replace(part, "");
        }
        assert_eq!(rest.trim(), "--k 5");
    }

    #[test]
    fn without_a_file_nothing_changes() {
        assert_eq!(expand(words("vibes-analyze nn --k 5")).expect("expanded"), words("vibes-analyze nn --k 5"));
    }
}
