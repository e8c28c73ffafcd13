use super::*;

/// A program as ours are: a default job without a verb, verbs, options of both, and one that stands in for another.
fn program() -> Command {
    let number = |name: &'static str| Arg::new(name).long(name);
    let flag = |name: &'static str| Arg::new(name).long(name).action(ArgAction::SetTrue);
    with_option(
        Command::new("program")
            .arg(number("seed").short('s'))
            .arg(number("grid"))
            .arg(flag("static"))
            .arg(flag("quiet").short('q').global(true).conflicts_with("verbose"))
            .arg(flag("verbose").short('v').global(true))
            .arg(number("distract"))
            .subcommand(
                Command::new("nn")
                    .arg(Arg::new("table"))
                    .arg(number("k"))
                    .arg(number("lr-decay"))
                    .arg(number("rows").action(ArgAction::Append))
                    .arg(number("weight").allow_negative_numbers(true)),
            )
            .subcommand(Command::new("umap").arg(number("neighbours")).arg(number("online").num_args(0..=1))),
    )
}

/// The line after expansion; `FILE` stands for a file of that text.
fn expanded(line: &str, text: &str) -> Result<String, String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("a.toml");
    std::fs::write(&file, text).unwrap();
    let words = line.split(' ').map(|word| word.replace("FILE", &file.display().to_string()).into()).collect();
    let mut command = program();
    let expanded = expand(&mut command, words).map_err(|error| format!("{error:#}"))?;
    command.try_get_matches_from_mut(&expanded.arguments).map_err(|error| error.to_string())?;
    let words = expanded.arguments.iter().map(|word| word.to_string_lossy().into_owned());
    Ok(words.collect::<Vec<_>>().join(" "))
}

#[test]
fn the_file_stands_behind_the_verb_and_in_front_of_what_was_typed() {
    let text = "seed = 4\nstatic = true\ndistract = [\"camera\", \"color\"]\n";
    let all = "--distract=camera,color --seed=4 --static";
    assert_eq!(expanded("program --config FILE --grid 2x2", text).unwrap(), format!("program {all} --grid 2x2"));
    assert_eq!(expanded("program --grid 2x2 --config=FILE", text).unwrap(), format!("program {all} --grid 2x2"));
    let text = "k = 7\n[umap]\nneighbours = 9\n[nn]\nrows = [\"0:1\", \"2:3\"]\nlr_decay = 5\nweight = -0.5\n";
    let all = "--k=7 --lr-decay=5 --rows=0:1 --rows=2:3 --weight=-0.5";
    for line in
        ["program --config FILE nn a.arrow", "program nn --config FILE a.arrow", "program nn a.arrow --config=FILE"]
    {
        assert_eq!(expanded(line, text).unwrap(), format!("program nn {all} a.arrow"), "{line}");
    }
}

#[test]
fn what_is_typed_wins_also_over_its_opposite() {
    assert_eq!(expanded("program nn --config FILE --k 5", "k = 7").unwrap(), "program nn --k 5");
    assert_eq!(expanded("program nn --config FILE --k=5", "k = 7").unwrap(), "program nn --k=5");
    assert_eq!(expanded("program --config FILE -s5", "seed = 7").unwrap(), "program -s5");
    assert_eq!(expanded("program -vs 5 --config FILE", "seed = 7\nquiet = true").unwrap(), "program -vs 5");
    assert_eq!(expanded("program nn -q --config FILE", "verbose = true").unwrap(), "program nn -q");
}

#[test]
fn the_verbs_own_table_wins_over_the_top_of_the_file() {
    for (line, text, wanted) in [
        ("program nn --config FILE", "k = 7\n[nn]\nk = 5", "program nn --k=5"),
        ("program umap --config FILE", "neighbours = 7\n[nn]\nk = 5", "program umap --neighbours=7"),
        ("program nn --config FILE", "lr_decay = 7\n[nn]\nlr-decay = 5", "program nn --lr-decay=5"),
        ("program nn --config FILE", "rows = [\"0:1\"]\n[nn]\nrows = [\"2:3\"]", "program nn --rows=2:3"),
        ("program nn --config FILE", "quiet = true\n[nn]\nquiet = false", "program nn"),
        ("program nn --config FILE", "quiet = true\n[nn]\nverbose = true", "program nn --verbose"),
        ("program nn --config FILE", "quiet = true\n[nn]\nverbose = false", "program nn --quiet"),
        ("program nn --config FILE --k 3", "k = 7\n[nn]\nk = 5", "program nn --k 3"),
    ] {
        assert_eq!(expanded(line, text).unwrap(), wanted, "{line} with {text}");
    }
}

#[test]
fn a_verb_is_not_mistaken_for_a_value() {
    assert_eq!(expanded("program --grid nn --config FILE", "seed = 1").unwrap(), "program --seed=1 --grid nn");
    assert_eq!(expanded("program nn umap --config FILE", "k = 1").unwrap(), "program nn --k=1 umap");
}

#[test]
fn an_option_that_may_stand_alone_does_not_take_the_file_for_its_value() {
    for (line, wanted) in [
        ("program umap --online --config FILE", "program umap --neighbours=9 --online"),
        ("program umap --online --config=FILE", "program umap --neighbours=9 --online"),
        ("program umap --online task --config FILE", "program umap --neighbours=9 --online task"),
        ("program umap --config FILE --online", "program umap --neighbours=9 --online"),
    ] {
        assert_eq!(expanded(line, "neighbours = 9").unwrap(), wanted, "{line}");
    }
}

#[test]
fn what_would_have_no_effect_is_an_error_that_names_what_there_is() {
    for (line, text, wanted) in [
        ("program nn --config FILE", "sed = 1", "no option sed of nn; its options are k, lr-decay, rows, weight"),
        ("program nn --config FILE", "neighbours = 1", "no option neighbours of nn"),
        ("program nn --config FILE", "[nm]\nk = 1", "no verb nm; the verbs are nn, umap"),
        ("program nn --config FILE", "config = \"b.toml\"", "no option config of nn"),
        ("program nn --config FILE", "quiet = 3", "quiet = 3; it is true or false"),
        ("program nn --config FILE", "k = [[1]]", "a text, a number, true, false, or a list of them is right"),
        ("program nn --config FILE", "lr_decay = 1\nlr-decay = 2", "lr-decay and lr_decay are one option"),
        ("program nn --config FILE", "k = ", "the options are not TOML"),
        ("program nn --config FILE --config FILE", "k = 1", "--config is there twice"),
        ("program nn --config none.toml", "", "cannot read the options: none.toml"),
        ("program nn --config", "", "--config needs a file"),
    ] {
        let error = expanded(line, text).unwrap_err();
        assert!(error.contains(wanted), "{line} with {text}: {error}");
    }
}

#[test]
fn without_a_file_nothing_changes() {
    assert_eq!(expanded("program nn --k 5", "").unwrap(), "program nn --k 5");
}

#[test]
fn what_was_typed_is_known_before_the_file_is_there() {
    for line in ["program nn --config later.toml --k 5", "program --config=later.toml nn --k 5"] {
        let words = line.split(' ').map(OsString::from).collect();
        let left = without_file(&mut program(), words).unwrap();
        assert_eq!(left, ["program", "nn", "--k", "5"], "{line}");
    }
}
