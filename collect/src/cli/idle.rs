//! Options that would have no effect beside the others, as those about distractors that are not there: given, they are wrong.

use vibes_command::Given;
use vibes_env::distractors::Axes;

use crate::error::{Error, Result};

/// What is only looked at where an axis is there.
const OF_BACKGROUND: [&str; 4] = ["videos", "video_set", "video_count", "background_seed"];
const OF_CAMERA: [&str; 1] = ["camera_seed"];
const OF_COLOR: [&str; 1] = ["color_seed"];
/// What is only looked at where any is there.
const OF_ANY: [&str; 3] = ["difficulty", "dynamic", "static"];
/// What is only looked at where a recording is made.
const OF_RECORDING: [&str; 5] = ["output", "no_mcap", "no_pixels", "size", "render"];

/// # Errors
/// One of the given options is about an axis that these are without.
pub(super) fn check(given: &Given, axes: Axes) -> Result<()> {
    let groups: [(bool, &[&str], &str); 4] = [
        (axes.background, &OF_BACKGROUND, "background"),
        (axes.camera, &OF_CAMERA, "camera"),
        (axes.color, &OF_COLOR, "color"),
        (axes != Axes::NONE, &OF_ANY, "all"),
    ];
    let idle = groups.into_iter().filter(|(is_there, ..)| !is_there);
    let mut found = idle.filter_map(|(_, options, axis)| Some((given.first_of(options.iter().copied())?, axis)));
    found.next().map_or(Ok(()), |(option, axis)| {
        Err(self::option(
            &option,
            "there are no such distractors",
            &format!("leave it out, or ask for them with --distract {axis}"),
        ))
    })
}

/// # Errors
/// One of the given options is about videos that nobody sees: nothing is drawn, and whoever acts sees no pictures.
pub(super) fn check_unseen(given: &Given) -> Result<()> {
    given
        .first_of(OF_BACKGROUND)
        .map_or(Ok(()), |found| Err(option(&found, "no pictures are drawn", "leave it out, or leave out --no-pixels")))
}

/// # Errors
/// One of the given options is about a recording, and none is made; or a grid was asked for, whose columns nobody acts under.
pub(super) fn check_unrecorded(given: &Given) -> Result<()> {
    if let Some(found) = given.first_of(OF_RECORDING) {
        return Err(option(&found, "nothing is recorded", "leave it out, or leave out --no-record"));
    }
    given.first_of(["grid"]).map_or(Ok(()), |found| {
        let why = "a policy acts once for every row, and its columns are pictures of a recording";
        Err(option(&found, why, "ask for as many --episodes as it has rows, or leave out --no-record"))
    })
}

/// # Errors
/// One of the given options is about distractors, and nothing is recorded that whoever acts does not see.
pub(super) fn check_unseen_by_anyone(given: &Given) -> Result<()> {
    let options = OF_BACKGROUND.into_iter().chain(OF_CAMERA).chain(OF_COLOR).chain(OF_ANY).chain(["distract"]);
    given.first_of(options).map_or(Ok(()), |found| {
        let why = "nothing is recorded, and whoever acts sees no pictures";
        Err(option(&found, why, "leave it out, or leave out --no-record"))
    })
}

/// # Errors
/// A seed of distractors was given where there are none.
pub(super) fn check_seed(given: &Given, axes: Axes) -> Result<()> {
    let found = given.first_of(["seed"]).filter(|_| axes == Axes::NONE);
    found.map_or(Ok(()), |found| {
        Err(option(&found, "there are no distractors", "leave it out, or ask for some with --distract all"))
    })
}

/// The error for an option that was given and has no effect.
pub(super) fn option(option: &str, why: &str, expected: &str) -> Error {
    Error::Selection { fact: format!("{option} has no effect: {why}"), expected: expected.to_owned() }
}
