//! How many decimals numbers of a table have: as many as the sizes of a mean and its interval ask for, and one number for a whole column, so that its numbers can be compared at a glance.

/// Most decimals of a mean.
const DECIMALS: i32 = 5;
/// Most digits of a column's largest number, where it is another one that asks for more.
const DIGITS: i32 = 5;

/// `mean ± half` with a minus sign, and with so many decimals.
#[must_use]
pub fn mean_text(mean: f64, half: Option<f64>, decimals: usize) -> String {
    let half = half.map_or_else(String::new, |h| format!(" ± {h:.decimals$}"));
    let mean = format!("{mean:.decimals$}");
    // What is rounded to nothing has no sign.
    let is_nothing = mean.chars().all(|sign| matches!(sign, '-' | '0' | '.'));
    let mean = if is_nothing { mean.replace('-', "") } else { mean.replace('-', "−") };
    mean + &half
}

/// The decimals of numbers of one kind, each a mean and half of its interval: as many as the one that asks for most, as long as the largest number then has no more than five digits, or asks
/// for more itself: a return of 0.0098 beside one of 250 is 0.01.
#[must_use]
pub fn common_decimals(numbers: impl IntoIterator<Item = (f64, Option<f64>)>) -> usize {
    let sized = |(mean, half): (f64, Option<f64>)| (mean.abs(), half.map_or(0.0, f64::abs));
    // Nothing has no digits, and what is no number has none either.
    let has_digits = |(mean, half): &(f64, f64)| mean.is_finite() && half.is_finite() && mean.max(*half) > 0.0;
    let sizes: Vec<(f64, f64)> = numbers.into_iter().map(sized).filter(has_digits).collect();
    let size = |number: &(f64, f64)| number.0.max(number.1);
    let Some(largest) = sizes.iter().copied().max_by(|a, b| size(a).total_cmp(&size(b))) else {
        return decimals(0.0, 0.0);
    };
    let room = (DIGITS - 1 - size(&largest).log10().floor() as i32).clamp(0, DECIMALS) as usize;
    let most = room.max(decimals(largest.0, largest.1));
    sizes.iter().map(|(mean, half)| decimals(*mean, *half).min(most)).max().unwrap_or(0)
}

/// As many decimals as the larger of the two numbers asks for, and enough that two digits of the smaller are seen.
fn decimals(mean: f64, half: f64) -> usize {
    let (mean, half) = (mean.abs(), half.abs());
    let usual = match mean.max(half) {
        a if a >= 100.0 => 0,
        a if a >= 10.0 => 1,
        _ => 2,
    };
    let smaller = [mean, half].into_iter().filter(|size| *size > 0.0 && size.is_finite()).reduce(f64::min);
    smaller.map_or(usual, |smaller| {
        let needed = (1 - smaller.log10().floor() as i32).clamp(0, DECIMALS);
        usual.max(needed as usize)
    })
}

#[cfg(test)]
mod tests {
    use super::{common_decimals, mean_text};

    #[test]
    fn two_digits_of_a_small_number_are_seen() {
        for (mean, half, text) in [
            (0.0042, Some(0.0011), "0.0042 ± 0.0011"),
            (-0.5, Some(0.012), "−0.500 ± 0.012"),
            (0.031, Some(0.2), "0.031 ± 0.200"),
            (930.0, Some(12.0), "930 ± 12"),
            (52.3, Some(17.5), "52.3 ± 17.5"),
            (700.0, Some(2.48), "700.0 ± 2.5"),
            (-123.4, Some(0.0), "−123 ± 0"),
            (1234.5, Some(0.012), "1234.500 ± 0.012"),
            (0.0042, None, "0.0042"),
            (2.5, None, "2.50"),
            (12.0, None, "12.0"),
            (0.0, None, "0.00"),
            (0.0, Some(0.0), "0.00 ± 0.00"),
            (-0.000_001, None, "0.00000"),
            (f64::NAN, None, "NaN"),
        ] {
            assert_eq!(mean_text(mean, half, common_decimals([(mean, half)])), text);
        }
    }

    #[test]
    fn numbers_of_one_column_have_one_number_of_decimals() {
        for (column, wanted) in [
            (vec![(930.0, Some(12.0)), (417.0, Some(2.5)), (670.0, None)], 1),
            (vec![(249.8, Some(42.0)), (0.0098, Some(0.0087))], 2),
            (vec![(0.0042, Some(0.0011)), (0.3, Some(0.2))], 4),
            // Neither nothing nor what is no number has digits.
            (vec![(930.0, None), (0.0, None), (f64::NAN, None)], 0),
            (vec![], 2),
        ] {
            assert_eq!(common_decimals(column.clone()), wanted, "{column:?}");
        }
    }
}
