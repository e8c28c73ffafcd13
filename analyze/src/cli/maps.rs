//! The map that several verbs draw on: computed once, kept as `map.arrow`, and read back while latents and options stay the same.

use std::str::FromStr;

use serde_json::{Value, json};

use super::session::Session;
use super::{Globals, say};
use crate::neighbours::{Metric, Space};
use crate::output::MapTable;
use crate::pca::pca;
use crate::quality::{QualityOptions, quality};
use crate::tsne::{TsneOptions, tsne};
use crate::umap::{UmapOptions, umap};

/// How the map is made.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct MapOptions {
    /// How the map is made.
    #[arg(long, value_enum, default_value_t = Method::Umap)]
    pub(super) method: Method,
    /// The distance between latents: standardized, euclidean or cosine.
    #[arg(long, default_value = "euclidean", value_parser = Metric::from_str)]
    pub(super) metric: Metric,
    /// UMAP: size of a neighbourhood, the point itself included.
    #[arg(long, default_value_t = 15)]
    pub(super) neighbours: usize,
    /// UMAP: how close points may lie on the map.
    #[arg(long, default_value_t = 0.1)]
    pub(super) min_dist: f64,
    /// UMAP: scale of the map.
    #[arg(long, default_value_t = 1.0)]
    pub(super) spread: f64,
    /// t-SNE: the effective size of a neighbourhood.
    #[arg(long, default_value_t = 30.0)]
    pub(super) perplexity: f64,
    /// UMAP: rounds of the layout [default: 500, above 10,000 rows 200].
    #[arg(long)]
    pub(super) epochs: Option<usize>,
}

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

/// A map with its quality.
#[derive(Debug)]
pub(super) struct MadeMap {
    pub(super) positions: Vec<[f32; 2]>,
    /// `trustworthiness`, `kept` and over how many neighbours and rows; null for fewer rows than it takes.
    pub(super) quality: Value,
}

impl MadeMap {
    /// The positions in double precision, for figures.
    pub(super) fn points(&self) -> Vec<[f64; 2]> {
        self.positions.iter().map(|p| [f64::from(p[0]), f64::from(p[1])]).collect()
    }

    /// `trustworthiness 0.98, neighbours kept 0.61`, or nothing.
    pub(super) fn quality_text(&self) -> String {
        match (self.quality["trustworthiness"].as_f64(), self.quality["kept"].as_f64()) {
            (Some(t), Some(kept)) => format!("trustworthiness {t:.3}, neighbours kept {kept:.3}"),
            _ => "too few rows for a quality".into(),
        }
    }
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
        }
    }
}

impl MapOptions {
    /// The options as they go into outputs.
    pub(super) fn json(&self) -> Value {
        json!({
            "method": format!("{:?}", self.method).to_lowercase(), "metric": self.metric.name(), "neighbours": self.neighbours,
            "min_dist": self.min_dist, "spread": self.spread, "epochs": self.epochs,
            "perplexity": self.perplexity,
        })
    }

    /// The map of the session's latents: that of `map.arrow` in the output folder if it was made of the same latents with the same options,
    /// else a new one, which is written there.
    pub(super) fn map(&self, session: &mut Session, globals: &Globals) -> anyhow::Result<MadeMap> {
        let path = session.out.join("map.arrow");
        let recipe = json!({ "options": self.json(), "seed": session.seed, "latents": checksum(session) }).to_string();
        if let Some(known) = MapTable::read(&path)
            .filter(|m| m.recipe == recipe && m.episode == session.latents.episode && m.step == session.latents.step)
        {
            say(globals, format_args!("map: {} is still right and used again", path.display()));
            session.outcome.files.push(path);
            return Ok(MadeMap {
                positions: known.positions,
                quality: serde_json::from_str(&known.quality).unwrap_or(Value::Null),
            });
        }
        let made = self.make(session)?;
        let l = &session.latents;
        let table = MapTable {
            episode: l.episode.clone(),
            step: l.step.clone(),
            positions: made.positions.clone(),
            recipe,
            quality: made.quality.to_string(),
        };
        table.write(&path)?;
        session.outcome.files.push(path);
        Ok(made)
    }

    fn make(&self, session: &Session) -> anyhow::Result<MadeMap> {
        let mut rng = session.rng();
        let space = Space::new(session.table()?, self.metric)?;
        let umap_options = UmapOptions {
            neighbours: self.neighbours,
            min_dist: self.min_dist,
            spread: self.spread,
            epochs: self.epochs,
            ..UmapOptions::default()
        };
        let positions = match self.method {
            Method::Umap => umap(&space, umap_options, &mut rng)?,
            Method::Tsne => {
                tsne(&space, TsneOptions { perplexity: self.perplexity, ..TsneOptions::default() }, &mut rng)?
            }
            Method::Pca => pca(space.table())?.positions,
        };
        let quality = quality(&space, &positions, QualityOptions::default(), &mut rng).ok();
        let quality = quality.map_or(
            Value::Null,
            |q| json!({ "trustworthiness": q.trustworthiness, "kept": q.kept, "k": q.k, "rows": q.rows }),
        );
        Ok(MadeMap { positions, quality })
    }
}

/// A checksum of the latents and their keys.
fn checksum(session: &Session) -> String {
    let l = &session.latents;
    let values: Vec<u8> = l.latent.iter().flat_map(|v| v.to_le_bytes()).collect();
    let keys: Vec<u8> = l.episode.iter().chain(&l.step).flat_map(|v| v.to_le_bytes()).collect();
    format!("{}{}", vibes_data::sha256_hex(&values), &vibes_data::sha256_hex(&keys)[..16])
}
