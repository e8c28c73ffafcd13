//! Strips of pictures over time: the recorded frame, what each run's latent shows of it, and what its dynamics predict from one step on.

use std::sync::Arc;

use super::heading::Heading;
use crate::picture::color::{FAINT, INK, RULE, kind};
use crate::picture::font::{Weight, fit, fit_ends};
use crate::picture::number::LABEL_SIZE;
use crate::picture::{Anchor, PAGE, Picture, Pixels, Rect, TextStyle};

/// Room for the names of the lines, points.
const LEFT: f64 = 78.0;
/// Gap between pictures, points.
const GAP: f64 = 1.5;

/// One line of pictures.
#[derive(Clone, Debug)]
pub struct StripLine {
    /// What it shows, as in "recorded".
    pub name: String,
    /// One picture a step; none is left empty.
    pub pictures: Vec<Option<Arc<Pixels>>>,
}

/// Lines over the same steps of one episode.
#[derive(Clone, Debug)]
pub struct Strip {
    /// What they are of, as in "episode 3".
    pub title: String,
    /// The steps.
    pub steps: Vec<u32>,
    /// The step at which the prediction begins.
    pub start: u32,
    /// From top to bottom.
    pub lines: Vec<StripLine>,
}

/// The figure.
#[derive(Clone, Debug)]
pub struct Strips {
    /// Title and note.
    pub heading: Heading,
    /// From top to bottom.
    pub strips: Vec<Strip>,
    /// What stands at the foot.
    pub foot: String,
}

impl Strips {
    /// Draws the figure at the width of a page.
    #[must_use]
    pub fn draw(&self) -> Picture {
        let columns = self.strips.iter().map(|strip| strip.steps.len()).max().unwrap_or(1).max(1);
        let cell = ((PAGE - LEFT - 8.0) / columns as f64 - GAP).min(48.0);
        let height = |strip: &Strip| 24.0 + strip.lines.len() as f64 * (cell * strip.aspect() + GAP);
        let body: f64 = self.strips.iter().map(height).sum();
        let (mut picture, mut y) = self.heading.picture(PAGE, body + 14.0);
        for strip in &self.strips {
            strip.draw(&mut picture, y, cell);
            y += height(strip);
        }
        let foot = fit(&self.foot, 6.0, Weight::Regular, PAGE - 12.0);
        picture.text((6.0, y + 8.0), foot, TextStyle::new(6.0).color(FAINT));
        picture
    }
}

impl Strip {
    /// Height over width of its pictures.
    fn aspect(&self) -> f64 {
        let first = self.lines.iter().flat_map(|line| line.pictures.iter().flatten()).next();
        first.map_or(1.0, |pixels| f64::from(pixels.height) / f64::from(pixels.width.max(1)))
    }

    fn draw(&self, picture: &mut Picture, top: f64, cell: f64) {
        let title = fit(&self.title, LABEL_SIZE, Weight::Bold, LEFT - 10.0);
        picture.text((6.0, top + 15.0), title, TextStyle::new(LABEL_SIZE).bold());
        let (high, x) = (cell * self.aspect(), |i: usize| LEFT + i as f64 * (cell + GAP));
        for (i, step) in self.steps.iter().enumerate().filter(|(i, _)| cell > 16.0 || i % 2 == 0) {
            let style = TextStyle::new(5.5).anchor(Anchor::Middle).color(FAINT);
            picture.text((x(i) + cell / 2.0, top + 15.0), step.to_string(), style);
        }
        let top = top + 19.0;
        for (l, line) in self.lines.iter().enumerate() {
            let y = top + l as f64 * (high + GAP);
            let name = fit_ends(&line.name, 6.5, Weight::Regular, LEFT - 10.0);
            picture.text((LEFT - 4.0, y + high / 2.0 + 2.3), name, TextStyle::new(6.5).anchor(Anchor::End).color(INK));
            for (i, pixels) in line.pictures.iter().enumerate() {
                let place = Rect::new(x(i), y, cell, high);
                match pixels {
                    Some(pixels) => picture.image(pixels.clone(), place),
                    None => picture.frame(place, 0.3, RULE),
                }
            }
        }
        if let Some(at) = self.steps.iter().position(|&step| step == self.start) {
            let x = x(at) - GAP / 2.0;
            let bottom = top + self.lines.len() as f64 * (high + GAP) - GAP;
            picture.line(&[(x, top - 2.0), (x, bottom + 1.0)], 1.0, kind(4));
        }
    }
}
