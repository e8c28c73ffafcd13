//! `--videos` as typed, for recording, `render` and `preview`. In: what stands behind it. Out: where the videos come from.

use std::path::Path;

use vibes_env::videos::VideoSource;

/// The built-in videos for `procedural`, else a folder; `./procedural` is a folder of that name.
pub(super) fn source(typed: &Path) -> VideoSource {
    if typed.as_os_str() == "procedural" { VideoSource::Procedural } else { VideoSource::Folder(typed.to_owned()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_videos_have_a_name_and_a_folder_of_that_name_a_place() {
        assert_eq!(source(Path::new("procedural")), VideoSource::Procedural);
        for folder in ["./procedural", "sets/procedural", "films"] {
            assert_eq!(source(Path::new(folder)), VideoSource::Folder(folder.into()), "{folder}");
        }
    }
}
