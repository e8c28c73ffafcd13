//! How numbers and progress look on a terminal, and plainly elsewhere.

use std::sync::{Mutex, Once};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::recorder::Progress;

/// Bytes, as people read them.
pub(super) fn bytes(count: u64) -> String {
    let units = ["B", "kB", "MB", "GB", "TB"];
    let mut value = count as f64;
    let mut unit = 0;
    while value >= 1000.0 && unit + 1 < units.len() {
        value /= 1000.0;
        unit += 1;
    }
    if unit == 0 { format!("{count} B") } else { format!("{value:.1} {}", units[unit]) }
}

/// A progress bar with a rate and an estimate on a terminal, a plain line every few seconds when it is not one.
pub(super) struct Meter {
    bar: Option<ProgressBar>,
    started: Instant,
    said: Mutex<Instant>,
    prepares: Once,
    quiet: bool,
}

/// Time between two plain lines.
const SAY_EVERY: Duration = Duration::from_secs(10);

impl Meter {
    pub(super) fn new(wanted: u64, quiet: bool) -> Self {
        let terminal = std::io::IsTerminal::is_terminal(&std::io::stderr());
        let bar = (terminal && !quiet).then(|| {
            let style = ProgressStyle::with_template("{bar:32} {pos}/{len} episodes  {msg}  {eta} left");
            ProgressBar::new(wanted).with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        let now = Instant::now();
        Self { bar, started: now, said: Mutex::new(now), prepares: Once::new(), quiet }
    }

    /// Says once that videos are made first, since nothing else is seen for minutes.
    #[allow(clippy::print_stderr, reason = "progress of the command line")]
    fn prepare(&self, videos: usize) {
        let say = || eprintln!("preparing {videos} videos (once)");
        self.prepares.call_once(|| match &self.bar {
            Some(bar) => bar.suspend(say),
            None if !self.quiet => say(),
            None => {}
        });
    }

    #[allow(clippy::print_stderr, reason = "progress of the command line")]
    pub(super) fn tell(&self, progress: Progress) {
        if progress.preparing > 0 {
            self.prepare(progress.preparing);
            return;
        }
        let rate = progress.rows as f64 / self.started.elapsed().as_secs_f64().max(1e-3);
        if let Some(bar) = &self.bar {
            bar.set_position(progress.episodes);
            bar.set_message(format!("{rate:.0} frames/s"));
            return;
        }
        let Ok(mut said) = self.said.lock() else { return };
        let finished = progress.episodes == progress.wanted;
        if !self.quiet && progress.rows > 0 && (said.elapsed() >= SAY_EVERY || finished) {
            *said = Instant::now();
            eprintln!("{} of {} episodes, {rate:.0} frames/s", progress.episodes, progress.wanted);
        }
    }

    pub(super) fn seconds(&self) -> f64 {
        self.started.elapsed().as_secs_f64()
    }

    pub(super) fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}
