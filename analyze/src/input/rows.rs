//! `--where EXPRESSION`: which rows of a table are looked at, as in `step >= 50 and state in (0, 3)`.
//!
//! In: the text. Out: a polars expression and the columns it needs. The language is that of SQL's `WHERE` without functions: columns, numbers,
//! 'texts', `true`, `false`; `+ - * / %`; `= == != <> < <= > >=`, `in (…)`, `is null`, `is not null`; `and`, `or`, `not`; parentheses. A column whose
//! name is no word is written in "double quotes". What is not a number is null, in a column as in what `/` and `%` make.

use polars::prelude::{Column, DataType, Expr, PolarsResult, col, lit};

/// Rows chosen by an expression.
#[derive(Clone, Debug)]
pub struct Rows {
    /// As it was typed.
    pub text: String,
    /// As polars takes it.
    pub expression: Expr,
    /// The columns it needs, each once.
    pub columns: Vec<String>,
}

/// What is wrong with an expression: a fact, and what would be right.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{fact} in the expression {text:?}; right would be, as an example: step >= 50 and state in (0, 3)")]
pub struct RowsError {
    fact: String,
    text: String,
}

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Word(String),
    Column(String),
    Text(String),
    Number(f64),
    Sign(&'static str),
}

/// Longer signs stand before their beginnings.
const SIGNS: [&str; 20] =
    ["==", "!=", "<>", "<=", ">=", "&&", "||", "=", "<", ">", "(", ")", ",", "+", "-", "*", "/", "%", "!", "&"];
/// Deepest nesting, so that a hostile text cannot exhaust the stack.
const DEEPEST: usize = 60;

impl std::str::FromStr for Rows {
    type Err = RowsError;

    fn from_str(text: &str) -> Result<Self, RowsError> {
        let fault = |fact: String| RowsError { fact, text: text.into() };
        let tokens = tokens(text).map_err(fault)?;
        let mut parser = Parser { tokens, at: 0, depth: 0, columns: Vec::new() };
        let expression = parser.either().map_err(fault)?;
        match parser.tokens.get(parser.at) {
            None => Ok(Self { text: text.into(), expression, columns: parser.columns }),
            Some(token) => Err(fault(format!("{} too many", token.name()))),
        }
    }
}

fn tokens(text: &str) -> Result<Vec<Token>, String> {
    let mut tokens = Vec::new();
    let mut rest = text.trim_start();
    while let Some(first) = rest.chars().next() {
        let length = if first == '\'' || first == '"' {
            let inside = &rest[1..];
            let end = inside.find(first).ok_or_else(|| format!("a {first} that is never closed"))?;
            let quoted = inside[..end].to_string();
            tokens.push(if first == '"' { Token::Column(quoted) } else { Token::Text(quoted) });
            end + 2
        } else if first.is_ascii_digit() || first == '.' {
            let end = number_length(rest);
            tokens.push(Token::Number(rest[..end].parse().map_err(|_e| format!("no number: {}", &rest[..end]))?));
            end
        } else if let Some(sign) = SIGNS.into_iter().find(|sign| rest.starts_with(sign)) {
            tokens.push(Token::Sign(sign));
            sign.len()
        } else {
            let is_word = |c: char| c.is_alphanumeric() || matches!(c, '_' | '.' | '[' | ']');
            let end = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
            if end == 0 {
                return Err(format!("a sign {first:?} without meaning"));
            }
            tokens.push(Token::Word(rest[..end].into()));
            end
        };
        rest = rest[length..].trim_start();
    }
    Ok(tokens)
}

/// Digits, a point, and an exponent with its sign.
fn number_length(text: &str) -> usize {
    let bytes = text.as_bytes();
    let signed = |i: usize| matches!(bytes[i], b'+' | b'-') && matches!(bytes[i - 1], b'e' | b'E');
    (1..bytes.len())
        .find(|&i| !(bytes[i].is_ascii_digit() || matches!(bytes[i], b'.' | b'e' | b'E') || signed(i)))
        .unwrap_or(bytes.len())
}

impl Token {
    fn name(&self) -> String {
        match self {
            Self::Word(text) | Self::Column(text) | Self::Text(text) => text.clone(),
            Self::Number(number) => number.to_string(),
            Self::Sign(sign) => (*sign).into(),
        }
    }
}

struct Parser {
    tokens: Vec<Token>,
    at: usize,
    depth: usize,
    columns: Vec<String>,
}

type Parsed = Result<Expr, String>;

impl Parser {
    fn word(&mut self, word: &str) -> bool {
        let found = matches!(self.tokens.get(self.at), Some(Token::Word(w)) if w.eq_ignore_ascii_case(word));
        self.at += usize::from(found);
        found
    }

    fn sign(&mut self, signs: &[&'static str]) -> Option<&'static str> {
        let Some(Token::Sign(sign)) = self.tokens.get(self.at) else { return None };
        let found = signs.iter().find(|s| *s == sign).copied();
        self.at += usize::from(found.is_some());
        found
    }

    fn needed(&mut self, sign: &'static str) -> Result<(), String> {
        self.sign(&[sign]).map(|_| ()).ok_or_else(|| format!("{sign} is missing"))
    }

    /// One level down; whoever calls it comes up again.
    fn deeper(&mut self) -> Result<(), String> {
        self.depth += 1;
        if self.depth > DEEPEST { Err(format!("more than {DEEPEST} levels of nesting")) } else { Ok(()) }
    }

    fn either(&mut self) -> Parsed {
        self.deeper()?;
        let mut left = self.both()?;
        while self.word("or") || self.sign(&["||"]).is_some() {
            left = left.or(self.both()?);
        }
        self.depth -= 1;
        Ok(left)
    }

    fn both(&mut self) -> Parsed {
        let mut left = self.negation()?;
        while self.word("and") || self.sign(&["&&", "&"]).is_some() {
            left = left.and(self.negation()?);
        }
        Ok(left)
    }

    fn negation(&mut self) -> Parsed {
        let mut negative = false;
        while self.word("not") || self.sign(&["!"]).is_some() {
            negative = !negative;
        }
        let expression = self.comparison()?;
        Ok(if negative { expression.not() } else { expression })
    }

    fn comparison(&mut self) -> Parsed {
        let left = self.sum()?;
        if let Some(sign) = self.sign(&["==", "=", "!=", "<>", "<=", ">=", "<", ">"]) {
            let right = self.sum()?;
            return Ok(match sign {
                "=" | "==" => left.eq(right),
                "!=" | "<>" => left.neq(right),
                "<" => left.lt(right),
                "<=" => left.lt_eq(right),
                ">" => left.gt(right),
                _ => left.gt_eq(right),
            });
        }
        if self.word("is") {
            let negative = self.word("not");
            if !self.word("null") {
                return Err("is must be followed by null or not null".into());
            }
            return Ok(if negative { left.is_not_null() } else { left.is_null() });
        }
        let before = self.at;
        let negative = self.word("not");
        if self.word("in") {
            self.needed("(")?;
            let mut any = left.clone().eq(self.sum()?);
            while self.sign(&[","]).is_some() {
                any = any.or(left.clone().eq(self.sum()?));
            }
            self.needed(")")?;
            return Ok(if negative { any.not() } else { any });
        }
        self.at = before;
        Ok(left)
    }

    fn sum(&mut self) -> Parsed {
        let mut left = self.product()?;
        while let Some(sign) = self.sign(&["+", "-"]) {
            let right = self.product()?;
            left = if sign == "+" { left + right } else { left - right };
        }
        Ok(left)
    }

    fn product(&mut self) -> Parsed {
        let mut left = self.value()?;
        while let Some(sign) = self.sign(&["*", "/", "%"]) {
            let right = self.value()?;
            left = match sign {
                "*" => left * right,
                // As everywhere else in numbers: whole ones would lose their fraction.
                "/" => known(left.strict_cast(DataType::Float64) / right),
                _ => known(left % right),
            };
        }
        Ok(left)
    }

    fn value(&mut self) -> Parsed {
        if self.sign(&["("]).is_some() {
            let inside = self.either()?;
            self.needed(")")?;
            return Ok(inside);
        }
        if self.sign(&["-"]).is_some() {
            self.deeper()?;
            let value = self.value()?;
            self.depth -= 1;
            return Ok(lit(0) - value);
        }
        let token = self.tokens.get(self.at).cloned().ok_or("nothing where a value is expected")?;
        self.at += 1;
        Ok(match token {
            Token::Word(word) if word.eq_ignore_ascii_case("true") => lit(true),
            Token::Word(word) if word.eq_ignore_ascii_case("false") => lit(false),
            Token::Word(name) | Token::Column(name) => {
                if !self.columns.contains(&name) {
                    self.columns.push(name.clone());
                }
                known(col(name))
            }
            Token::Text(text) => lit(text),
            Token::Number(number) if number.fract() == 0.0 && number.abs() < 9e15 => lit(number as i64),
            Token::Number(number) => lit(number),
            Token::Sign(sign) => return Err(format!("{sign} where a value is expected")),
        })
    }
}

/// The same without what is not a number, which polars takes as larger than every number.
fn known(expression: Expr) -> Expr {
    expression.map(without_nan, |_, field| Ok(field.clone()))
}

/// A column with nothing in the place of NaN; others than of floats as they are.
fn without_nan(column: Column) -> PolarsResult<Column> {
    if !column.dtype().is_float() {
        return Ok(column);
    }
    let wide = column.cast(&DataType::Float64)?;
    let values: Vec<Option<f64>> = wide.f64()?.iter().map(|value| value.filter(|value| !value.is_nan())).collect();
    Column::new(column.name().clone(), values).cast(column.dtype())
}

#[cfg(test)]
mod tests {
    use polars::prelude::{IntoLazy, df};

    use super::*;

    fn rows(text: &str) -> Vec<i32> {
        let frame =
            df!("step" => [0, 1, 2, 3, 4, 5], "reward" => [Some(0.5), None, Some(-1.0), Some(2.0), None, Some(0.0)],
            "kind" => ["a", "b", "a", "b", "a", "c"])
            .expect("frame");
        let parsed: Rows = text.parse().expect(text);
        let kept = frame.lazy().filter(parsed.expression).collect().expect(text);
        let steps = kept.column("step").expect("step").i32().expect("integers");
        steps.into_no_null_iter().collect()
    }

    #[test]
    fn expressions_choose_the_rows_that_they_say() {
        assert_eq!(rows("step >= 2 and step < 4"), [2, 3]);
        assert_eq!(rows("step = 1 or kind = 'c'"), [1, 5]);
        assert_eq!(rows("not (step > 1) or kind == 'c' and reward <> 1"), [0, 1, 5], "and binds tighter than or");
        assert_eq!(rows("kind in ('a', 'c')"), [0, 2, 4, 5]);
        assert_eq!(rows("step not in (0, 1, 2)"), [3, 4, 5]);
        assert_eq!(rows("reward is null"), [1, 4]);
        assert_eq!(rows("reward is not null and reward * 2 + 1 < -0.5"), [2]);
        assert_eq!(rows("\"step\" % 2 == 0 && reward > -1e0"), [0]);
        assert_eq!(rows("reward > -5 AND NOT true"), Vec::<i32>::new());
        assert_eq!(
            (rows("step / 2 = 1"), rows("step / 2 = 0.5")),
            (vec![2], vec![1]),
            "halves of whole numbers are halves"
        );
    }

    /// Polars takes NaN as larger than every number, and as no null.
    #[test]
    fn what_is_not_a_number_is_null() {
        let none = f64::NAN;
        let frame =
            df!("step" => [0, 1, 2, 3], "height" => [1.0, none, -1.0, 0.0], "single" => [0.1_f32, f32::NAN, 2.0, 0.0])
                .expect("frame");
        let rows = |text: &str| {
            let parsed: Rows = text.parse().expect(text);
            let kept = frame.clone().lazy().filter(parsed.expression).collect().expect(text);
            kept.column("step").expect("step").i32().expect("integers").into_no_null_iter().collect::<Vec<i32>>()
        };
        assert_eq!((rows("height > 0"), rows("single >= 0.1")), (vec![0], vec![0, 2]));
        assert_eq!((rows("height is null"), rows("single is null")), (vec![1], vec![1]));
        assert_eq!(rows("not (height <= 0)"), [0]);
        assert_eq!(rows("height / height > 0"), [0, 2], "0 / 0 is no number");
        assert_eq!(rows("height % 0.0 is null"), [0, 1, 2, 3]);
        assert_eq!(rows("height / step is null"), [1], "-1 / 2 and 1 / 0 are something");
    }

    /// Only what stands inside something else is nested.
    #[test]
    fn an_expression_may_hold_many_negative_numbers() {
        let many: Vec<String> = (1..=DEEPEST + 10).map(|number| format!("-{number}")).collect();
        assert_eq!(rows(&format!("reward in ({})", many.join(", "))), [2]);
        assert_eq!(rows(&format!("step{} = 5", " - -1".repeat(3))), [2]);
    }

    #[test]
    fn an_expression_names_its_columns() {
        let parsed: Rows = "a > 1 and \"the reward\" < a or latent[3] = 0".parse().expect("expression");
        assert_eq!(parsed.columns, ["a", "the reward", "latent[3]"]);
    }

    #[test]
    fn what_is_wrong_is_said() {
        let fault = |text: &str| text.parse::<Rows>().expect_err(text).fact;
        assert_eq!(fault("step >="), "nothing where a value is expected");
        assert_eq!(fault("step > 3 4"), "4 too many");
        assert_eq!(fault("(step > 3"), ") is missing");
        assert_eq!(fault("kind = 'a"), "a ' that is never closed");
        assert_eq!(fault("step ~ 3"), "a sign '~' without meaning");
        assert!(fault(&"(".repeat(10_000)).contains("levels of nesting"));
        assert!(fault(&"-".repeat(10_000)).contains("levels of nesting"));
        assert_eq!(fault("step is 3"), "is must be followed by null or not null");
    }
}
