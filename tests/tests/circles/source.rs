//! A source file as the circles are looked for in it. In: its text. Out: its code without comments, texts and tests, and the functions in it.

use std::collections::BTreeMap;

/// Words that an item begins with; whatever else stands behind an attribute is a field, a variant or a statement.
const BEGINNINGS: &str = "pub fn struct enum impl trait mod use const static type unsafe async extern macro_rules";

/// The code alone: no comments, nothing between quotes, no items of tests.
pub(crate) fn code_of(text: &str) -> String {
    without_tests(&without_prose(text))
}

/// The text without comments, and with nothing between the quotes of texts and characters.
fn without_prose(text: &str) -> String {
    let mut code = String::new();
    let mut rest = text;
    while let Some(next) = rest.chars().next() {
        let skipped = match next {
            '/' if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
            '/' if rest.starts_with("/*") => rest.find("*/").map_or(rest.len(), |end| end + 2),
            'r' if !code.ends_with(is_of_word) || code.ends_with('b') => raw_text(rest),
            '"' => 1 + quoted(&rest[1..], '"'),
            '\'' if rest[1..].starts_with('\\') || rest.chars().nth(2) == Some('\'') => 1 + quoted(&rest[1..], '\''),
            _ => 0,
        };
        if skipped == 0 {
            code.push(next);
        } else if !rest.starts_with('/') {
            code.push_str("\"\"");
        }
        rest = &rest[skipped.max(next.len_utf8())..];
    }
    code
}

/// How long a text is, from behind its opening quote to behind its closing one.
fn quoted(text: &str, quote: char) -> usize {
    let mut is_escaped = false;
    let end = text.char_indices().find(|&(_, c)| {
        let ends = c == quote && !is_escaped;
        is_escaped = c == '\\' && !is_escaped;
        ends
    });
    end.map_or(text.len(), |(at, _)| at + 1)
}

/// How long the raw text `r#"…"#` is that begins here; 0 if none does.
fn raw_text(text: &str) -> usize {
    let marks = text[1..].chars().take_while(|&c| c == '#').count();
    if !text[1 + marks..].starts_with('"') {
        return 0;
    }
    let end = format!("\"{}", "#".repeat(marks));
    text[2 + marks..].find(&end).map_or(text.len(), |at| 2 + marks + at + end.len())
}

fn is_of_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// The code without every item, field or statement that only tests have.
fn without_tests(code: &str) -> String {
    let mut kept = String::new();
    let mut rest = code;
    while let Some(at) = rest.find("#[cfg(test)]") {
        kept.push_str(&rest[..at]);
        rest = &rest[at + length_of_item(&rest[at..])..];
    }
    kept + rest
}

/// How long the item is that begins here, its attributes included.
fn length_of_item(code: &str) -> usize {
    let mut at = code.len() - code.trim_start().len();
    while code[at..].starts_with("#[") {
        at += 1 + closed(&code[at + 1..]);
        at += code[at..].len() - code[at..].trim_start().len();
    }
    let first: String = code[at..].chars().take_while(|&c| is_of_word(c)).collect();
    let is_item = BEGINNINGS.split(' ').any(|word| word == first);
    while let Some(next) = code[at..].chars().next() {
        match next {
            '(' | '[' => at += closed(&code[at..]),
            '{' => {
                at += closed(&code[at..]);
                let after = code[at..].trim_start();
                return if after.starts_with([';', ',']) { code.len() - after.len() + 1 } else { at };
            }
            ';' => return at + 1,
            ',' if !is_item => return at + 1,
            '}' | ')' => return at,
            _ => at += next.len_utf8(),
        }
    }
    code.len()
}

/// How long what stands in the brackets is that open here, both brackets included.
fn closed(code: &str) -> usize {
    let mut depth = 0_usize;
    for (at, next) in code.char_indices() {
        match next {
            '(' | '[' | '{' => depth += 1,
            ')' | ']' | '}' => depth = depth.saturating_sub(1),
            _ => continue,
        }
        if depth == 0 {
            return at + 1;
        }
    }
    code.len()
}

/// The functions of a module by name, those of its types left out.
pub(crate) fn functions(code: &str) -> BTreeMap<String, String> {
    let mut all = BTreeMap::new();
    let mut rest = code.trim_start();
    while !rest.is_empty() {
        let item = &rest[..length_of_item(rest).max(1)];
        all.extend(name_of(item).map(|name| (name, item.to_owned())));
        rest = rest[item.len()..].trim_start();
    }
    all
}

/// What an item is called, if it is a function.
fn name_of(item: &str) -> Option<String> {
    let head = item.split(['(', '{', ';', '=']).next()?;
    let mut words = head.split(|c: char| !is_of_word(c)).filter(|word| !word.is_empty());
    words.find(|word| *word == "fn")?;
    words.next().map(str::to_owned)
}

#[test]
fn only_the_items_of_tests_are_cut() {
    let text = r##"
        #[cfg(test)]
        mod tests;
        #[cfg(test)]
        use crate::gone::{A, B};
        struct Kept { #[cfg(test)] gone: Vec<(u8, u8)>, kept: char }
        #[cfg(test)]
        #[derive(Debug)]
        pub(super) fn gone<A, B>(a: [u8; 3]) -> A { "}"; '}'; r#"""}"#; /* } */ 'a' }
        impl<'a> Kept { const QUOTE: char = '\''; fn kept() -> &'a str { "crate::gone // \" }" } }
        fn also_kept() {} // crate::gone
    "##;
    let code = code_of(text);
    assert!(!code.contains("gone"), "{code}");
    assert!(code.contains("kept: char") && code.contains("also_kept"), "{code}");
    assert_eq!(functions(&code).keys().collect::<Vec<_>>(), ["also_kept"]);
}
