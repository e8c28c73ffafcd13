//! What a recording's rows say besides pictures, as named numbers: the task's quantities, and the distractors' parameters.
//!
//! In: a [`Spec`] and rows of an episode. Out: a list of [`Readable`]s with a value a row. Programs that ask what can be read from a latent ask for
//! these, under these names. A recording that says no quantities ([`Spec::quantities`]; other people's data) has the numbers of its vector observation.

use crate::{About, EpisodeView, Formula, Quantity, Spec};

/// A number that rows of a recording have, and that a latent may be asked for.
#[derive(Clone, Debug, PartialEq)]
pub struct Readable {
    /// Its name.
    pub name: String,
    /// What it is about.
    pub about: About,
    source: Source,
}

#[derive(Clone, Debug, PartialEq)]
enum Source {
    Formula(Formula),
    Reward,
    Camera(usize),
    Video,
    VideoFrame,
    Color(usize),
}

impl Readable {
    /// Whether its values are names of classes (which video is shown) and not numbers.
    pub fn is_class(&self) -> bool {
        self.source == Source::Video
    }

    /// Whether it is a number of the task's state, and not its reward or a distractor's.
    pub fn is_state(&self) -> bool {
        self.about == About::Task && self.source != Source::Reward
    }

    /// Whether it is a channel of a material's colour, of which there are dozens.
    pub fn is_color(&self) -> bool {
        matches!(self.source, Source::Color(_))
    }

    /// Its value at a row; none where the row has none: the reward of the last row, the video of a row without a background.
    pub fn value(&self, view: &EpisodeView, row: usize) -> Option<f64> {
        Some(match &self.source {
            Source::Formula(formula) => formula.value(view.observation(row), view.qpos(row), view.qvel(row)),
            Source::Reward => f64::from((row < view.steps()).then(|| view.reward(row))?),
            Source::Camera(part) => {
                let camera = view.camera(row);
                [camera.r, camera.h, camera.v, camera.roll][*part]
            }
            Source::Video => f64::from(view.background(row)?.video),
            Source::VideoFrame => f64::from(view.background(row)?.frame),
            Source::Color(at) => f64::from(view.colors(row)[*at]),
        })
    }
}

impl Spec {
    /// Everything that rows of such a recording say: the task's quantities and its reward, what its symmetry makes superfluous, then camera, background
    /// and colours.
    pub fn readable(&self) -> Vec<Readable> {
        let of = |quantity: &Quantity| Readable {
            name: quantity.name.clone(),
            about: quantity.about,
            source: Source::Formula(quantity.formula.clone()),
        };
        let distractor = |name: String, source| Readable { name, about: About::Distractor, source };
        let mut all: Vec<Readable> = self.quantities.iter().map(of).collect();
        if all.is_empty() {
            let names = self.observation_names().into_iter().enumerate();
            all.extend(names.map(|(at, name)| Readable {
                name,
                about: About::Task,
                source: Source::Formula(Formula::Observation(at)),
            }));
        }
        let rewarded = all.iter().position(|quantity| quantity.about != About::Task).unwrap_or(all.len());
        all.insert(rewarded, Readable { name: "reward".to_owned(), about: About::Task, source: Source::Reward });
        let camera = ["distance", "azimuth", "inclination", "roll"].into_iter().enumerate();
        all.extend(camera.map(|(part, name)| distractor(format!("camera {name}"), Source::Camera(part))));
        all.push(distractor("video".to_owned(), Source::Video));
        all.push(distractor("video frame".to_owned(), Source::VideoFrame));
        let channels =
            self.materials.iter().flat_map(|material| ["red", "green", "blue"].map(|c| format!("{material} {c}")));
        all.extend(channels.enumerate().map(|(at, name)| distractor(name, Source::Color(at))));
        all
    }
}
