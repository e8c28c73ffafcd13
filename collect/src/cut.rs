//! What of a file of actions lies beyond the bounds of the task's actions: it is executed, and recorded, cut to them, as the actuators would cut it, and whoever wrote the file
//! should hear of it.
//!
//! In: a policy, the steps of an episode, an environment. Out: how many numbers are cut, and the first of them, in words.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use vibes_env::{Environment, Policy, PolicySpec, Replay, Sight, Start};

/// What an episode of so many steps cuts of a policy's actions; none of a policy without a file, and of a file that cannot be played, which recording refuses.
pub(crate) fn cut_actions(policy: &PolicySpec, steps: u32, environment: &Environment) -> Option<String> {
    let PolicySpec::Actions { path } = policy else { return None };
    let bounds = environment.action_spec();
    let mut replay = Replay::read(path).ok()?;
    replay.begin(&Start::default()).ok()?;
    let sight = Sight { observation: &[], pixels: &[], environment };
    let mut rng = ChaCha8Rng::seed_from_u64(0);
    let (mut count, mut first) = (0_usize, None);
    for row in 0..steps {
        let action = replay.act(&sight, &mut rng).ok()?;
        for (&number, (&low, &high)) in action.iter().zip(bounds.min.iter().zip(&bounds.max)) {
            if !(low..=high).contains(&number) {
                count += 1;
                first = first.or(Some((row, number, number.clamp(low, high))));
            }
        }
    }
    let (row, number, cut) = first?;
    let numbers = if count == 1 { "1 number is".to_owned() } else { format!("{count} numbers are") };
    let fact = format!("{numbers} beyond the bounds of the task's actions and cut to them");
    Some(format!("{fact}, the first in row {row}: {number} becomes {cut}: {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use vibes_env::EnvironmentOptions;

    #[test]
    fn what_is_cut_is_counted_and_the_first_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.json");
        let environment = Environment::new("reacher-easy", EnvironmentOptions::default()).unwrap();
        let cut = |text: &str, steps: u32| {
            std::fs::write(&path, text).unwrap();
            cut_actions(&PolicySpec::Actions { path: path.clone() }, steps, &environment)
        };
        let said = cut("[[0, 0], [0.5, 5], [-3, 1]]", 3).unwrap();
        assert!(said.starts_with("2 numbers are beyond") && said.contains("row 1: 5 becomes 1"), "{said}");
        assert!(cut("[[0, 0], [0.5, 5], [-3, 1]]", 2).unwrap().starts_with("1 number is"));
        assert_eq!(cut("[[1, -1], [0, 5]]", 1), None, "what is not played is not cut");
        assert_eq!(cut("[[0, 5], [0]]", 2), None, "what cannot be played is refused elsewhere");
        assert_eq!(cut_actions(&PolicySpec::Random { hold: 1 }, 9, &environment), None);
    }
}
