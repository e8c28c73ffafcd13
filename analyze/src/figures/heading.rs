//! The heading that all figures share: a title, and a note that says what must be known before reading (how far training got).

use crate::picture::color::{Color, INK};
use crate::picture::font::{Weight, wrap};
use crate::picture::number::{LABEL_SIZE, TITLE_SIZE};
use crate::picture::{Picture, TextStyle};

/// Vermillion, dark enough to be read in print.
const WARN: Color = Color::new(176, 66, 0);

/// A title and an optional note under it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Heading {
    /// What the figure shows.
    pub title: String,
    /// What must be known before reading it, as in "300 updates: barely trained".
    pub note: Option<String>,
}

impl Heading {
    /// A title without a note.
    #[must_use]
    pub fn new(title: impl Into<String>) -> Self {
        Self { title: title.into(), note: None }
    }

    /// The same with a note.
    #[must_use]
    pub fn with_note(self, note: Option<String>) -> Self {
        Self { note, ..self }
    }

    /// The height it takes in a picture of this width, points.
    pub(super) fn height(&self, width: f64) -> f64 {
        let (title, note) = self.lines(width);
        4.0 + title.len() as f64 * (TITLE_SIZE + 2.5) + note.len() as f64 * (LABEL_SIZE + 1.5) + 3.0
    }

    /// Draws it at the top of a picture.
    pub(super) fn draw(&self, picture: &mut Picture) {
        let (title, note) = self.lines(picture.width);
        let mut y = 4.0;
        for line in title {
            y += TITLE_SIZE + 2.5;
            picture.text((6.0, y), line, TextStyle::new(TITLE_SIZE).bold().color(INK));
        }
        for line in note {
            y += LABEL_SIZE + 1.5;
            picture.text((6.0, y), line, TextStyle::new(LABEL_SIZE).color(WARN));
        }
    }

    /// A picture of a width and a body's height with the heading on top, and where the body begins.
    pub(super) fn picture(&self, width: f64, body: f64) -> (Picture, f64) {
        let top = self.height(width);
        let title = self.note.as_ref().map_or_else(|| self.title.clone(), |note| format!("{}. {note}", self.title));
        let mut picture = Picture::new(width, top + body, title);
        self.draw(&mut picture);
        (picture, top)
    }

    fn lines(&self, width: f64) -> (Vec<String>, Vec<String>) {
        let room = width - 12.0;
        let note = self.note.as_deref().unwrap_or_default();
        (wrap(&self.title, TITLE_SIZE, Weight::Bold, room), wrap(note, LABEL_SIZE, Weight::Regular, room))
    }
}
