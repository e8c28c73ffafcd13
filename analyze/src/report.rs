//! One self-contained HTML page: figures, numbers, and maps on which hovering over a point shows its frame and its neighbours.
//!
//! In: sections with figures as SVG, and live maps with their frames. Out: one file that needs no network and no other file.

mod live_map;

use std::fmt::Write as _;
use std::path::Path;

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

pub use live_map::{LiveMap, LivePoint};

use crate::picture::svg::escape;

/// A figure of the page.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shown {
    /// The SVG document.
    pub svg: String,
    /// For those who cannot see it.
    pub alt: String,
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
    /// A map to hover over.
    pub map: Option<LiveMap>,
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

/// The page as HTML.
#[must_use]
pub fn page(title: &str, note: Option<&str>, chapters: &[Chapter]) -> String {
    let mut body = format!("<h1>{}</h1>\n", escape(title));
    if let Some(note) = note {
        let _ = writeln!(body, "<p class=\"note\">{}</p>", escape(note));
    }
    contents(&mut body, chapters);
    let mut maps = 0;
    for (c, chapter) in chapters.iter().enumerate() {
        let _ = writeln!(
            body,
            "<h2 id=\"c{c}\">{}</h2>\n<p class=\"origin\">{}</p>",
            escape(&chapter.title),
            escape(&chapter.origin)
        );
        for (s, section) in chapter.sections.iter().enumerate() {
            let _ = writeln!(body, "<section id=\"c{c}s{s}\">");
            section.write(&mut body, &mut maps);
            body.push_str("</section>\n");
        }
    }
    include_str!("report/page.html")
        .replace("{{title}}", &escape(title))
        .replace("{{style}}", include_str!("report/page.css"))
        .replace("{{script}}", include_str!("report/live_map.js"))
        .replace("{{body}}", &body)
}

fn contents(body: &mut String, chapters: &[Chapter]) {
    body.push_str("<nav><ul>\n");
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
    fn write(&self, body: &mut String, maps: &mut usize) {
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
        if let Some(map) = &self.map {
            map.write(body, *maps);
            *maps += 1;
        }
        body.push_str("<div class=\"figures\">\n");
        for figure in &self.figures {
            let _ = writeln!(
                body,
                "<img alt=\"{}\" src=\"data:image/svg+xml;base64,{}\">",
                escape(&figure.alt),
                STANDARD.encode(&figure.svg)
            );
        }
        body.push_str("</div>\n");
        if let Some(numbers) = &self.numbers {
            let _ = writeln!(body, "<details><summary>numbers</summary><pre>{}</pre></details>", escape(numbers));
        }
    }
}

/// Writes the page whole or not at all.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, page: &str) -> Result<(), vibes_data::Error> {
    vibes_data::write_atomically(path, page.as_bytes())
}
