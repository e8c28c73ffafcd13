//! Tables of numbers over runs in the form of the paper's Table 1: means with 95% intervals, the best of each column marked, and those whose intervals
//! overlap with the best one's.
//!
//! In: one number a run, with the row and the column that it belongs to. Out: the table, as text for a terminal, Markdown and LaTeX, and as rows for
//! CSV and Parquet.

mod decimals;

use std::collections::BTreeMap;
use std::fmt::Write as _;

use serde::Serialize;

pub use decimals::{common_decimals, mean_text};
use vibes_measure::intervals::{Interval, student};

/// A result to enter in the table.
#[derive(Debug, Clone, PartialEq)]
pub struct RunScore {
    /// Row: method, objective, …
    pub method: String,
    /// Column: task, or metric.
    pub task: String,
    /// The run's number, as its final return.
    pub score: f64,
    /// Whether a higher number is a better one.
    pub higher_is_better: bool,
}

/// How an entry is set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Mark {
    /// The highest mean of its column: bold.
    Best,
    /// Its interval overlaps the best one's: underlined.
    Tied,
    /// Neither.
    Plain,
}

/// One entry of the table.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Entry {
    /// Mean over runs and its interval.
    pub score: Interval,
    /// Number of runs.
    pub runs: usize,
    /// How it is set.
    pub mark: Mark,
    /// Whether a higher number is a better one.
    #[serde(skip)]
    pub higher_is_better: bool,
}

/// Methods × tasks, as Table 1.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ScoreTable {
    /// Rows, in order of appearance.
    pub methods: Vec<String>,
    /// Columns, in order of appearance.
    pub tasks: Vec<String>,
    /// `[methods][tasks]`; none where a method has no run of a task.
    pub entries: Vec<Vec<Option<Entry>>>,
    /// Mean over tasks of the means, for methods that have every task.
    pub averages: Vec<Option<f64>>,
}

/// The table of any runs.
#[must_use]
pub fn score_table(runs: &[RunScore]) -> ScoreTable {
    let methods = in_order(runs.iter().map(|run| &run.method));
    let tasks = in_order(runs.iter().map(|run| &run.task));
    let mut scores: BTreeMap<(&str, &str), (Vec<f64>, bool)> = BTreeMap::new();
    for run in runs {
        let (scores, higher) = scores.entry((&run.method, &run.task)).or_default();
        scores.push(run.score);
        *higher = run.higher_is_better;
    }
    let entry = |method: &String, task: &String| {
        let (scores, higher_is_better) = scores.get(&(method.as_str(), task.as_str()))?;
        let higher_is_better = *higher_is_better;
        Some(Entry { score: student(scores), runs: scores.len(), mark: Mark::Plain, higher_is_better })
    };
    let mut entries: Vec<Vec<Option<Entry>>> =
        methods.iter().map(|method| tasks.iter().map(|task| entry(method, task)).collect()).collect();
    (0..tasks.len()).for_each(|task| mark(entries.iter_mut().filter_map(|row| row[task].as_mut()).collect()));
    let average = |row: &Vec<Option<Entry>>| {
        let means: Option<Vec<f64>> = row.iter().map(|entry| entry.map(|entry| entry.score.estimate)).collect();
        means.map(|means| means.iter().sum::<f64>() / means.len() as f64)
    };
    let averages = entries.iter().map(average).collect();
    ScoreTable { methods, tasks, entries, averages }
}

fn in_order<'n>(names: impl Iterator<Item = &'n String>) -> Vec<String> {
    names.fold(Vec::new(), |mut seen, name| {
        if !seen.contains(name) {
            seen.push(name.clone());
        }
        seen
    })
}

/// Mark the best entry of a column and those whose intervals overlap its. Without an interval an entry stands for its mean alone; alone in its column,
/// an entry is the best of nothing, and where no entry has an interval nothing says that a difference is more than chance.
fn mark(mut column: Vec<&mut Entry>) {
    if column.len() < 2 || column.iter().all(|entry| entry.score.low.is_nan()) {
        return;
    }
    // Where low is good, all numbers change sign.
    let ends = |entry: &Entry| {
        let Interval { estimate, low, high } = entry.score;
        let (low, high) = if low.is_nan() { (estimate, estimate) } else { (low, high) };
        if entry.higher_is_better { (estimate, low, high) } else { (-estimate, -high, -low) }
    };
    let Some(best) = column.iter().map(|entry| ends(entry)).max_by(|a, b| a.0.total_cmp(&b.0)) else { return };
    for entry in &mut column {
        let (estimate, _, high) = ends(entry);
        entry.mark = match () {
            () if estimate >= best.0 => Mark::Best,
            () if high >= best.1 => Mark::Tied,
            () => Mark::Plain,
        };
    }
}

impl Entry {
    /// Half of its interval, if it has one.
    #[must_use]
    pub fn half(&self) -> Option<f64> {
        Some(self.score.high - self.score.estimate).filter(|half| half.is_finite())
    }
}

/// A way to set the table as text.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Style {
    /// Columns of one width; `*` after the best, `~` after the tied, or in bold and underlined where the terminal can.
    Terminal {
        /// Whether the terminal takes escape codes.
        ansi: bool,
    },
    /// A table of GitHub's Markdown.
    Markdown,
    /// A `tabular` with the rules of `booktabs`.
    Latex,
}

impl ScoreTable {
    /// Whether the last column is the mean over the others.
    #[must_use]
    pub fn has_averages(&self) -> bool {
        self.tasks.len() > 1 && self.averages.iter().any(Option::is_some)
    }

    /// Whether some entry has an interval: is of several runs.
    #[must_use]
    pub fn has_intervals(&self) -> bool {
        self.entries.iter().flatten().flatten().any(|entry| entry.half().is_some())
    }

    /// Whether some entry is marked, in the column of averages too where that is shown.
    #[must_use]
    pub fn has_marks(&self, averages: bool) -> bool {
        let is_average_marked = averages && self.has_averages() && self.best_average().is_some();
        is_average_marked || self.entries.iter().flatten().flatten().any(|entry| entry.mark != Mark::Plain)
    }

    /// The row whose average is the best, if there are several. As within a column, nothing is the best where no entry has an interval.
    #[must_use]
    pub fn best_average(&self) -> Option<usize> {
        if !self.has_intervals() {
            return None;
        }
        let higher = self.entries.iter().flatten().flatten().next().is_none_or(|entry| entry.higher_is_better);
        let known = self.averages.iter().enumerate().filter_map(|(row, average)| Some((row, (*average)?)));
        let better =
            |a: &(usize, f64), b: &(usize, f64)| if higher { a.1.total_cmp(&b.1) } else { b.1.total_cmp(&a.1) };
        known.max_by(better).map(|(row, _)| row).filter(|_| self.averages.iter().flatten().count() > 1)
    }

    /// The table as text, with what stands over its rows, and whether there is a column of averages.
    #[must_use]
    pub fn text(&self, corner: &str, averages: bool, style: Style) -> String {
        let averages = averages && self.has_averages();
        let decimals = self.decimals();
        let mut rows = vec![self.head(corner, averages, style)];
        rows.extend((0..self.methods.len()).map(|row| self.row(row, averages, &decimals, style)));
        match style {
            Style::Terminal { .. } => aligned(&rows),
            Style::Markdown => markdown(&rows),
            Style::Latex => latex(&rows),
        }
    }

    fn head(&self, corner: &str, averages: bool, style: Style) -> Vec<Cell> {
        let average = averages.then_some("average");
        let names = std::iter::once(corner).chain(self.tasks.iter().map(String::as_str)).chain(average);
        names.map(|name| Cell::of(name, style)).collect()
    }

    /// The decimals of each column's numbers, and last those of the averages.
    fn decimals(&self) -> Vec<usize> {
        let of = |task: usize| {
            let entries = self.entries.iter().filter_map(|row| row[task].as_ref());
            common_decimals(entries.map(|entry| (entry.score.estimate, entry.half())))
        };
        let averages = common_decimals(self.averages.iter().flatten().map(|mean| (*mean, None)));
        (0..self.tasks.len()).map(of).chain([averages]).collect()
    }

    fn row(&self, row: usize, averages: bool, decimals: &[usize], style: Style) -> Vec<Cell> {
        let set = |mean, half, mark, decimals: usize| Cell::set(mean_text(mean, half, decimals), mark, style);
        let entries = self.entries[row].iter().zip(decimals).map(|(entry, decimals)| match entry {
            Some(entry) => set(entry.score.estimate, entry.half(), entry.mark, *decimals),
            None => Cell::of("–", style),
        });
        let mark = if self.best_average() == Some(row) { Mark::Best } else { Mark::Plain };
        let average = averages.then(|| match self.averages[row] {
            Some(mean) => set(mean, None, mark, decimals[self.tasks.len()]),
            None => Cell::of("–", style),
        });
        let name = Cell::of(&self.methods[row], style);
        std::iter::once(name).chain(entries).chain(average).collect()
    }
}

/// A cell: its text, and how many characters of it are seen.
struct Cell {
    text: String,
    width: usize,
}

impl Cell {
    fn plain(text: String) -> Self {
        Self { width: text.chars().count(), text }
    }

    /// A text that is not marked.
    fn of(text: &str, style: Style) -> Self {
        Self::plain(if style == Style::Latex { latex_escaped(text) } else { text.to_owned() })
    }

    fn set(text: String, mark: Mark, style: Style) -> Self {
        let width = text.chars().count();
        let text = if style == Style::Latex { latex_escaped(&text) } else { text };
        let wrapped = |before: &str, after: &str| format!("{before}{text}{after}");
        match (style, mark) {
            (Style::Terminal { ansi: true }, Mark::Best) => Self { text: wrapped("\u{1b}[1m", "\u{1b}[0m"), width },
            (Style::Terminal { ansi: true }, Mark::Tied) => Self { text: wrapped("\u{1b}[4m", "\u{1b}[0m"), width },
            (Style::Terminal { ansi: false }, Mark::Best) => Self::plain(wrapped("", " *")),
            (Style::Terminal { ansi: false }, Mark::Tied) => Self::plain(wrapped("", " ~")),
            (Style::Terminal { ansi: false }, Mark::Plain) => Self::plain(wrapped("", "  ")),
            (Style::Markdown, Mark::Best) => Self::plain(wrapped("**", "**")),
            (Style::Markdown, Mark::Tied) => Self::plain(wrapped("<u>", "</u>")),
            (Style::Latex, Mark::Best) => Self::plain(wrapped("\\textbf{", "}")),
            (Style::Latex, Mark::Tied) => Self::plain(wrapped("\\underline{", "}")),
            (_, Mark::Plain) => Self::plain(text),
        }
    }
}

fn aligned(rows: &[Vec<Cell>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let width = |c: usize| rows.iter().filter_map(|row| row.get(c)).map(|cell| cell.width).max().unwrap_or(0);
    let widths: Vec<usize> = (0..columns).map(width).collect();
    let mut text = String::new();
    for row in rows {
        for (c, (cell, width)) in row.iter().zip(&widths).enumerate() {
            let blanks = " ".repeat(width - cell.width);
            let (before, after) = if c == 0 { ("", blanks.as_str()) } else { (blanks.as_str(), "") };
            let _ = write!(text, "{}{before}{}{after}", if c == 0 { "" } else { "  " }, cell.text);
        }
        text.truncate(text.trim_end_matches(' ').len());
        text.push('\n');
    }
    text
}

fn markdown(rows: &[Vec<Cell>]) -> String {
    let line = |row: &Vec<Cell>| {
        let cells: Vec<String> = row.iter().map(|cell| cell.text.replace('|', "\\|")).collect();
        format!("| {} |\n", cells.join(" | "))
    };
    let mut text = String::new();
    for (i, row) in rows.iter().enumerate() {
        text.push_str(&line(row));
        if i == 0 {
            let rule: Vec<&str> = (0..row.len()).map(|c| if c == 0 { "---" } else { "---:" }).collect();
            let _ = writeln!(text, "| {} |", rule.join(" | "));
        }
    }
    text
}

fn latex(rows: &[Vec<Cell>]) -> String {
    let columns = rows.first().map_or(0, Vec::len);
    let mut text = format!("\\begin{{tabular}}{{l{}}}\n\\toprule\n", "r".repeat(columns.saturating_sub(1)));
    for (i, row) in rows.iter().enumerate() {
        let cells: Vec<&str> = row.iter().map(|cell| cell.text.as_str()).collect();
        let _ = writeln!(text, "{} \\\\", cells.join(" & "));
        if i == 0 {
            text.push_str("\\midrule\n");
        }
    }
    text.push_str("\\bottomrule\n\\end{tabular}\n");
    text
}

/// A text whose signs mean themselves: names are a user's, who may have put anything into them.
fn latex_escaped(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for sign in text.chars() {
        match sign {
            '_' | '%' | '&' | '#' | '$' | '{' | '}' => escaped.extend(['\\', sign]),
            '\\' => escaped.push_str("\\textbackslash{}"),
            '^' => escaped.push_str("\\textasciicircum{}"),
            '~' => escaped.push_str("\\textasciitilde{}"),
            '±' => escaped.push_str("$\\pm$"),
            '−' => escaped.push_str("$-$"),
            '–' => escaped.push_str("--"),
            _ => escaped.push(sign),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::{Mark, RunScore, ScoreTable, Style, score_table};

    fn run(method: &str, task: &str, score: f64) -> RunScore {
        RunScore { method: method.to_owned(), task: task.to_owned(), score, higher_is_better: true }
    }

    fn example() -> ScoreTable {
        let scores = |method: &str, task: &str, centre: f64, spread: f64| {
            [-1.0, 0.0, 1.0].map(|x| run(method, task, centre + spread * x)).to_vec()
        };
        let runs = [
            scores("vibes", "reacher", 900.0, 10.0),
            scores("no-adversary", "reacher", 880.0, 10.0),
            scores("reconstruction", "reacher", 100.0, 10.0),
            scores("vibes", "walker", 700.0, 1.0),
            scores("reconstruction", "walker", 710.0, 1.0),
        ];
        score_table(&runs.concat())
    }

    #[test]
    fn the_best_is_bold_and_the_tied_are_underlined() {
        let table = example();
        assert_eq!(table.methods, ["vibes", "no-adversary", "reconstruction"]);
        assert_eq!(table.tasks, ["reacher", "walker"]);
        let mark = |method: usize, task: usize| table.entries[method][task].map(|entry| entry.mark);
        assert_eq!([mark(0, 0), mark(1, 0), mark(2, 0)], [Some(Mark::Best), Some(Mark::Tied), Some(Mark::Plain)]);
        assert_eq!([mark(0, 1), mark(1, 1), mark(2, 1)], [Some(Mark::Plain), None, Some(Mark::Best)]);
        assert_eq!(table.averages, [Some(800.0), None, Some(405.0)]);
    }
    #[test]
    fn the_table_is_set_as_every_kind_of_text() {
        let table = example();
        let expected = "\
objective         reacher     walker  average
vibes           900 ± 25 *  700.0 ± 2.5      800 *
no-adversary    880 ± 25 ~              –        –
reconstruction  100 ± 25    710.0 ± 2.5 *    405
";
        let text = table.text("objective", true, Style::Terminal { ansi: false });
        let words =
            |text: &str| text.lines().map(|l| l.split_whitespace().collect::<Vec<_>>().join(" ")).collect::<Vec<_>>();
        assert_eq!(words(&text), words(expected), "{text}");
        let colored = table.text("objective", false, Style::Terminal { ansi: true });
        assert!(colored.contains("\u{1b}[1m900 ± 25\u{1b}[0m") && colored.contains("\u{1b}[4m880 ± 25\u{1b}[0m"));
        let text = table.text("objective", false, Style::Markdown);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(
            lines[..3],
            ["| objective | reacher | walker |", "| --- | ---: | ---: |", "| vibes | **900 ± 25** | 700.0 ± 2.5 |"]
        );
        assert_eq!(lines[3], "| no-adversary | <u>880 ± 25</u> | – |");
        let text = table.text("objective_x", false, Style::Latex);
        assert!(
            text.starts_with("\\begin{tabular}{lrr}\n\\toprule\nobjective\\_x & reacher & walker \\\\\n\\midrule\n"),
            "{text}"
        );
        let text = table.text("a{b}\\c", false, Style::Latex);
        assert!(text.contains("\na\\{b\\}\\textbackslash{}c & "), "{text}");
        assert!(text.contains("\nvibes & \\textbf{900 $\\pm$ 25} & 700.0 $\\pm$ 2.5 \\\\\n"), "{text}");
    }

    #[test]
    fn numbers_of_a_column_are_set_with_the_same_decimals() {
        let pair = |method: &str, task: &str, centre: f64, off: f64| {
            [-off, off].map(|x| run(method, task, centre + x)).to_vec()
        };
        let runs = [pair("a", "t", 900.0, 5.0), pair("b", "t", 100.0, 0.2), pair("a", "u", 0.5, 0.001)];
        let text = score_table(&runs.concat()).text("method", false, Style::Markdown);
        assert!(text.contains("900.0 ± 63.5") && text.contains("100.0 ± 2.5"), "{text}");
        assert!(text.contains("0.500 ± 0.013"), "another column has its own: {text}");
    }

    #[test]
    fn nothing_is_marked_where_each_entry_is_one_run() {
        let single = |method: &str, score: f64| [run(method, "reacher", score), run(method, "walker", score)];
        let table = score_table(&[single("a", 3.0), single("b", 4.0)].concat());
        assert!(!table.has_intervals() && !table.has_marks(true) && table.best_average().is_none());
        assert!(!table.text("method", true, Style::Markdown).contains("**"));
        assert!(example().has_intervals() && example().has_marks(true) && example().best_average() == Some(0));
    }

    #[test]
    fn where_low_is_good_the_lowest_is_the_best() {
        let low = |method: &str, score: f64| RunScore { higher_is_better: false, ..run(method, "gap", score) };
        let three = |method: &str, scores: [f64; 3]| scores.map(|score| low(method, score));
        let runs = [three("a", [3.0, 3.1, 3.2]), three("b", [1.0, 1.1, 1.2]), three("c", [2.0, 0.9, 1.5])];
        let table = score_table(&runs.concat());
        let marks: Vec<Mark> = (0..3).filter_map(|row| table.entries[row][0]).map(|entry| entry.mark).collect();
        assert_eq!(marks, [Mark::Plain, Mark::Best, Mark::Tied]);
        assert_eq!(score_table(&[run("a", "gap", 3.0)]).entries[0][0].map(|e| e.mark), Some(Mark::Plain), "alone");
        let single = score_table(&[run("a", "gap", 3.0), run("b", "gap", 4.0)]);
        let marks: Vec<Mark> = (0..2).filter_map(|row| single.entries[row][0]).map(|entry| entry.mark).collect();
        assert_eq!(marks, [Mark::Plain, Mark::Plain], "one run each says nothing of chance");
    }
}
