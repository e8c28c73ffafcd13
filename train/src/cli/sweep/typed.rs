//! What a user types for runs and times. In: text, as in `0-3,7` and `3h50m`. Out: the runs' numbers, a duration.

use std::time::Duration;

use anyhow::{Result, anyhow};
use vibes_train::TrainError;

/// The runs that `3`, `0-3`, `0-3,7` or `slurm` means.
pub(super) fn indices(text: &str, count: usize) -> Result<Vec<usize>> {
    let wrong = |fact: String| anyhow!(TrainError::Options(fact));
    let text = if text == "slurm" {
        let name = "SLURM_ARRAY_TASK_ID";
        std::env::var(name)
            .map_err(|_none| wrong(format!("--index slurm needs {name}, which Slurm's job arrays set")))?
    } else {
        text.to_owned()
    };
    let mut all = Vec::new();
    for part in text.split(',') {
        let (first, last) = part.split_once('-').unwrap_or((part, part));
        let (Ok(first), Ok(last)) = (first.trim().parse::<usize>(), last.trim().parse::<usize>()) else {
            return Err(wrong(format!(
                "--index is {text}; a number, a range or a list is right, as in 3, 0-3 or 0-3,7"
            )));
        };
        if last >= count || first > last {
            return Err(wrong(format!("--index is {text}; the plan's runs are 0 to {}", count - 1)));
        }
        all.extend(first..=last);
    }
    Ok(all)
}

/// `3h50m`, `90s`, `1h30m10s`.
pub(super) fn parse_time(text: &str) -> Result<Duration, String> {
    let wrong = || format!("{text} is no time; 3h50m, 45m or 90s is right");
    let (mut seconds, mut digits) = (0_u64, String::new());
    for c in text.chars() {
        let unit = match c {
            '0'..='9' => {
                digits.push(c);
                continue;
            }
            'h' => 3600,
            'm' => 60,
            's' => 1,
            _ => return Err(wrong()),
        };
        let count: u64 = std::mem::take(&mut digits).parse().map_err(|_none| wrong())?;
        seconds = count.checked_mul(unit).and_then(|more| seconds.checked_add(more)).ok_or_else(wrong)?;
    }
    if digits.is_empty() && seconds > 0 { Ok(Duration::from_secs(seconds)) } else { Err(wrong()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_and_indices_are_read_and_what_is_none_is_refused() {
        assert_eq!(parse_time("3h50m").unwrap().as_secs(), 13_800);
        assert_eq!(parse_time("90s").unwrap().as_secs(), 90);
        for text in ["", "90", "h", "3x", "3h50", "0s"] {
            assert!(parse_time(text).is_err(), "{text}");
        }
        assert_eq!(indices("0-2,4", 5).unwrap(), [0, 1, 2, 4]);
        for text in ["5", "2-1", "x", "", "0-9"] {
            assert!(indices(text, 5).is_err(), "{text}");
        }
    }
}
