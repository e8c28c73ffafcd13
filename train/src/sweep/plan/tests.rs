use super::*;

fn expanded(text: &str) -> std::result::Result<Vec<Element>, String> {
    let plan: Plan = toml::from_str(text).map_err(|error| error.to_string())?;
    plan.expand().map_err(|error| error.to_string())
}

const STAGES: &str =
    "stages = [\"vibes-train offline recordings/{task} --objective {objective} --seed {seed} -o {run}\"]\n";

#[test]
fn a_grid_is_every_combination_in_an_order_that_no_key_order_changes() {
    let grid = "[grid]\ntask = [\"b\", \"a\"]\nobjective = [\"vibes\", \"reconstruction\"]\n";
    let turned = "[grid]\nobjective = [\"vibes\", \"reconstruction\"]\ntask = [\"b\", \"a\"]\n";
    let head = format!("output = \"runs\"\nseeds = 2\n{STAGES}");
    let all = expanded(&format!("{head}{grid}")).unwrap();
    assert_eq!(all, expanded(&format!("{head}{turned}")).unwrap());
    assert_eq!(all.len(), 8);
    assert_eq!(all[1].name, "objective=vibes,task=b,seed=1");
    assert_eq!(all[2].index, 2);
    assert_eq!(
        all[1].stages[0].join(" "),
        "vibes-train offline recordings/b --objective vibes --seed 1 -o runs/objective=vibes,task=b,seed=1"
    );
}

#[test]
fn only_what_varies_is_in_the_name_and_what_no_file_name_can_hold_is_a_checksum() {
    let all = expanded(&format!(
        "output = \"runs\"\nseeds = [7]\n{STAGES}[grid]\ntask = [\"a/b\", \"c\"]\nobjective = [\"vibes\"]\n"
    ))
    .unwrap();
    assert_eq!(all[1].name, "task=c");
    assert!(all[0].name.starts_with("task=") && all[0].name.len() == 17, "{}", all[0].name);
    assert_eq!(all[0].settings["seed"], "7");
    let single = expanded("output = \"runs\"\nstages = [\"vibes-train offline r -o {run}\"]").unwrap();
    assert_eq!((single.len(), single[0].name.as_str()), (1, "run"));
}

#[test]
fn zipped_lists_belong_together_and_listed_settings_are_taken_as_they_are() {
    let stages = "stages = [\"vibes-train offline r --depth {depth} --hidden {hidden} -o {run}\"]\n";
    let zipped = expanded(&format!("output = \"o\"\n{stages}[zip]\ndepth = [8, 16]\nhidden = [64, 128]\n")).unwrap();
    let listed = expanded(&format!(
        "output = \"o\"\n{stages}[[list]]\nhidden = 64\ndepth = 8\n[[list]]\ndepth = 16\nhidden = 128\n"
    ))
    .unwrap();
    assert_eq!(zipped, listed);
    assert_eq!(zipped.len(), 2);
    assert_eq!(zipped[1].name, "depth=16,hidden=128");
}

#[test]
fn a_setting_varies_in_one_place() {
    let head = "output = \"o\"\nstages = [\"vibes-train offline r --lr {lr} --seed {seed} -o {run}\"]\n";
    for (rest, places) in [
        ("seeds = 2\n[grid]\nlr = [0.1]\nseed = [7]\n", "seed is set by [grid] and by seeds"),
        ("seeds = 2\n[grid]\nlr = [0.1]\n[[list]]\nlr = 0.2\n", "lr is set by [grid] and by [[list]]"),
        (
            "[zip]\nlr = [0.1]\nseed = [1]\n[[list]]\nlr = 0.2\n[[list]]\nlr = 0.3\n",
            "lr is set by [zip] and by [[list]]",
        ),
    ] {
        let fault = expanded(&format!("{head}{rest}")).unwrap_err();
        assert!(fault.contains(places), "{fault}");
    }
}

#[test]
fn a_quoted_word_stays_together() {
    assert_eq!(
        split("vibes-train offline 'my recording' --note=\"a 'b'\" ''").unwrap(),
        ["vibes-train", "offline", "my recording", "--note=a 'b'", ""]
    );
    assert_eq!(
        crate::sweep::line(&split("vibes-train 'a b' \"it's\" --x=1").unwrap()),
        r"vibes-train 'a b' 'it'\''s' --x=1"
    );
}

#[test]
fn what_cannot_be_meant_is_refused_with_what_would_be_right() {
    let head = "output = \"o\"\n";
    for (text, wanted) in [
        (format!("{head}stages = []"), "the plan has no run"),
        (format!("{head}stages = [\"vibes-train offline r\"]\n[grid]\nlr = []\n"), "the plan has no run"),
        (format!("{head}stages = [\"vibes-train offline r\"]\n[grid]\nlr = [1]\n"), "no stage uses the setting lr"),
        (format!("{head}stages = [\"vibes-train offline {{lr}}\"]"), "no setting {lr}; there are {run}"),
        (format!("{head}stages = [\"python x.py\"]"), "a stage begins with vibes-collect"),
        (format!("{head}stages = [\"vibes-train 'r\"]"), "a quote is not closed"),
        (format!("{head}stages = [\"vibes-train {{a\"]"), "without its }"),
        (
            format!("{head}stages = [\"vibes-train {{a}} {{b}}\"]\n[zip]\na = [1, 2]\nb = [1]\n"),
            "lists of different lengths under [zip] (a 2, b 1)",
        ),
        (format!("{head}stages = [\"vibes-train {{a}}\"]\n[grid]\na = [1, 1]\n"), "two runs have the settings"),
        (format!("{head}stages = [\"vibes-train {{a}}\"]\n[grid]\na = 3\n"), "a = 3; a list of values is wanted"),
        (format!("{head}stages = [\"vibes-train r\"]\nseed = 3\n"), "unknown field `seed`"),
    ] {
        let error = expanded(&text).unwrap_err();
        assert!(error.contains(wanted), "{text}\n{error}");
    }
}

#[test]
fn a_plan_of_more_runs_than_anyone_makes_is_refused_before_they_are_listed() {
    let list = format!("[{}]", (0..400).map(|value| value.to_string()).collect::<Vec<_>>().join(", "));
    let stages = "stages = [\"vibes-train offline r --lr {lr} --depth {depth} --seed {seed} -o {run}\"]\n";
    let grid = format!("[grid]\nlr = {list}\ndepth = {list}\n");
    for plan in [format!("output = \"o\"\n{stages}{grid}"), format!("output = \"o\"\nseeds = 9000000000\n{stages}")] {
        let error = expanded(&plan).unwrap_err();
        assert!(error.contains("more than 100000 runs"), "{error}");
    }
}
