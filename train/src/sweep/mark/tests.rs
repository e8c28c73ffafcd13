//! What a sweep notes of an element: options that are given twice, what a stage waits for and makes, and how it is stopped.

use super::*;

fn element(folder: &Path, stages: &[&str]) -> Element {
    let words = |stage: &&str| stage.split_whitespace().map(str::to_owned).collect();
    Element {
        index: 0,
        name: "run".to_owned(),
        folder: folder.join("run"),
        settings: BTreeMap::new(),
        stages: stages.iter().map(words).collect(),
    }
}

/// Of an option that is given twice, neither value hides the other.
#[test]
fn a_changed_value_of_an_option_that_is_given_twice_is_seen() {
    let folder = tempfile::tempdir().unwrap();
    let before = "vibes-collect --mix a --mix b -o x";
    Mark::of(&element(folder.path(), &[before])).write(&element(folder.path(), &[before])).unwrap();
    let found = |stage: &str| Mark::found(&element(folder.path(), &[stage])).map_err(|error| error.to_string());
    assert!(found(before).unwrap().is_some() && found("vibes-collect --mix=a --mix=b -o x").unwrap().is_some());
    for (after, wanted) in [
        ("vibes-collect --mix c --mix b -o x", "stage 1 --mix is a, in the plan c"),
        ("vibes-collect --mix a --mix c -o x", "stage 1 --mix #2 is b, in the plan c"),
        ("vibes-collect --mix b -o x", "stage 1 --mix #2 is b, in the plan nothing"),
        ("vibes-collect --mix a --mix b --mix c -o x", "stage 1 --mix #3 is nothing, in the plan c"),
    ] {
        let fault = found(after).unwrap_err();
        assert!(fault.contains(wanted), "{after}: {fault}");
    }
}

/// Why a stage waits is in its mark for as long as it waits, so that it can be asked from anywhere.
#[test]
fn what_a_stage_waits_for_is_noted_while_it_waits() {
    let folder = tempfile::tempdir().unwrap();
    let element = element(folder.path(), &["vibes-train offline coins -o busy"]);
    let waiting = || Mark::found(&element).unwrap().unwrap().waiting;
    let mut attempts = 0;
    let end = run_element::<TrainError>(&element, &AtomicBool::new(false), &mut |_words| {
        attempts += 1;
        let noted = waiting();
        match attempts {
            1 => assert_eq!(noted, None),
            _ => assert_eq!(noted.as_deref(), Some("another is writing here")),
        }
        Ok(if attempts < 3 { StageEnd::Again(Some("another is writing here".to_owned())) } else { StageEnd::Done })
    });
    assert_eq!((end.unwrap(), attempts), (Some(StageEnd::Done), 3));
    assert_eq!(waiting(), None);
}

/// Who stops a run that waits finds it saved, and no longer waiting.
#[test]
fn a_stage_that_waits_can_be_stopped() {
    let folder = tempfile::tempdir().unwrap();
    let element = element(folder.path(), &["vibes-train offline coins -o busy"]);
    let stop = AtomicBool::new(false);
    let end = run_element::<TrainError>(&element, &stop, &mut |_words| {
        stop.store(true, Ordering::Relaxed);
        Ok(StageEnd::Again(Some("another is writing here".to_owned())))
    });
    assert_eq!(end.unwrap(), Some(StageEnd::Again(None)));
    let mark = Mark::found(&element).unwrap().unwrap();
    assert_eq!((mark.waiting, mark.finished, mark.error), (None, 0, None));
}

/// Makes a folder that must not be there yet, as the verbs do that refuse one which is.
fn make(place: &Path) -> Result<StageEnd> {
    std::fs::create_dir(place).map_err(io("create", place))?;
    std::fs::write(place.join("file"), "whole").map_err(io("write", place))?;
    Ok(StageEnd::Done)
}

fn merge_into(folder: &Path) -> (Element, PathBuf) {
    let place = folder.join("run/all");
    let stage = format!("vibes-collect merge a b -o {}", place.display());
    (element(folder, &[stage.as_str()]), place)
}

/// The moment between a stage's last file and the note that it is done.
#[test]
fn what_a_stage_had_made_when_it_was_killed_is_not_in_its_own_way() {
    let folder = tempfile::tempdir().unwrap();
    let (element, place) = merge_into(folder.path());
    let mark = path(&element.folder);
    for attempt in 0..3 {
        let mut at_the_kill = String::new();
        let end = run_element::<TrainError>(&element, &AtomicBool::new(false), &mut |_words| {
            at_the_kill = std::fs::read_to_string(&mark).unwrap();
            make(&place)
        });
        assert_eq!(end.unwrap(), Some(StageEnd::Done), "attempt {attempt}");
        assert_eq!(
            run_element::<TrainError>(&element, &AtomicBool::new(false), &mut |_words| make(&place)).unwrap(),
            None
        );
        std::fs::write(&mark, at_the_kill).unwrap();
    }
}

/// Also where it ended before the eyes of the sweep, as a program does that the system has killed.
#[test]
fn what_a_failed_stage_had_made_is_not_in_its_own_way() {
    let folder = tempfile::tempdir().unwrap();
    let (element, place) = merge_into(folder.path());
    let failed = run_element::<TrainError>(&element, &AtomicBool::new(false), &mut |_words| {
        make(&place)?;
        Err(TrainError::Options("ended with signal 9".to_owned()))
    });
    assert!(failed.is_err() && place.join("file").is_file());
    let end = run_element::<TrainError>(&element, &AtomicBool::new(false), &mut |_words| make(&place));
    assert_eq!(end.unwrap(), Some(StageEnd::Done));
}

#[test]
fn what_was_there_before_a_stage_stays() {
    let folder = tempfile::tempdir().unwrap();
    let (element, place) = merge_into(folder.path());
    std::fs::create_dir_all(&element.folder).unwrap();
    std::fs::create_dir(&place).unwrap();
    std::fs::write(place.join("mine"), "").unwrap();
    for attempt in 0..3 {
        assert!(
            run_element::<TrainError>(&element, &AtomicBool::new(false), &mut |_words| make(&place)).is_err(),
            "{attempt}"
        );
        assert!(place.join("mine").is_file(), "attempt {attempt}");
    }
    // A stage that failed before it made anything owns nothing that somebody puts there afterwards.
    std::fs::remove_dir_all(&place).unwrap();
    let failed = run_element::<TrainError>(&element, &AtomicBool::new(false), &mut |_words| {
        Err(TrainError::Options("no recording here".to_owned()))
    });
    std::fs::create_dir(&place).unwrap();
    std::fs::write(place.join("mine"), "").unwrap();
    assert!(
        failed.is_err()
            && run_element::<TrainError>(&element, &AtomicBool::new(false), &mut |_words| make(&place)).is_err()
    );
    assert!(place.join("mine").is_file());
}
