//! One self-contained HTML page: the verdict, figures and numbers, and maps that answer.
//!
//! In: the verdict, chapters of sections with figures as SVG, and live maps with their frames. Out: one file that needs no network and no other file.

mod live_map;
mod verdict;

use std::fmt::Write as _;
use std::path::Path;

pub use live_map::{LiveColumn, LiveMap};
pub use verdict::{Answer, Measure, Verdict};

use crate::picture::PAGE;
use crate::picture::svg::escape;

/// Bytes of a page that can still be sent by mail; the frames of its maps take what words, figures and numbers leave of it.
const PAGE_BYTES: usize = 14_500_000;
/// Most and least bytes of all the frames of a page.
const FRAME_BYTES: (usize, usize) = (300_000, 5_000_000);

/// A page.
#[derive(Clone, Debug, Default)]
pub struct Page {
    /// What it is about, as in "reacher-easy: what do the latents of three runs hold?".
    pub title: String,
    /// What must be known before reading.
    pub note: Option<String>,
    /// Where the numbers come from, in a sentence.
    pub origin: String,
    /// What must be known of its numbers, a sentence each.
    pub remarks: Vec<String>,
    /// The answer, before everything else.
    pub verdict: Verdict,
    /// Maps to look into, side by side.
    pub maps: Vec<LiveMap>,
    /// What must be known about the maps.
    pub map_remarks: Vec<String>,
    /// Everything in detail.
    pub chapters: Vec<Chapter>,
}

/// A figure of the page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shown {
    /// The SVG document.
    pub svg: String,
    /// For those who cannot see it.
    pub alt: String,
    /// Whether it needs the width of the page to be read.
    pub broad: bool,
}

impl Shown {
    /// A figure; its width in points decides how much room it gets.
    #[must_use]
    pub fn new(svg: String, alt: String) -> Self {
        let width = svg.split("width=\"").nth(1).and_then(|rest| rest.split("pt\"").next()?.parse::<f64>().ok());
        Self { broad: width.is_some_and(|width| width > 0.75 * PAGE), svg, alt }
    }
}

/// One question and its answer.
#[derive(Clone, Debug, Default)]
pub struct Section {
    /// The question.
    pub title: String,
    /// How to read the figures, in one sentence.
    pub reading: String,
    /// The line of result; or why there is none.
    pub result: String,
    /// What the reader must know.
    pub remarks: Vec<String>,
    /// The figures.
    pub figures: Vec<Shown>,
    /// The numbers, as JSON; shown folded.
    pub numbers: Option<String>,
}

/// A group of sections: a run, or what runs have in common.
#[derive(Clone, Debug, Default)]
pub struct Chapter {
    /// Its name.
    pub title: String,
    /// Where the numbers come from.
    pub origin: String,
    /// Its sections.
    pub sections: Vec<Section>,
}

impl Page {
    /// The page as HTML.
    #[must_use]
    pub fn html(&self) -> String {
        let mut body = format!("<h1>{}</h1>\n", escape(&self.title));
        if let Some(note) = &self.note {
            let _ = writeln!(body, "<p class=\"note\">{}</p>", escape(note));
        }
        let _ = writeln!(body, "<p class=\"origin\">{}</p>", escape(&self.origin));
        for remark in &self.remarks {
            let _ = writeln!(body, "<p class=\"remark\">{}</p>", escape(remark));
        }
        self.verdict.write(&mut body);
        contents(&mut body, &self.chapters, !self.maps.is_empty());
        let (mut answers, mut data) = (String::new(), String::new());
        for (c, chapter) in self.chapters.iter().enumerate() {
            let _ = writeln!(
                answers,
                "<h2 id=\"c{c}\">{}</h2>\n<p class=\"origin\">{}</p>",
                escape(&chapter.title),
                escape(&chapter.origin)
            );
            for (s, section) in chapter.sections.iter().enumerate() {
                let _ = writeln!(answers, "<section id=\"c{c}s{s}\">");
                section.write(&mut answers);
                answers.push_str("</section>\n");
            }
        }
        self.write_maps(&mut body, &mut data, answers.len());
        body.push_str(&answers);
        let title = escape(&self.title);
        let parts = [
            ("title", title.as_str()),
            ("style", include_str!("report/page.css")),
            ("script", include_str!("report/live_map.js")),
            ("data", data.as_str()),
            ("body", body.as_str()),
        ];
        filled(include_str!("report/page.html"), &parts)
    }

    /// Writes the maps and their data; `others` are the bytes of the rest of the page.
    fn write_maps(&self, body: &mut String, data: &mut String, others: usize) {
        if self.maps.is_empty() {
            return;
        }
        let alone = if self.maps.len() == 1 { " alone" } else { "" };
        body.push_str("<h2 id=\"maps\">Look into the latents</h2>\n");
        for remark in &self.map_remarks {
            let _ = writeln!(body, "<p class=\"remark\">{}</p>", escape(remark));
        }
        let _ = writeln!(body, "<div class=\"maps{alone}\">");
        let numbers: usize = self.maps.iter().map(LiveMap::number_bytes).sum();
        // As text three bytes are four.
        let room = PAGE_BYTES.saturating_sub(others + numbers) / 4 * 3;
        let frames = room.clamp(FRAME_BYTES.0, FRAME_BYTES.1) / self.maps.len();
        for (number, map) in self.maps.iter().enumerate() {
            map.write(body, &format!("map{number}"));
            map.write_data(data, &format!("map{number}"), frames);
        }
        body.push_str("</div>\n");
    }
}

/// A template with each `{{name}}` replaced by its part, in one pass: what stands in a part is nobody's place.
fn filled(template: &str, parts: &[(&str, &str)]) -> String {
    let mut page = String::with_capacity(template.len() + parts.iter().map(|part| part.1.len()).sum::<usize>());
    let mut rest = template;
    while let Some((before, (name, after))) =
        rest.split_once("{{").and_then(|(before, rest)| Some((before, rest.split_once("}}")?)))
    {
        page.push_str(before);
        page.push_str(parts.iter().find(|part| part.0 == name).map_or("", |part| part.1));
        rest = after;
    }
    page.push_str(rest);
    page
}

fn contents(body: &mut String, chapters: &[Chapter], maps: bool) {
    body.push_str("<nav aria-label=\"contents\"><ul>\n");
    if maps {
        body.push_str("<li><a href=\"#maps\"><b>Look into the latents</b></a></li>\n");
    }
    for (c, chapter) in chapters.iter().enumerate() {
        let links: Vec<String> = chapter
            .sections
            .iter()
            .enumerate()
            .map(|(s, section)| format!("<a href=\"#c{c}s{s}\">{}</a>", escape(&section.title)))
            .collect();
        let _ =
            writeln!(body, "<li><a href=\"#c{c}\"><b>{}</b></a>: {}</li>", escape(&chapter.title), links.join(" · "));
    }
    body.push_str("</ul></nav>\n");
}

impl Section {
    fn write(&self, body: &mut String) {
        let _ = writeln!(
            body,
            "<h3>{}</h3>\n<p class=\"reading\">{}</p>\n<p class=\"result\">{}</p>",
            escape(&self.title),
            escape(&self.reading),
            escape(&self.result)
        );
        for remark in &self.remarks {
            let _ = writeln!(body, "<p class=\"remark\">{}</p>", escape(remark));
        }
        body.push_str("<div class=\"figures\">\n");
        for figure in &self.figures {
            let class = if figure.broad { " class=\"broad\"" } else { "" };
            let _ = writeln!(
                body,
                "<figure{class}><img alt=\"{}\" src=\"data:image/svg+xml,{}\"></figure>",
                escape(&figure.alt),
                address(&figure.svg)
            );
        }
        body.push_str("</div>\n");
        if let Some(numbers) = &self.numbers {
            let _ = writeln!(body, "<details><summary>numbers</summary><pre>{}</pre></details>", escape(numbers));
        }
    }
}

/// A figure as part of an address in an attribute: a quarter shorter than base64, since what is in it is mostly numbers, and pictures as base64 already.
fn address(svg: &str) -> String {
    let mut out = String::with_capacity(svg.len() + svg.len() / 16);
    for c in svg.chars() {
        match c {
            '%' | '#' | '"' | '<' | '>' | '&' | '\'' | '\n' | '\r' | '\t' => {
                let _ = write!(out, "%{:02X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out
}

/// Writes the page whole or not at all.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, page: &str) -> Result<(), vibes_data::Error> {
    vibes_data::write_atomically(path, page.as_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::picture::Pixels;

    /// Frames that no encoder can pack: the worst case.
    fn noise(i: usize) -> Pixels {
        let byte = |p: usize| ((i * 12_289 + p).wrapping_mul(2_654_435_761) >> 13) as u8;
        Pixels { width: 64, height: 64, rgb: (0..64 * 64 * 3).map(byte).collect() }
    }

    #[test]
    fn a_page_of_25_000_rows_stays_small_and_whole() {
        let rows = 25_000_u32;
        let column = |c: u32| LiveColumn {
            name: format!("column {c} </script>"),
            values: (0..rows).map(|row| (row * c) as f32).collect(),
            kinds: Vec::new(),
        };
        let map = LiveMap {
            name: "a < b".into(),
            episode: (0..rows).map(|row| row / 250).collect(),
            step: (0..rows).map(|row| row % 250).collect(),
            positions: (0..rows).map(|row| [row as f32, -(row as f32)]).collect(),
            columns: (0..20).map(column).collect(),
            alive: (0..500).collect(),
            k: 2,
            near: (0..1000).collect(),
            distance: vec![0.5; 1000],
            framed: (0..1200).collect(),
            frames: (0..1200).map(noise).collect(),
        };
        let page = Page { title: "two < runs & more".into(), maps: vec![map.clone(), map.clone()], ..Page::default() };
        let html = page.html();
        assert!(html.len() < 15_000_000, "{} bytes", html.len());
        // Large figures leave less room for frames.
        let figure = Shown::new(format!("<svg width=\"400pt\">{}</svg>", "7".repeat(7_000_000)), "digits".into());
        let chapter =
            Chapter { sections: vec![Section { figures: vec![figure], ..Section::default() }], ..Chapter::default() };
        let full = Page { chapters: vec![chapter], maps: vec![map], ..Page::default() }.html();
        assert!(full.len() > 10_000_000 && full.len() < 15_000_000, "{} bytes", full.len());
        assert_eq!(html.matches("data-map=\"map").count(), 2);
        assert!(html.contains("two &lt; runs &amp; more") && !html.contains("{{"));
        // Each map has its data; nothing of a name ends a script early.
        assert_eq!(html.matches("<script").count(), html.matches("</script>").count());
    }

    /// Names of columns and kinds are the user's, and may be anything.
    #[test]
    fn no_text_of_the_data_takes_the_place_of_a_part_or_ends_a_script() {
        let name = "{{body}} {{script}} <!--<script> </script>";
        let column = LiveColumn { name: name.into(), values: vec![0.0], kinds: vec![name.into()] };
        let map = LiveMap { positions: vec![[0.0; 2]], columns: vec![column], ..LiveMap::default() };
        let html = Page { title: "{{data}}".into(), maps: vec![map], ..Page::default() }.html();
        assert_eq!(html.matches("<main>").count(), 1);
        assert_eq!((html.matches("<h1>").count(), html.matches("data-map=\"map0\"").count()), (1, 1));
        assert!(html.contains("<title>{{data}}</title>") && html.contains("{{body}} {{script}} \\u003c!--"));
        assert!(!html.contains("<!--"), "an opened comment hides the end of a script");
        let data = html.split("data-map=\"map0\">").nth(1).and_then(|rest| rest.split("</script>").next());
        let data: serde_json::Value = serde_json::from_str(data.expect("data")).expect("JSON");
        assert_eq!(data["columns"][0]["name"].as_str(), Some(name));
        assert_eq!(data["columns"][0]["kinds"][0].as_str(), Some(name));
    }

    #[test]
    fn a_figures_address_ends_no_attribute_and_begins_no_tag() {
        assert_eq!(
            address("<a b=\"#1\">100 % 'é' &lt;</a>\n"),
            "%3Ca b=%22%231%22%3E100 %25 %27é%27 %26lt;%3C/a%3E%0A"
        );
    }
}
