//! Mixes of policies and files of actions, as processes: a recording that grows is played by the policies that it would have been recorded by, and by no other file.

#![allow(missing_docs, clippy::unwrap_used, reason = "a test")]

#[path = "process/run.rs"]
mod run;

use std::path::Path;

use serde_json::Value;
use vibes_env::PolicyMix;

use run::{assert_same_bytes, fails, works};

const COMMON: &str = "--task cartpole-swingup --steps 2 --no-pixels --no-mcap";
const ACTIONS: &str = "[[0.1], [0.2]]";

fn manifest(recording: &Path) -> Value {
    serde_json::from_slice(&std::fs::read(recording.join("manifest.json")).unwrap()).unwrap()
}

/// Changes the options in a recording's manifest.
fn change_options(recording: &Path, change: impl FnOnce(&mut Value)) {
    let mut found = manifest(recording);
    change(&mut found["options"]);
    std::fs::write(recording.join("manifest.json"), found.to_string()).unwrap();
}

/// Weights whose shares move by their last bit when they are divided by their sum again, and with them who wins a tie.
#[test]
fn a_mix_that_grows_is_the_mix_recorded_so_large() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("acts.json"), ACTIONS).unwrap();
    for (place, [a, b, c]) in [["6", "3", "1"], ["5", "2", "2"], ["1", "0.4", "0.4"]].into_iter().enumerate() {
        for last in ["random:hold=3", "actions:acts.json"] {
            let command = format!("{COMMON} --mix random:{a},random:hold=2:{b},{last}:{c}");
            let [direct, grown] = ["direct", "grown"].map(|name| format!("{name}-{place}-{}", &last[..6]));
            works(folder, &format!("{command} --episodes 12 -o {direct}"));
            works(folder, &format!("{command} --episodes 2 -o {grown}"));
            works(folder, &format!("extend {grown} --episodes 7"));
            works(folder, &format!("extend {grown} --episodes 12"));
            assert_same_bytes(&folder.join(&direct), &folder.join(&grown));
            assert!(works(folder, &format!("{command} --episodes 12 -o {grown}")).contains("are there already"));
        }
    }
}

/// As an earlier version left it that had divided the shares once more.
#[test]
fn shares_that_an_earlier_version_rounded_otherwise_are_still_of_the_same_command() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    std::fs::write(folder.join("acts.json"), ACTIONS).unwrap();
    for last in ["random:hold=3", "actions:acts.json"] {
        let command = format!("{COMMON} --mix random:6,random:hold=2:3,{last}:1 --episodes 5");
        let name = &last[..6];
        works(folder, &format!("{command} -o {name}"));
        let again = |text: &str| text.parse::<PolicyMix>().unwrap().to_string();
        change_options(&folder.join(name), |options| {
            options["policy"] = again(&again(options["policy"].as_str().unwrap())).into();
        });
        let before = manifest(&folder.join(name));
        works(folder, &format!("{command} -o {name}"));
        assert_eq!(manifest(&folder.join(name)), before, "what it says stays");
        fails(folder, &format!("{command} -o {name}").replace(":6,", ":5,"), 1, "options.policy");
    }
}

#[test]
fn another_file_of_actions_is_not_played_into_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let file = folder.join("acts.json");
    std::fs::write(&file, ACTIONS).unwrap();
    let command = format!("{COMMON} --policy actions:acts.json --episodes 2");
    for name in ["known", "older"] {
        works(folder, &format!("{command} -o {name}"));
    }
    change_options(&folder.join("older"), |options| {
        options.as_object_mut().unwrap().remove("actions").unwrap();
    });
    std::fs::write(&file, "[[0.3], [0.4]]").unwrap();
    std::fs::remove_file(folder.join("known/episodes/000001.arrow")).unwrap();
    let said = "acts.json has other actions than this recording was begun with";
    fails(folder, &format!("{command} -o known"), 1, said);
    fails(folder, "extend known --episodes 3", 1, said);
    assert!(!folder.join("known/episodes/000001.arrow").exists(), "nothing was played");
    std::fs::write(&file, ACTIONS).unwrap();
    works(folder, &format!("{command} -o known"));
    works(folder, "extend known --episodes 3");
    // Of an older recording nobody knows what the file held.
    works(folder, &format!("{command} -o older"));
    works(folder, "extend older --episodes 3");
    assert_eq!(manifest(&folder.join("older"))["options"].get("actions"), None);
}

/// A policy that saw pictures acted by them: drawn under other distractors, its states are not what it would have done under these.
#[test]
fn what_a_seeing_policy_did_under_other_distractors_does_not_grow() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let kept = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../checkpoints/cartpole-swingup-online"));
    std::os::unix::fs::symlink(kept, folder.join("seeing")).unwrap();
    works(folder, "--policy seeing --episodes 2 --steps 3 --size 24 --no-mcap -o own");
    works(folder, "render own --size 16 -o small");
    works(folder, "render own --distract none -o bare");
    works(folder, "render bare --size 16 -o again");
    let mark = |name: &str| manifest(&folder.join(name))["options"].get("redrawn").cloned();
    assert_eq!(
        ["own", "small", "bare", "again"].map(mark),
        [None, None, Some(Value::Bool(true)), Some(Value::Bool(true))]
    );
    for name in ["bare", "again"] {
        fails(folder, &format!("extend {name} --episodes 3"), 1, "acted in it by pictures under other distractors");
    }
    works(folder, "extend small --episodes 3");
    works(folder, "--task cartpole-swingup --episodes 1 --steps 2 --size 16 --no-mcap -o blind");
    works(folder, "render blind --seed 3 -o other");
    assert_eq!(mark("other"), None, "nobody saw anything");
    works(folder, "extend other --episodes 2");
}
