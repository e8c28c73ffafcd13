//! The map that several verbs draw on: computed once, kept as `map.arrow`, and read back while latents and options stay the same. A verb that is asked for
//! no option of the map draws on one that is there, so that the figures of a folder show one map.

mod known;
mod layout;
mod made;
mod onto;

use std::path::{Path, PathBuf};
use std::str::FromStr;

use rayon::prelude::*;
use serde_json::{Value, json};
use vibes_data::Latents;

use super::session::Session;
use super::{Globals, say, wrong};
use crate::figures::Coloring;
use crate::input::UserColumn;
use crate::output::MapTable;
use known::{Recipe, There};
pub(super) use made::MadeMap;
use onto::OldMap;
use vibes_command::{Given, options_of};
use vibes_measure::neighbours::{Metric, Space};
use vibes_measure::quality::{QualityOptions, quality};
use vibes_measure::tsne::TsneOptions;
use vibes_measure::umap::UmapOptions;

/// How the map is made.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct MapOptions {
    #[command(flatten)]
    given: Given,
    /// How the map is made.
    #[arg(long, value_enum, default_value_t = Method::Umap)]
    pub(super) method: Method,
    /// The distance between latents: standardized, euclidean or cosine.
    #[arg(long, default_value = "euclidean", value_parser = Metric::from_str)]
    pub(super) metric: Metric,
    /// UMAP: size of a neighbourhood, the point itself included [default: 15, or all rows where there are fewer].
    #[arg(long)]
    pub(super) neighbours: Option<usize>,
    /// UMAP: how close points may lie on the map.
    #[arg(long, default_value_t = 0.1)]
    pub(super) min_dist: f64,
    /// UMAP: scale of the map.
    #[arg(long, default_value_t = 1.0)]
    pub(super) spread: f64,
    /// t-SNE: the effective size of a neighbourhood [default: 30, or a third of the other rows where there are fewer than 91].
    #[arg(long)]
    pub(super) perplexity: Option<f64>,
    /// UMAP: rounds of the layout [default: 500, above 10,000 rows 200].
    #[arg(long)]
    pub(super) epochs: Option<usize>,
    /// UMAP and t-SNE: rows to lay out; of a larger table this many are drawn, and the others are placed among them.
    #[arg(long, value_name = "ROWS", default_value_t = FIT_ROWS)]
    pub(super) fit_rows: usize,
    /// Place these latents on an old map (a map.arrow made by UMAP; of a plain array one of all its rows) instead of making a new one.
    #[arg(long, value_name = "MAP",
        conflicts_with_all = ["method", "metric", "neighbours", "min_dist", "spread", "perplexity", "epochs", "fit_rows"])]
    pub(super) onto: Option<PathBuf>,
    /// The latents that the old map is of [default: those that it names].
    #[arg(long, value_name = "LATENTS", requires = "onto")]
    pub(super) onto_latents: Option<PathBuf>,
}

/// Rows laid out by default: the exact neighbour graph of more takes minutes.
const FIT_ROWS: usize = 100_000;

/// A way to make a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Method {
    Umap,
    Tsne,
    Pca,
}

impl Method {
    /// The name for axes.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Umap => "UMAP",
            Self::Tsne => "t-SNE",
            Self::Pca => "PC",
        }
    }
}

/// A column of the user's own as colours.
pub(super) fn coloring((name, column): &(String, UserColumn), rows: usize) -> anyhow::Result<Coloring> {
    if !(0..rows).any(|row| column.has(row)) {
        return Err(wrong(format!("--color {name}: no row has a value of it")));
    }
    Ok(match column.clone() {
        UserColumn::Numbers(values) => Coloring::Quantity { name: name.clone(), values },
        UserColumn::Kinds { of_row, names } => Coloring::Kind { name: name.clone(), kinds: of_row, names },
    })
}

/// A column's name as part of a file's.
pub(super) fn file_stem(name: &str) -> String {
    name.chars().map(|c| if c.is_alphanumeric() || "-_.".contains(c) { c } else { '-' }).collect()
}

impl Default for MapOptions {
    fn default() -> Self {
        let umap = UmapOptions::default();
        Self {
            method: Method::Umap,
            metric: Metric::Euclidean,
            neighbours: umap.neighbours,
            min_dist: umap.min_dist,
            spread: umap.spread,
            epochs: umap.epochs,
            perplexity: TsneOptions::default().perplexity,
            fit_rows: FIT_ROWS,
            onto: None,
            onto_latents: None,
            given: Given::default(),
        }
    }
}

impl MapOptions {
    /// That no option was given that this method does not look at.
    fn check_given(&self) -> anyhow::Result<()> {
        let others: &[&str] = match self.method {
            Method::Umap => &["perplexity"],
            Method::Tsne => &["neighbours", "min_dist", "spread", "epochs"],
            Method::Pca => &["neighbours", "min_dist", "spread", "epochs", "perplexity", "fit_rows"],
        };
        match self.given.first_of(others.iter().copied()) {
            Some(option) => {
                let name = if self.method == Method::Pca { "PCA" } else { self.method.name() };
                Err(wrong(format!("{option} has no effect on a {name} map; leave it out")))
            }
            None => Ok(()),
        }
    }

    /// The options as they go into outputs.
    pub(super) fn json(&self) -> Value {
        json!({
            "method": format!("{:?}", self.method).to_lowercase(), "metric": self.metric.name(), "neighbours": self.neighbours,
            "min_dist": self.min_dist, "spread": self.spread, "epochs": self.epochs,
            "perplexity": self.perplexity, "fit_rows": self.fit_rows, "onto": self.onto, "onto_latents": self.onto_latents,
        })
    }

    /// The map of a verb that has no options for it, which may have been asked for a seed.
    pub(super) fn usual(given: &Given) -> Self {
        Self { given: given.clone(), ..Self::default() }
    }

    /// The map of the session's latents with exactly these options: that of `map.arrow` in the output folder if it was made so, else a new one, which is
    /// written there.
    pub(super) fn map(&self, session: &mut Session, globals: &Globals) -> anyhow::Result<MadeMap> {
        self.map_unless(session, globals, false)
    }

    /// The same, but where no option and no seed was given, a map of the same latents that is there already, however it was made, so that one verb does not
    /// replace the map that another one drew.
    pub(super) fn map_or_other(&self, session: &mut Session, globals: &Globals) -> anyhow::Result<MadeMap> {
        let own = options_of::<Self>();
        let asked = self.given.first_of(own.iter().map(String::as_str).chain(["seed"]));
        self.map_unless(session, globals, asked.is_none())
    }

    fn map_unless(&self, session: &mut Session, globals: &Globals, may_be_other: bool) -> anyhow::Result<MadeMap> {
        self.check_given()?;
        let path = session.out.join("map.arrow");
        let old = self.onto.as_deref().map(|map| OldMap::open(map, self.onto_latents.as_deref())).transpose()?;
        if old.as_ref().is_some_and(|old| vibes_data::is_same_place(&old.path, &path)) {
            return Err(wrong(format!(
                "the new map would take the place of the old one; name another folder with -o: {}",
                path.display()
            )));
        }
        // Before they are moved: whether they are placed on an old map or not, every verb knows them by what the file holds.
        let latents = checksum(&session.latents);
        if let Some(old) = &old {
            session.move_to(&old.origin);
        }
        let recipe = Recipe::new(self, session, &latents, old.as_ref());
        let (made, recipe) = match There::at(&path, &recipe, session) {
            There::Same(map) => {
                say(globals, format_args!("map: {} is still right and used again", path.display()));
                (self.known(map, &recipe), recipe)
            }
            There::OtherWay(map, other) if may_be_other => {
                let how = other.differences(&recipe);
                session.remark(format!(
                    "the map that is there is drawn on, which has {how}; `vibes-analyze umap` makes another"
                ));
                (self.known(map, &other), other)
            }
            there => {
                let made = self.make(old.as_ref(), &path, recipe.text(), session, globals)?;
                there.replaced().into_iter().for_each(|remark| session.remark(remark));
                (made, recipe)
            }
        };
        remark_drawn(&recipe, session);
        session.name_map(recipe.about());
        session.outcome.files.push(path);
        Ok(MadeMap { backdrop: old.map_or_else(Vec::new, |old| old.map.positions), ..made })
    }

    /// The map that is there.
    fn known(&self, known: MapTable, recipe: &Recipe) -> MadeMap {
        let named = |name: &str| <Method as clap::ValueEnum>::from_str(name, false).ok();
        let method = recipe.option("method").as_str().and_then(named);
        MadeMap {
            positions: known.positions,
            backdrop: Vec::new(),
            quality: serde_json::from_str(&known.quality).unwrap_or(Value::Null),
            method: method.unwrap_or(self.method),
            how: ", used again".into(),
        }
    }

    fn make(
        &self,
        old: Option<&OldMap>,
        path: &Path,
        recipe: String,
        session: &mut Session,
        globals: &Globals,
    ) -> anyhow::Result<MadeMap> {
        let mut rng = session.rng();
        let (positions, how, metric) = match old {
            Some(old) => {
                (old.place(&session.latents, &mut rng)?, format!(", placed on {}", old.path.display()), old.metric)
            }
            None => {
                let laid_out = self.lay_out(session, globals, &mut rng)?;
                let how = if laid_out.graph_reused { ", neighbour graph used again" } else { "" };
                (laid_out.positions, how.to_string(), self.metric)
            }
        };
        let space = Space::new(session.table()?, metric)?;
        let quality = quality(&space, &positions, QualityOptions::default(), &mut rng).ok();
        let quality = quality.map_or(
            Value::Null,
            |q| json!({ "trustworthiness": q.trustworthiness, "kept": q.kept, "k": q.k, "rows": q.rows }),
        );
        let l = &session.latents;
        let table = MapTable {
            episode: l.episode.clone(),
            step: l.step.clone(),
            positions,
            recipe,
            quality: quality.to_string(),
            latents: vibes_data::relative_place(&session.path, &session.out),
        };
        table.write(path)?;
        Ok(MadeMap { positions: table.positions, backdrop: Vec::new(), quality, method: self.method, how })
    }
}

/// Says of a large table that some of its rows were laid out and the others placed among them.
fn remark_drawn(recipe: &Recipe, session: &mut Session) {
    let rows = session.latents.len();
    let is_placed = !recipe.option("onto").is_null() || recipe.option("method") == "pca";
    let laid_out = recipe.option("fit_rows").as_u64().filter(|_| !is_placed).map(|fit_rows| fit_rows as usize);
    if let Some(laid_out) = laid_out.filter(|laid_out| rows > *laid_out) {
        session.remark(format!(
            "{laid_out} rows drawn from the {rows} were laid out, the others placed among them (--fit-rows {rows} lays out all)"
        ));
    }
}

/// A checksum of the latents and their keys, block by block.
fn checksum(l: &Latents) -> String {
    const BLOCK: usize = 1 << 20;
    let of_keys =
        |keys: &[u32]| vibes_data::sha256_hex(&keys.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
    let of_block =
        |block: &[f32]| vibes_data::sha256_hex(&block.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>());
    let mut parts: Vec<String> = l.latent.par_chunks(BLOCK).map(of_block).collect();
    parts.extend([l.dims.to_string(), of_keys(&l.episode), of_keys(&l.step)]);
    vibes_data::sha256_hex(parts.concat().as_bytes())
}

/// `16,064`.
pub(super) fn thousands(n: usize) -> String {
    let digits = n.to_string();
    let groups: Vec<&str> = digits.as_bytes().rchunks(3).rev().filter_map(|g| std::str::from_utf8(g).ok()).collect();
    groups.join(",")
}
