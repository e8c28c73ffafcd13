//! Background videos before a run: they are made once, which may take minutes; a signal is heard meanwhile. In: the world, and whether to stop. Out: the videos in
//! the cache.

use std::sync::Once;
use std::sync::atomic::{AtomicBool, Ordering};

use vibes_train::TrainError;
use vibes_train::online::options::WorldOptions;

use super::Context;

/// Makes what is missing, and says so once.
#[allow(clippy::print_stderr, reason = "progress of the command line")]
pub(super) fn make_videos(context: &Context, world: &WorldOptions, stop: &AtomicBool) -> Result<(), TrainError> {
    let (is_said, said) = (!context.quiet && !context.json, Once::new());
    world.make_videos(&|missing| {
        if is_said {
            said.call_once(|| eprintln!("preparing {missing} videos (once)"));
        }
        !stop.load(Ordering::Relaxed)
    })
}
