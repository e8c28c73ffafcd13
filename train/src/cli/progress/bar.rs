//! A bar that knows where it begins: what was done before this process, or at another speed, says nothing of how fast it goes and how long it takes from here.

use std::fmt::Write;

use indicatif::{HumanDuration, ProgressBar, ProgressState, ProgressStyle};

/// A bar over so many of a unit, with the line that was said last below it.
pub(crate) fn bar(length: u64, unit: &str) -> ProgressBar {
    let template = format!("{{elapsed}} {{wide_bar}} {{pos}}/{{len}} {unit}, {{speed}}, {{left}}\n{{msg}}");
    let style = ProgressStyle::with_template(&template).unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(length).with_style(style.with_key("speed", speed).with_key("left", left))
}

/// Goes to a position and begins to count from there.
pub(crate) fn begin_at(bar: &ProgressBar, position: u64) {
    bar.set_position(position);
    // What the estimate goes by is told only now, whatever time has passed since it was last drawn.
    bar.tick();
    bar.reset_eta();
}

fn speed(state: &ProgressState, out: &mut dyn Write) {
    let speed = state.per_sec();
    // Writing to a String cannot fail.
    let _ = if speed >= 10.0 { write!(out, "{speed:.0}/s") } else { write!(out, "{speed:.1}/s") };
}

fn left(state: &ProgressState, out: &mut dyn Write) {
    let is_known = state.per_sec() > 0.0;
    let _ = if is_known { write!(out, "{:#} left", HumanDuration(state.eta())) } else { write!(out, "– left") };
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use indicatif::ProgressDrawTarget;

    use super::*;

    #[test]
    fn what_was_done_before_does_not_count_as_fast() {
        let bar = bar(1_000_000, "updates");
        bar.set_draw_target(ProgressDrawTarget::hidden());
        begin_at(&bar, 900_000);
        assert_eq!((bar.position(), bar.per_sec() > 0.0), (900_000, false));
        std::thread::sleep(Duration::from_millis(50));
        bar.set_position(900_001);
        bar.tick();
        assert!(bar.per_sec() > 0.0 && bar.per_sec() < 100.0, "{}", bar.per_sec());
    }
}
