//! Figures of data that is not as one would wish: numbers of any size, points far away, names without end. Laws hold for them too.

use super::super::{
    Bar, BarGroup, Bars, Coloring, Figure, Heading, Map, Panel, Panels, ProbeChart, ProbeMark, ProbeRow,
};
use super::{curves, walk};

/// One example of each fault, with a name.
pub(super) fn examples() -> Vec<(&'static str, Figure)> {
    let wide: Vec<f64> = (0..4000).map(|i| -100_000.0 - 523.0 * f64::from(i % 97) / 97.0).collect();
    let mut far = vec![7e-9; 4000];
    (far[3], far[9], far[11]) = (3.0e7, 2e-9, f64::NAN);
    vec![
        ("map-wide-numbers", map("height above the ground in the middle of the picture", wide)),
        ("map-one-value", map("mass", vec![7.0; 4000])),
        ("map-no-value", map("reward", vec![f64::NAN; 4000])),
        ("map-far", map("reward", far)),
        ("map-many-kinds", kinds()),
        ("panels-low", panels()),
        ("bars-long", bars()),
        ("probes-low", probes()),
        ("curves-tiny", scaled(1e-12)),
        ("curves-huge", scaled(1e13)),
        ("curves-level", scaled(0.0)),
    ]
}

/// Points of which two lie far away.
fn map(name: &str, values: Vec<f64>) -> Figure {
    let mut points = walk();
    (points[0], points[1]) = ([400.0, 0.0], [0.0, -300.0]);
    Figure::Map(Map {
        heading: Heading::new(
            "A map of latents of which the first steps of some episodes lie far away from all others",
        ),
        axes: "UMAP".into(),
        points,
        backdrop: Vec::new(),
        coloring: Coloring::Quantity { name: name.into(), values },
    })
}

fn kinds() -> Figure {
    let name = |kind: usize| format!("a street in the rain, seen from a car that stands at a crossing, part {kind}");
    Figure::Map(Map {
        heading: Heading::new("More kinds than colours"),
        axes: "t-SNE".into(),
        points: walk(),
        backdrop: walk(),
        coloring: Coloring::Kind {
            name: "video".into(),
            kinds: (0..4000).map(|i| (i % 50 > 0).then_some(i % 13)).collect(),
            names: (0..13).map(name).collect(),
        },
    })
}

/// One row of many panels, lower than a colour bar must be.
fn panels() -> Figure {
    let mut points = walk();
    points[5] = [-500.0, 0.0];
    let values = (0..4000).map(|i| if i % 11 == 0 { f64::NAN } else { 3e-7 * f64::from(i % 250) }).collect();
    Figure::Panels(Panels {
        heading: Heading::new("One row of many panels"),
        points,
        states: vec![3],
        distractors: (0..16).collect(),
        panels: (0..16)
            .map(|c| Panel { state: 3, distractor: c, rows: (0..250).map(|t| c as usize * 250 + t).collect() })
            .collect(),
        absent: "not recorded",
        steps: (0..4000).map(|row| row % 250).collect(),
        coloring: Some(Coloring::Quantity { name: "speed of the second joint".into(), values }),
    })
}

fn bars() -> Figure {
    let bar = |label: &str, value: f64| Bar {
        label: label.into(),
        value,
        interval: Some((value * 0.5, value * 7.0)),
        chance: Some(value * 0.9),
    };
    let group = |axis: &str, size: f64| BarGroup {
        axis: axis.into(),
        range: None,
        bars: vec![
            bar("latent, 5 nearest", size),
            bar("a run with a name that is longer than its room, 5 nearest", 2.0 * size),
        ],
    };
    let long = "latent distance of a rotated twin over that of a row that looks as different, among rows whose target is as far";
    Figure::Bars(Bars {
        heading: Heading::new("Numbers of three sizes"),
        groups: vec![group(long, 3e-8), group("share", 0.4), group(long, 6e10)],
    })
}

fn probes() -> Figure {
    let mark = |source| ProbeMark { source, score: -1.5, interval: Some((-2.0, 1.4)) };
    let row = |quantity: &str| ProbeRow {
        section: "task: high is good".into(),
        quantity: quantity.into(),
        marks: (0..4).map(mark).collect(),
    };
    Figure::ProbeChart(ProbeChart {
        heading: Heading::new("Nothing can be read"),
        axis: "R², fitted on other recordings of the same task under distractors that were never seen (classes cross-validated)".into(),
        sources: ["latent, linear", "latent, kNN", "past actions, linear", "shuffled, linear"].map(String::from).to_vec(),
        rows: vec![row("height"), row("an observation with a long name[12]")],
    })
}

/// Curves of which every number is so many times larger.
fn scaled(factor: f64) -> Figure {
    let mut all = curves(4);
    for curve in all.facets.iter_mut().flat_map(|facet| &mut facet.curves) {
        curve.mean.iter_mut().for_each(|mean| *mean *= factor);
        curve.band.iter_mut().flatten().for_each(|band| *band = (band.0 * factor, band.1 * factor));
    }
    Figure::Curves(all)
}
