//! Which places a stage fills: of verbs that refuse what is there, and below the run's folder alone.

use super::*;

fn words(line: &str) -> Vec<String> {
    line.split_whitespace().map(str::to_owned).collect()
}

#[test]
fn verbs_that_refuse_what_is_there_have_places_and_others_none() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path().join("lr=1,seed=0");
    for (line, wanted) in [
        ("vibes-collect merge a b -o RUN/all", vec!["all"]),
        ("vibes-collect -q filter RUN/all --states 0 --output=RUN/deep/some", vec!["deep/some"]),
        ("vibes-collect export a --format parquet -oRUN/out", vec!["out"]),
        ("vibes-collect import --format minari a -o RUN/back", vec!["back"]),
        ("vibes-train keep RUN/run -o RUN/small", vec!["small"]),
        ("vibes-collect split a --names one,two -o RUN/x", vec!["x-one", "x-two", "x-train", "x-val", "x-test"]),
        ("vibes-collect split RUN/all --parts 0.5,0.5", vec!["all-train", "all-val", "all-test", "all-1", "all-2"]),
        // They go on where they were stopped.
        ("vibes-train offline RUN/all -o RUN/run", vec![]),
        ("vibes-collect --episodes 2 -o RUN/all", vec![]),
        ("vibes-collect render RUN/all -o RUN/drawn", vec![]),
        ("vibes-analyze table RUN/run -o RUN/tables", vec![]),
        // Not the run's own.
        ("vibes-collect merge a b -o shared", vec![]),
        ("vibes-collect merge a b -o RUN", vec![]),
        ("vibes-collect merge a b -o RUN/../shared", vec![]),
        ("vibes-collect split shared --parts 0.5,0.5", vec![]),
    ] {
        let line = words(&line.replace("RUN", &run.to_string_lossy()));
        assert_eq!(places(&line, &run), wanted, "{line:?}");
    }
}

#[test]
fn a_place_behind_a_link_is_not_the_runs_own() {
    let folder = tempfile::tempdir().unwrap();
    let (run, shared) = (folder.path().join("run"), folder.path().join("shared"));
    for place in [&run, &shared] {
        std::fs::create_dir(place).unwrap();
    }
    std::os::unix::fs::symlink(&shared, run.join("link")).unwrap();
    let line = words(&format!("vibes-collect merge a b -o {}", run.join("link/all").display()));
    assert!(places(&line, &run).is_empty());
}

#[test]
fn only_what_an_earlier_attempt_has_made_is_cleared() {
    let folder = tempfile::tempdir().unwrap();
    let run = folder.path();
    let line = words(&format!("vibes-collect merge a b -o {}", run.join("all").display()));
    let earlier = ["all".to_owned(), "other".to_owned()];
    for place in ["all", "other"] {
        std::fs::create_dir(run.join(place)).unwrap();
        std::fs::write(run.join(place).join("file"), place).unwrap();
    }
    assert!(make_room(&line, run, &[]).unwrap().is_empty() && run.join("all/file").is_file(), "it was there before");
    assert_eq!(make_room(&line, run, &earlier).unwrap(), ["all"]);
    assert!(!run.join("all").exists() && run.join("other/file").is_file(), "the stage does not make the other");
}
