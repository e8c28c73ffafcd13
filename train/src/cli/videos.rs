//! Background videos before a run: they are made once, which may take minutes; a signal is heard meanwhile. In: the world, and whether to stop. Out: the videos,
//! opened.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use vibes_env::videos::VideoSet;
use vibes_train::TrainError;
use vibes_train::online::options::WorldOptions;
use vibes_train::online::world::Libraries;

use super::Context;

/// Opens both sets; what is missing of either is made, and that is said once.
#[allow(clippy::print_stderr, reason = "progress of the command line")]
pub(super) fn open_videos(context: &Context, world: &WorldOptions, stop: &AtomicBool) -> Result<Libraries, TrainError> {
    let is_said = !context.quiet && !context.json;
    let open = |set: VideoSet| {
        let said = Once::new();
        world.video_library_while(set, &|missing| {
            if is_said {
                said.call_once(|| eprintln!("preparing {missing} videos of the set {} (once)", set.name()));
            }
            !stop.load(Ordering::Relaxed)
        })
    };
    Ok([open(VideoSet::Train)?, open(VideoSet::Val)?])
}
