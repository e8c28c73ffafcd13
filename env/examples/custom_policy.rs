//! A policy of one's own: it turns the reacher's arm to one side for five agent steps, then to the other. Its return is printed beside a random
//! policy's, and its actions as a JSON list that `vibes-collect --policy actions:FILE` records.
//!
//! ```text
//! cargo run -p vibes-env --example custom_policy > actions.json
//! vibes-collect --task reacher-easy --policy actions:actions.json --steps 100 --episodes 1
//! ```
#![allow(clippy::print_stdout, clippy::print_stderr, reason = "an example says what it did")]

use rand::RngCore;
use vibes_env::{Environment, EnvironmentOptions, Eyes, Policy, Random, Result, Sight, Start, rollout};

/// Turns to and fro.
#[derive(Debug, Default)]
struct ToAndFro {
    step: usize,
}

impl Policy for ToAndFro {
    fn begin(&mut self, _: &Start) -> Result<()> {
        self.step = 0;
        Ok(())
    }

    // A policy sees the vector observation, the picture if it asks for pictures (`Policy::pictures`), and the simulator.
    fn act(&mut self, sight: &Sight<'_>, _: &mut dyn RngCore) -> Result<Vec<f64>> {
        let side = if (self.step / 5).is_multiple_of(2) { 0.5 } else { -0.5 };
        self.step += 1;
        Ok(vec![side; sight.environment.action_len()])
    }
}

fn main() -> Result<()> {
    let environment = Environment::new("reacher-easy", EnvironmentOptions::default())?;
    let mut eyes = Eyes::blind(environment)?;
    let mine = rollout(&mut eyes, &mut ToAndFro::default(), 100, 1.into())?;
    let random = rollout(&mut eyes, &mut Random, 100, 1.into())?;
    eprintln!("return of 100 agent steps: {:.1}, at random {:.1}", mine.episode_return(), random.episode_return());
    println!("{:?}", mine.actions);
    Ok(())
}
