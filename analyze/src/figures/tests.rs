//! Laws that hold for every figure, checked on one example of each.

mod odd;
mod snapshots;

use std::sync::Arc;

use super::*;
use crate::picture::color::kind;
use crate::picture::{Anchor, PAGE, Pixels, Shape, font};

fn noise(i: usize) -> f64 {
    let x = (i as f64 * 12.9898).sin() * 43_758.547;
    x - x.floor()
}

fn frame(i: usize) -> Option<Arc<Pixels>> {
    let rgb = (0..64 * 64).flat_map(|p| {
        let (x, y) = (p % 64, p / 64);
        let inside = (x as i64 - 20 - (i as i64 * 7) % 24).pow(2) + (y as i64 - 30).pow(2) < 100;
        if inside { [230, 190, 40] } else { [(x * 2 + i * 9) as u8, (y * 3) as u8, 120] }
    });
    Some(Arc::new(Pixels { width: 64, height: 64, rgb: rgb.collect() }))
}

fn sheet(queries: usize) -> Figure {
    let thumb = |i: usize| Thumb { name: format!("{}:{}", i % 100, i * 7 % 250), pixels: frame(i) };
    let column = |q: usize| SheetColumn {
        query: thumb(q),
        remark: if q.is_multiple_of(2) { "high reward" } else { "low reward" }.to_string(),
        neighbours: (1..=5).map(|k| (thumb(q * 9 + k), 0.4 + 0.37 * k as f64)).collect(),
    };
    Figure::NeighbourSheet(NeighbourSheet {
        heading: Heading::new("Nearest neighbours in the latent space, from other episodes"),
        distance: "standardized L2 distance".into(),
        rows: Vec::new(),
        columns: (0..queries).map(column).collect(),
    })
}

/// Row keys too long to stand beside a distance.
fn long_keys() -> Figure {
    let Figure::NeighbourSheet(mut sheet) = sheet(6) else { unreachable!("a sheet") };
    for (thumb, _) in sheet.columns.iter_mut().flat_map(|c| &mut c.neighbours) {
        thumb.name = format!("1{}", thumb.name.replace(':', ":10"));
    }
    Figure::NeighbourSheet(sheet)
}

fn walk() -> Vec<[f64; 2]> {
    (0..4000)
        .map(|i| {
            let (state, t) = (i / 1000, (i % 250) as f64 / 250.0);
            let angle = 6.0 * t + state as f64 * 1.7;
            [state as f64 * 1.2 + t * angle.cos() + 0.05 * noise(i), t * angle.sin() + 0.05 * noise(i + 7)]
        })
        .collect()
}

/// One example of each figure, with a name for its files.
fn examples() -> Vec<(&'static str, Figure)> {
    let points = walk();
    let note = Some("300 updates: barely trained, read nothing into this".to_string());
    let heading = |t: &str| Heading::new(t);
    let bar = |label: &str, value: f64, chance: Option<f64>| Bar {
        label: label.into(),
        value,
        interval: Some((value - 0.04, value + 0.05)),
        chance,
    };
    vec![
        ("sheet-20", sheet(20)),
        ("sheet-6", sheet(6)),
        ("sheet-long-keys", long_keys()),
        (
            "map-time",
            Figure::Map(Map {
                heading: heading("Map of 4,000 latents").with_note(note.clone()),
                axes: "UMAP".into(),
                coloring: Coloring::Quantity { name: "step".into(), values: (0..4000).map(|i| (i % 250) as f64).collect() },
                points: points.clone(),
                backdrop: Vec::new(),
            }),
        ),
        (
            "map-state",
            Figure::Map(Map {
                heading: heading("Map of 4,000 latents"),
                axes: "UMAP".into(),
                coloring: Coloring::Kind { name: "state".into(), kinds: (0..2000).map(|i| Some(i / 200)).collect(), names: Vec::new() },
                points: points[..2000].to_vec(),
                backdrop: points[2000..].to_vec(),
            }),
        ),
        ("panels", panels(points.clone(), None)),
        ("panels-quantity", panels(points.clone(), Some(Coloring::Quantity { name: "height, m".into(), values: heights(&points) }))),
        ("panels-kinds", panels(points.clone(), Some(weather(&points)))),
        (
            "bars",
            Figure::Bars(Bars {
                heading: heading("How much of the latent is state, how much distractor").with_note(note.clone()),
                groups: vec![
                    BarGroup {
                        axis: "share of latent variance".into(),
                        range: Some((0.0, 1.0)),
                        bars: vec![bar("state", 0.61, None), bar("distractor", 0.22, None), bar("interaction", 0.17, None)],
                    },
                    BarGroup {
                        axis: "same state found under another distractor".into(),
                        range: Some((0.0, 1.0)),
                        bars: vec![bar("retrieval@1", 0.34, Some(0.04)), bar("retrieval@5", 0.62, Some(0.18))],
                    },
                ],
            }),
        ),
        (
            "probes",
            Figure::ProbeChart(ProbeChart {
                heading: heading("What a linear probe reads from the latent"),
                axis: "R² on held-out episodes (accuracy over chance for the video)".into(),
                sources: vec!["latent".into(), "actions only".into(), "shuffled".into()],
                rows: ["position[0]", "position[1]", "to_target[0]", "reward", "camera.h", "camera.roll", "video", "color[0]"]
                    .iter()
                    .enumerate()
                    .map(|(i, name)| ProbeRow {
                        section: if i < 4 { "task quantities: high is good" } else { "distractors: at chance is good" }.into(),
                        quantity: (*name).into(),
                        marks: (0..3)
                            .map(|s| {
                                let score = if i == 3 && s == 2 { -0.4 } else { (0.9 - 0.1 * i as f64) / (1.0 + 2.0 * s as f64) };
                                ProbeMark { source: s, score, interval: Some((score - 0.05, score + 0.04)) }
                            })
                            .collect(),
                    })
                    .collect(),
            }),
        ),
        ("strips", strips()),
        ("curves-1", Figure::Curves(curves(1))),
        ("curves-5", Figure::Curves(curves(5))),
        ("curves-tasks", curves_of_tasks()),
        ("curves-many", many_curves()),
        (
            "table",
            Figure::Table(Table {
                heading: heading("Mean return and 95% interval"),
                corner: "objective".into(),
                columns: ["reacher-easy", "cartpole-swingup", "walker-walk"].map(String::from).to_vec(),
                rows: vec![
                    ("vibes".into(), vec![entry(930.0, 12.0, true, false), entry(701.0, 29.0, true, false), entry(670.0, 167.0, true, false)]),
                    ("no-adversary".into(), vec![entry(925.0, 21.0, false, true), entry(606.0, 27.0, false, false), None]),
                    ("reconstruction".into(), vec![entry(360.0, 280.0, false, false), entry(417.0, 49.0, false, false), None]),
                ],
                by_row: false,
                foot: "vibes-train evaluate, else the last evaluation, else the mean of the last tenth of what was logged while training, and a word more".into(),
            }),
        ),
        ("table-wide", wide_table()),
    ]
}

/// Panels of a grid with a hole, coloured by time or by a column.
fn panels(points: Vec<[f64; 2]>, coloring: Option<Coloring>) -> Figure {
    let rows = |c: usize| (0..250).map(|t| c * 250 + t).collect();
    Figure::Panels(Panels {
        heading: Heading::new("All latents in grey, one trajectory in colour"),
        states: (0..4).collect(),
        distractors: (0..4).collect(),
        panels: (0..15).map(|c| Panel { state: c / 4, distractor: c % 4, rows: rows(c as usize) }).collect(),
        absent: "not recorded",
        steps: (0..points.len() as u32).map(|row| row % 250).collect(),
        points,
        coloring,
    })
}

fn heights(points: &[[f64; 2]]) -> Vec<f64> {
    points.iter().map(|p| p[1]).collect()
}

/// Four kinds, of which some rows have none.
fn weather(points: &[[f64; 2]]) -> Coloring {
    let kinds =
        points.iter().enumerate().map(|(i, p)| (i % 250 > 20).then_some((p[1].abs() * 4.0) as u32 % 4)).collect();
    let names = ["clear", "cloudy", "fog that lasts all day", "rain"].map(String::from).to_vec();
    Coloring::Kind { name: "weather".into(), kinds, names }
}

fn entry(mean: f64, half: f64, best: bool, tied: bool) -> Option<Entry> {
    Some(Entry { mean, half: Some(half), best, tied })
}

fn strips() -> Figure {
    let line = |name: &str, from: usize| StripLine {
        name: name.into(),
        pictures: (0..19).map(|i| if i < from { None } else { frame(i) }).collect(),
    };
    let strip = |episode: usize| Strip {
        title: format!("episode {episode}"),
        steps: (0..19).map(|i| 40 + i).collect(),
        start: 43,
        lines: vec![line("recorded", 0), line("vibes: shown", 0), line("vibes: predicted", 3)],
    };
    Figure::Strips(Strips {
        heading: Heading::new("What the latents show of the pictures"),
        strips: vec![strip(3), strip(7)],
        foot: "shown: a decoder's picture of the latent; predicted: from the line on, under the recorded actions alone"
            .into(),
    })
}

fn curves(facets: usize) -> Curves {
    let curve = |g: usize, f: usize| {
        let x: Vec<f64> = (0..100).map(|i| f64::from(i) * 5000.0).collect();
        let mean: Vec<f64> =
            (0..100).map(|i| 900.0 * (1.0 - (-f64::from(i) / (20.0 + 30.0 * (g + f) as f64)).exp())).collect();
        let band = mean
            .iter()
            .enumerate()
            // From the eightieth point on a single run reaches.
            .map(|(i, m)| (i < 80).then(|| (m - 30.0 - 20.0 * noise(i), m + 30.0 + 20.0 * noise(i + 3))))
            .collect();
        Curve { group: g, x, mean, band, runs: Vec::new() }
    };
    Curves {
        heading: Heading::new("Learning curves, mean and 95% interval over 5 runs"),
        axis: "environment steps".into(),
        groups: ["vibes", "no-adversary", "reconstruction"].map(String::from).to_vec(),
        columns: None,
        foot: String::new(),
        facets: (0..facets)
            .map(|f| Facet { metric: format!("episode return {f}"), curves: (0..3).map(|g| curve(g, f)).collect() })
            .collect(),
    }
}

/// Two tasks side by side: one metric that only the second has, wide bands, a group of which fewer runs go on, and one of a single evaluation.
fn curves_of_tasks() -> Figure {
    let mut of_tasks = curves(4);
    of_tasks.columns = Some(2);
    of_tasks.foot = "band of a single run: 95% interval over the episodes of an evaluation".into();
    for (facet, name) in of_tasks.facets.iter_mut().zip(["cartpole", "reacher"].iter().cycle()) {
        facet.metric = format!("{name}: {}", facet.metric);
        let group = &mut facet.curves[1];
        group.runs = (0..100).map(|at| if at < 60 { 3 } else { 2 }).collect();
        group.band.iter_mut().flatten().for_each(|(low, high)| (*low, *high) = (*low - 2000.0, *high + 500.0));
        let single =
            Curve { x: vec![4e5], mean: vec![300.0], band: vec![Some((200.0, 400.0))], ..facet.curves[2].clone() };
        facet.curves[2] = single;
    }
    of_tasks.facets[2].curves.clear();
    Figure::Curves(of_tasks)
}

/// More columns than a page has room for.
fn wide_table() -> Figure {
    let entries = |row: usize| {
        (0..14).map(|column| entry(100.0 * noise(row * 14 + column), 7.0, column == row, column == 5)).collect()
    };
    Figure::Table(Table {
        heading: Heading::new("Where training ended"),
        corner: "metric".into(),
        columns: (0..14).map(|run| format!("reacher-vibes-seed-{run}, which went on longer")).collect(),
        rows: ["return at evaluations", "adversary − dynamics, training batches (nats)"]
            .iter()
            .enumerate()
            .map(|(row, name)| ((*name).into(), entries(row)))
            .collect(),
        by_row: true,
        foot: "vibes-train evaluate, else last evaluation, else mean of the last tenth".into(),
    })
}

/// More groups than lines that look different, and a name longer than the figure is wide.
fn many_curves() -> Figure {
    let mut many = curves(1);
    many.groups = (0..23).map(|group| format!("seed-{group}")).collect();
    many.groups[9] = "/somewhere/runs/cartpole-swingup/no-adversary/a-folder-of-many-words/seed-9".into();
    let own = many.facets[0].curves[0].clone();
    let curve = |group: usize| Curve {
        group,
        mean: own.mean.iter().map(|mean| mean + 20.0 * group as f64).collect(),
        band: Vec::new(),
        ..own.clone()
    };
    many.facets[0].curves = (0..23).map(curve).collect();
    Figure::Curves(many)
}

#[test]
fn groups_beyond_the_colours_have_dashed_lines_and_a_word_beyond_these() {
    let picture = many_curves().draw();
    let texts: Vec<&str> = picture
        .shapes
        .iter()
        .filter_map(|shape| if let Shape::Text { text, .. } = shape { Some(text.as_str()) } else { None })
        .collect();
    assert!(texts.contains(&"seed-22 (colours repeat)"), "{texts:?}");
    assert!(texts.iter().any(|text| text.contains('…') && text.ends_with("/seed-9")), "{texts:?}");
    let lines = |figure: &Figure| {
        let is_first = |shape: &&Shape| matches!(shape, Shape::Line { color, .. } if *color == kind(0));
        figure.draw().shapes.iter().filter(is_first).count()
    };
    assert_eq!(lines(&Figure::Curves(curves(1))), 2, "a line and its mark");
    assert!(lines(&many_curves()) > 80, "dashes and dots beside the line of the same colour");
}

#[test]
fn every_figure_becomes_a_png_of_its_size_and_a_whole_svg() {
    let dir = tempfile::tempdir().expect("temporary folder");
    let keep = std::env::var_os("VIBES_KEEP_FIGURES").map(PathBuf::from);
    let folder = keep.as_deref().unwrap_or(dir.path());
    for (name, figure) in examples() {
        let picture = figure.draw();
        let files = figure.save(folder, name).expect(name);
        let png = image::open(&files[0]).expect(name).to_rgb8();
        assert_eq!(png.width(), (picture.width / 72.0 * png::DPI).round() as u32, "{name}");
        assert_eq!(png.height(), (picture.height / 72.0 * png::DPI).round() as u32, "{name}");
        let inked = png.pixels().filter(|p| p.0 != [255; 3]).count();
        assert!(inked * 100 > png.pixels().len(), "{name} is nearly empty");
        let svg = std::fs::read_to_string(&files[1]).expect(name);
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{name}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{name} has a coordinate that is no number");
        assert!(!svg.replace("http://www.w3.org/", "").contains("http"), "{name} refers to the network");
    }
}

#[test]
fn no_figure_is_wider_than_a_page_and_all_text_is_legible() {
    for (name, figure) in examples() {
        let picture = figure.draw();
        assert!(picture.width <= PAGE + 0.01, "{name}: {}", picture.width);
        for shape in &picture.shapes {
            if let Shape::Text { style, text, .. } = shape {
                assert!(style.size >= 5.0, "{name}: {text:?} at {} pt", style.size);
            }
        }
    }
}

/// The end of a title mostly says what would be good.
#[test]
fn no_title_of_an_axis_is_cut() {
    let has_axes = |figure: &Figure| matches!(figure, Figure::Bars(_) | Figure::ProbeChart(_) | Figure::Curves(_));
    for (name, figure) in examples().into_iter().filter(|(_, figure)| has_axes(figure)) {
        for shape in &figure.draw().shapes {
            if let Shape::Text { style, text, .. } = shape {
                assert!(style.anchor != Anchor::Middle || !text.ends_with('…'), "{name}: {text:?}");
            }
        }
    }
}

#[test]
fn no_text_leaves_its_picture_or_lies_on_another() {
    for (name, figure) in examples().into_iter().chain(odd::examples()) {
        let picture = figure.draw();
        let boxes: Vec<(String, [f64; 4])> = picture.shapes.iter().filter_map(text_box).collect();
        for (text, b) in &boxes {
            let inside = b[0] >= -0.5 && b[1] >= -0.5 && b[2] <= picture.width + 0.5 && b[3] <= picture.height + 0.5;
            assert!(inside, "{name}: {text:?} leaves the picture: {b:?} of {} x {}", picture.width, picture.height);
        }
        for (i, (a, p)) in boxes.iter().enumerate() {
            for (b, q) in &boxes[i + 1..] {
                let apart = p[2] <= q[0] + 0.3 || q[2] <= p[0] + 0.3 || p[3] <= q[1] + 0.3 || q[3] <= p[1] + 0.3;
                assert!(apart, "{name}: {a:?} and {b:?} overlap: {p:?} {q:?}");
            }
        }
    }
}

/// A text's box (left, top, right, bottom): the height of capitals above the baseline, a little below it.
fn text_box(shape: &Shape) -> Option<(String, [f64; 4])> {
    let Shape::Text { at, text, style } = shape else { return None };
    if text.is_empty() {
        return None;
    }
    let w = font::width(text, style.size, style.weight);
    let from = -style.anchor.before() * w;
    let (up, down) = (0.73 * style.size, 0.16 * style.size);
    let b = if style.upwards {
        [at.0 - up, at.1 - from - w, at.0 + down, at.1 - from]
    } else {
        [at.0 + from, at.1 - up, at.0 + from + w, at.1 + down]
    };
    Some((text.clone(), b))
}

#[test]
fn the_same_figure_gives_the_same_bytes() {
    for (name, figure) in examples() {
        assert_eq!(svg::render(&figure.draw()), svg::render(&figure.draw()), "{name}");
    }
}
