//! A trained agent as one more policy. Its networks are another package's, which knows no simulator; here stands what is around them.
//!
//! In: a name for errors, the pictures it wants to see, and a function from a row to the action chosen there. Out: a [`Policy`].

use std::error::Error as Cause;
use std::fmt;

use rand::RngCore;

use super::{Policy, Sight};
use crate::render::RenderSettings;
use crate::{Error, Result, Start};

/// What a trained agent answers: the action `[action]` in the task's own bounds, or its own error.
pub type Chosen = std::result::Result<Vec<f32>, Box<dyn Cause + Send + Sync>>;

/// See the module.
pub struct Trained<F> {
    name: String,
    pictures: Option<RenderSettings>,
    is_first: bool,
    choose: F,
}

impl<F: FnMut(&Sight<'_>, bool, &mut dyn RngCore) -> Chosen> Trained<F> {
    /// A policy whose actions `choose` makes of a row; it is told whether the row is the first of an episode. Without `pictures` it sees none.
    pub fn new(name: String, pictures: Option<RenderSettings>, choose: F) -> Self {
        Self { name, pictures, is_first: true, choose }
    }
}

impl<F: FnMut(&Sight<'_>, bool, &mut dyn RngCore) -> Chosen> Policy for Trained<F> {
    fn pictures(&self) -> Option<RenderSettings> {
        self.pictures
    }

    fn begin(&mut self, _: &Start) -> Result<()> {
        self.is_first = true;
        Ok(())
    }

    fn act(&mut self, sight: &Sight<'_>, rng: &mut dyn RngCore) -> Result<Vec<f64>> {
        let is_first = std::mem::replace(&mut self.is_first, false);
        let chosen = (self.choose)(sight, is_first, rng);
        let action = chosen.map_err(|cause| Error::Acting { policy: self.name.clone(), cause })?;
        Ok(action.into_iter().map(f64::from).collect())
    }
}

impl<F> fmt::Debug for Trained<F> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Trained").field("name", &self.name).field("pictures", &self.pictures).finish_non_exhaustive()
    }
}
