//! A sample of an episode's pictures drawn again, each beside the rows before and after it: where not much moves, a picture differs little from its neighbour's, and pictures that
//! are all a row late would pass for those of another driver.
//!
//! In: an episode, and what draws. Out: how far the sample is off, and a row whose picture is a neighbour's.

use vibes_data::{BackgroundFrame, EpisodeView};
use vibes_env::distractors::View;
use vibes_env::render::{Renderer, picture_difference};
use vibes_env::videos::VideoLibrary;

use crate::Result;
use crate::largest::largest;

/// Mean absolute error a picture may have, of 255: drivers differ by a few.
const TOLERANCE: f64 = 3.0;
/// Mean absolute error, of 255, below which a picture is the one that is drawn, whatever fits better: a pixel or two at an edge.
const SAME: f64 = 0.01;

/// What draws an episode's pictures again.
pub(super) struct Drawing<'a> {
    pub(super) renderer: &'a mut Renderer,
    pub(super) videos: &'a VideoLibrary,
    /// For each of the part's own videos, its index in the recording's list; the same without a list.
    pub(super) listed: Option<&'a [u32]>,
}

/// What came of it.
#[derive(Debug, Default)]
pub(super) struct Drawn {
    /// Mean absolute errors of the pictures of the sample.
    pub(super) errors: Vec<f64>,
    /// A row, and its neighbour whose picture is stored there.
    pub(super) shifted: Option<(usize, usize)>,
}

impl Drawn {
    /// What is wrong with the pictures, if anything.
    pub(super) fn fault(&self) -> Option<String> {
        if let Some((row, near)) = self.shifted {
            return Some(format!("drawn again, the picture of row {row} is that of row {near}"));
        }
        let worst = largest(self.errors.iter().copied());
        (worst > TOLERANCE).then(|| format!("drawn again, a picture differs by {worst:.1} of 255"))
    }
}

impl Drawing<'_> {
    /// Draws the sample of an episode whose model the renderer has.
    pub(super) fn sample(&mut self, view: &EpisodeView) -> Result<Drawn> {
        let mut drawn = Drawn::default();
        for row in sampled(view) {
            let own = self.error(view, row, row)?;
            drawn.errors.push(own);
            if !own.is_finite() || own <= SAME || drawn.shifted.is_some() {
                continue;
            }
            let beside = [row.checked_sub(1), Some(row + 1).filter(|&next| next < view.rows())];
            for near in beside.into_iter().flatten() {
                // Another driver's pictures are off by as much wherever they are drawn; of a picture in the wrong row what moved in between is off too.
                if self.error(view, near, row)? < own / 2.0 {
                    drawn.shifted = Some((row, near));
                }
            }
        }
        Ok(drawn)
    }

    /// Mean absolute difference of what is drawn of the row `drawn` from the picture that is stored in the row `stored`.
    fn error(&mut self, view: &EpisodeView, drawn: usize, stored: usize) -> Result<f64> {
        let shown = View {
            camera: Some(view.camera(drawn)),
            background: view.background(drawn).and_then(|shown| own_video(self.listed, shown)),
            colors: Some(view.colors(drawn)),
        };
        let mut picture = vec![0; self.renderer.picture_bytes()];
        self.renderer.draw(view.qpos(drawn), &shown, self.videos, &mut picture)?;
        let stored = view.pixels(stored);
        // A picture that is missing is as wrong as can be, though it has no pixel that differs.
        let is_there = stored.len() == picture.len();
        Ok(if is_there { picture_difference(&picture, stored).0 } else { f64::INFINITY })
    }
}

/// The first row, the one around which most moves, and the last.
fn sampled(view: &EpisodeView) -> [usize; 3] {
    let way = |one: usize, other: usize| -> f64 {
        view.qpos(one).iter().zip(view.qpos(other)).map(|(one, other)| (one - other).abs()).sum()
    };
    let moves = |row: usize| way(row - 1, row).min(way(row, row + 1));
    let rows = view.rows();
    let most = (1..rows.saturating_sub(1)).max_by(|&one, &other| moves(one).total_cmp(&moves(other)));
    [0, most.unwrap_or(rows / 2), rows - 1]
}

/// A background by the index that its video has among the part's own.
fn own_video(listed: Option<&[u32]>, shown: BackgroundFrame) -> Option<BackgroundFrame> {
    let Some(listed) = listed else { return Some(shown) };
    let own = listed.iter().position(|&video| video == shown.video)?;
    Some(BackgroundFrame { video: own as u32, ..shown })
}
