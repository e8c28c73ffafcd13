//! The verdict: one table that says what the latents hold, what they ignore, how well they predict and how well the policy does, each number with its
//! interval and beside what pure chance or past actions alone would give.

use std::fmt::Write as _;

use crate::picture::svg::escape;

/// A number of one run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Answer {
    /// The number, as in "0.93"; empty where there is none.
    pub number: String,
    /// Its 95% interval, as in "0.91 to 0.95"; empty where there is none.
    pub interval: String,
    /// What it is to be compared with, as in "past actions alone: 0.41".
    pub beside: String,
}

/// A measure over all runs.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measure {
    /// What it measures, in words.
    pub name: String,
    /// How it is read: what it counts, and what is good.
    pub reading: String,
    /// One answer a run.
    pub answers: Vec<Answer>,
}

/// The table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// The runs.
    pub runs: Vec<String>,
    /// Measures under the question that they answer, as in "What do the latents hold?".
    pub groups: Vec<(String, Vec<Measure>)>,
}

impl Verdict {
    pub(super) fn write(&self, body: &mut String) {
        if self.groups.iter().all(|(_, measures)| measures.is_empty()) {
            return;
        }
        body.push_str("<section id=\"verdict\"><table class=\"verdict\">\n<caption>Each number with its 95% interval, where it has one, and beneath it what it is to be compared with.</caption>\n");
        body.push_str("<thead><tr><th scope=\"col\">measure</th>");
        for run in &self.runs {
            let _ = write!(body, "<th scope=\"col\">{}</th>", escape(run));
        }
        body.push_str("</tr></thead>\n<tbody>\n");
        for (question, measures) in self.groups.iter().filter(|(_, measures)| !measures.is_empty()) {
            let span = self.runs.len() + 1;
            let _ = writeln!(
                body,
                "<tr class=\"group\"><th scope=\"colgroup\" colspan=\"{span}\">{}</th></tr>",
                escape(question)
            );
            measures.iter().for_each(|measure| measure.write(body, &self.runs));
        }
        body.push_str("</tbody></table></section>\n");
    }
}

impl Measure {
    fn write(&self, body: &mut String, runs: &[String]) {
        let _ =
            write!(body, "<tr><th scope=\"row\">{}<small>{}</small></th>", escape(&self.name), escape(&self.reading));
        for (answer, run) in self.answers.iter().zip(runs) {
            // On a phone the head of the table is gone, so that every cell says whose it is.
            let run = if runs.len() > 1 { escape(run) } else { String::new() };
            let _ = write!(body, "<td data-run=\"{run}\">{}</td>", answer.html());
        }
        body.push_str("</tr>\n");
    }
}

impl Answer {
    fn html(&self) -> String {
        if self.number.is_empty() {
            return format!("–<small>{}</small>", escape(&self.beside));
        }
        let interval = if self.interval.is_empty() { String::new() } else { format!(" ({})", escape(&self.interval)) };
        format!("<b>{}</b>{interval}<small>{}</small>", escape(&self.number), escape(&self.beside))
    }
}
