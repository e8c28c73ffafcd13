//! Numbers as text on axes, and the sizes of what is written there.

/// Size of tick labels, points.
pub const TICK_SIZE: f64 = 6.0;
/// Size of axis titles and legends, points.
pub const LABEL_SIZE: f64 = 7.0;
/// Size of figure titles, points.
pub const TITLE_SIZE: f64 = 8.0;

/// A tick's label: as many decimals as it needs, thousands as `k`, millions as `M`, a true minus sign. `largest` is the largest value of the axis, which
/// decides the unit for all its labels.
#[must_use]
pub fn tick(value: f64, largest: f64) -> String {
    let (unit, suffix) = match largest.abs() {
        v if v >= 2e6 => (1e6, "M"),
        v if v >= 1e4 => (1e3, "k"),
        _ => (1.0, ""),
    };
    let value = value / unit;
    if value.abs() < 1e-12 {
        return "0".into();
    }
    let text = format!("{value:.6}");
    minus(&format!("{}{suffix}", text.trim_end_matches('0').trim_end_matches('.')))
}

/// A number's text with a minus sign in place of the hyphen.
#[must_use]
pub fn minus(text: &str) -> String {
    text.replace('-', "−")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn labels_have_the_decimals_they_need() {
        let labels = |values: &[f64]| -> Vec<String> {
            let largest = values.iter().fold(0.0f64, |m, v| m.max(v.abs()));
            values.iter().map(|&v| tick(v, largest)).collect()
        };
        assert_eq!(labels(&[0.0, 0.25, 0.5]), ["0", "0.25", "0.5"]);
        assert_eq!(labels(&[-20.0, 0.0, 20.0]), ["−20", "0", "20"]);
        assert_eq!(labels(&[0.0, 50_000.0, 100_000.0]), ["0", "50k", "100k"]);
        assert_eq!(labels(&[0.0, 2e6, 4e6]), ["0", "2M", "4M"]);
    }
}
