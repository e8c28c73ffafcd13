//! Background videos before a run: they are made once, which may take minutes; a signal is heard meanwhile. In: the world, and whether to stop. Out: the videos in
//! the cache.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use vibes_env::videos::VideoSet;
use vibes_train::TrainError;
use vibes_train::online::options::WorldOptions;

use super::Context;

/// Makes what is missing of either set, and says so once.
#[allow(clippy::print_stderr, reason = "progress of the command line")]
pub(super) fn make_videos(context: &Context, world: &WorldOptions, stop: &AtomicBool) -> Result<(), TrainError> {
    let is_said = !context.quiet && !context.json;
    for set in [VideoSet::Train, VideoSet::Val] {
        let said = Once::new();
        world.make_videos(set, &|missing| {
            if is_said {
                said.call_once(|| eprintln!("preparing {missing} videos of the set {} (once)", set.name()));
            }
            !stop.load(Ordering::Relaxed)
        })?;
    }
    Ok(())
}
