//! Numbers for `--json`. JSON has no infinity, and where an error is infinite `null` would say that nothing was compared.

use serde_json::Value;

/// A number; an infinite one as the text `"Infinity"`, which the number readers of Python, JavaScript and Rust take, and none at all as null.
pub(super) fn number(number: impl Into<Option<f64>>) -> Value {
    let Some(number) = number.into() else { return Value::Null };
    if !number.is_infinite() {
        return number.into();
    }
    let text = if number > 0.0 { "Infinity" } else { "-Infinity" };
    text.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_infinite_number_is_not_taken_for_none() {
        let numbers = [number(0.5), number(f64::INFINITY), number(-f64::INFINITY), number(None::<f64>)];
        assert_eq!(Value::from(numbers.to_vec()).to_string(), r#"[0.5,"Infinity","-Infinity",null]"#);
        assert_eq!("Infinity".parse::<f64>(), Ok(f64::INFINITY));
    }
}
