//! Numbers of a task under names that a reader understands, as formulas of a row's columns. In: a row's columns. Out: a value.
//!
//! A task says its own quantities in the recording's spec, so that whoever reads the recording needs to know nothing of the task.

use serde::{Deserialize, Serialize};

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
