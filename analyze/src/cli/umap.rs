//! `umap`: all latents as points in the plane.

use serde_json::json;

use super::maps::{MapOptions, coloring, file_stem, thousands};
use super::session::{Session, TableInput};
use super::{Globals, Outcome};
use crate::figures::{Coloring, Figure, Map};

/// Draw a map of the latents, coloured by step, state, distractor and reward.
///
/// map.arrow holds the places (episode, step, x, y). The neighbour graph is kept in graph.arrow, and another layout of the same latents (--min-dist,
/// --spread, --epochs, --seed, fewer --neighbours) reuses it. grid, clusters, scene and report draw on this map where it lies in their folder and they are
/// asked for no option of a map. --onto places new latents of the same model on an old map.
#[derive(Debug, clap::Args)]
pub(super) struct Options {
    #[command(flatten)]
    input: TableInput,
    #[command(flatten)]
    map: MapOptions,
    /// Columns to colour the map by as well: of the latents' table or of one that is joined.
    #[arg(long, value_name = "COLUMN,…", value_delimiter = ',')]
    color: Vec<String>,
    /// Whether the map is what was asked for, and has the options that stand here; run by another verb it draws on the map that is there.
    #[arg(skip = true)]
    is_asked_for: bool,
}

impl Options {
    /// The options of a verb that is run by another: what is not named has its default.
    pub(super) fn of(input: TableInput) -> Self {
        Self { input, map: MapOptions::default(), color: Vec::new(), is_asked_for: false }
    }
}

pub(super) fn run(options: &Options, globals: &Globals) -> anyhow::Result<Outcome> {
    let mut about = if options.is_asked_for { options.map.json() } else { json!({}) };
    about["color"] = json!(options.color);
    let mut session = Session::open_with(&(&options.input).into(), globals, "umap", about, &options.color)?;
    let began = std::time::Instant::now();
    let made = if options.is_asked_for {
        options.map.map(&mut session, globals)?
    } else {
        options.map.map_or_other(&mut session, globals)?
    };
    let seconds = began.elapsed().as_secs_f64();
    for (stem, coloring, title) in colorings(&session)? {
        let heading = session.heading(format!("{} latents, coloured by {title}", thousands(session.latents.len())));
        let map = Map {
            heading,
            axes: made.method.name().into(),
            points: made.points(),
            backdrop: made.backdrop(),
            coloring,
        };
        session.save(&Figure::Map(map), &format!("map-by-{stem}"))?;
    }
    session.write_json("map", &json!({ "quality": made.quality }))?;
    let line = format!(
        "umap: {} latents by {} in {seconds:.1} s{}, {}",
        session.latents.len(),
        made.method.name(),
        made.how,
        made.quality_text()
    );
    Ok(session.finish(line))
}

/// The colourings that the table has columns for: file stem, colours, name.
fn colorings(session: &Session) -> anyhow::Result<Vec<(String, Coloring, String)>> {
    let l = &session.latents;
    let quantity = |name: &str, values: Vec<f64>| Coloring::Quantity { name: name.into(), values };
    let mut all =
        vec![("time".into(), quantity("step", l.step.iter().map(|&s| f64::from(s)).collect()), "time".into())];
    for (stem, kinds, title) in
        [("state", &l.state, "state trajectory"), ("distractor", &l.distractor, "distractor trajectory")]
    {
        if kinds.iter().any(Option::is_some) {
            let coloring = Coloring::Kind { name: stem.into(), kinds: kinds.clone(), names: Vec::new() };
            all.push((stem.into(), coloring, title.into()));
        }
    }
    if l.reward.iter().any(Option::is_some) {
        all.push((
            "reward".into(),
            quantity("reward", l.reward.iter().map(|r| r.map_or(f64::NAN, f64::from)).collect()),
            "reward".into(),
        ));
    }
    for column in &session.columns {
        all.push((file_stem(&column.0), coloring(column, l.len())?, column.0.clone()));
    }
    Ok(all)
}
