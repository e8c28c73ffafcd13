//! What a recording's rows say besides pictures, as named numbers: the task's quantities, and the distractors' parameters.
//!
//! In: a [`Spec`] and rows of an episode. Out: a list of [`Readable`]s with a value a row. Programs that ask what can be read from a latent ask for
//! these, under these names. A task says its own quantities ([`Spec::quantities`]) as formulas of the columns; a recording that says none (another
//! people's data) has the numbers of its vector observation.

use serde::{Deserialize, Serialize};

use crate::{EpisodeView, Spec};

/// A number of the task, under a name that a reader understands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Quantity {
    /// As in `cosine of the pole's angle`.
    pub name: String,
    /// Whether a latent should hold it.
    pub about: About,
    /// How it follows from a row's columns.
    pub formula: Formula,
}

/// What a quantity is about, and so whether it should be readable from a latent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum About {
    /// The task's state: readable is good.
    Task,
    /// What a symmetry of the task makes superfluous, such as where the whole scene points when only angles between its parts matter: need not be readable.
    Symmetry,
    /// The distractors: at chance is good.
    Distractor,
}

impl About {
    /// As it is written in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Task => "task",
            Self::Symmetry => "symmetry",
            Self::Distractor => "distractor",
        }
    }
}

/// A number of a row, by places in its columns `observation`, `qpos` and `qvel`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Formula {
    /// A number of the vector observation.
    Observation(usize),
    /// A generalised position.
    Qpos(usize),
    /// A generalised velocity.
    Qvel(usize),
    /// The cosine of a generalised position.
    Cosine(usize),
    /// The sine of a generalised position.
    Sine(usize),
    /// The length of the vector of these numbers of the observation.
    Length(Vec<usize>),
    /// A vector in the plane, two numbers of the observation, seen from a frame that is turned by a generalised position.
    Turned {
        /// The vector's two numbers.
        vector: [usize; 2],
        /// The generalised position, radians.
        by: usize,
        /// 0: along the frame's first axis; 1: along its second.
        axis: usize,
    },
}

impl Formula {
    /// Its value from a row's columns.
    pub fn value(&self, observation: &[f32], qpos: &[f64], qvel: &[f64]) -> f64 {
        let seen = |at: usize| f64::from(observation[at]);
        match self {
            Self::Observation(at) => seen(*at),
            Self::Qpos(at) => qpos[*at],
            Self::Qvel(at) => qvel[*at],
            Self::Cosine(at) => qpos[*at].cos(),
            Self::Sine(at) => qpos[*at].sin(),
            Self::Length(places) => places.iter().map(|&at| seen(at).powi(2)).sum::<f64>().sqrt(),
            Self::Turned { vector: [x, y], by, axis } => {
                let ((sin, cos), x, y) = (qpos[*by].sin_cos(), seen(*x), seen(*y));
                if *axis == 0 { cos * x + sin * y } else { cos * y - sin * x }
            }
        }
    }

    /// Whether every place is within columns of these lengths.
    pub(crate) fn fits(&self, observation: usize, qpos: usize, qvel: usize) -> bool {
        match self {
            Self::Observation(at) => *at < observation,
            Self::Qpos(at) | Self::Cosine(at) | Self::Sine(at) => *at < qpos,
            Self::Qvel(at) => *at < qvel,
            Self::Length(places) => places.iter().all(|at| *at < observation),
            Self::Turned { vector, by, axis } => vector.iter().all(|at| *at < observation) && *by < qpos && *axis < 2,
        }
    }
}

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

#[cfg(test)]
mod tests {
    use super::Formula;

    #[test]
    fn formulas_of_known_columns() {
        let (observation, qpos, qvel) = ([3.0_f32, 4.0], [std::f64::consts::FRAC_PI_2, 0.25], [7.0]);
        let value = |formula: Formula| formula.value(&observation, &qpos, &qvel);
        assert_eq!(value(Formula::Observation(1)), 4.0);
        assert_eq!((value(Formula::Qpos(1)), value(Formula::Qvel(0))), (0.25, 7.0));
        assert_eq!((value(Formula::Cosine(1)), value(Formula::Sine(0))), (0.25_f64.cos(), 1.0));
        assert_eq!(value(Formula::Length(vec![0, 1])), 5.0);
        // A frame that points along y sees (3, 4) four ahead and three to its right.
        let turned = |axis| value(Formula::Turned { vector: [0, 1], by: 0, axis });
        assert!((turned(0) - 4.0).abs() < 1e-12 && (turned(1) + 3.0).abs() < 1e-12);
        assert!(!Formula::Turned { vector: [0, 2], by: 0, axis: 0 }.fits(2, 2, 1));
        assert!(!Formula::Qvel(1).fits(2, 2, 1) && Formula::Qvel(0).fits(2, 2, 1));
    }
}
