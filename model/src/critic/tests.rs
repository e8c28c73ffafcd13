//! How a critic begins, and its slow copy.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::actions::ActionDistribution;
use crate::golden::small_model;
use crate::parameters::to_values;

fn critic(values: ValueDistribution, seed: u64) -> Critic {
    let config = BehaviourConfig { actions: ActionDistribution::BoundedNormal, values, hidden: 8 };
    Critic::init(&small_model(1), config, &mut ChaCha8Rng::seed_from_u64(seed), &Device::flex())
}

#[test]
fn a_critic_begins_at_exactly_zero() {
    for values in [ValueDistribution::TwoHot, ValueDistribution::Gaussian] {
        let features = crate::actions::noise([5, 17], &mut ChaCha8Rng::seed_from_u64(0), &Device::flex());
        assert_eq!(to_values(critic(values, 1).values(features)), [0.0; 5], "{values:?}");
    }
}

#[test]
fn the_slow_copy_goes_the_stated_share_of_the_way() {
    let (slow, goal) = (critic(ValueDistribution::Gaussian, 1), critic(ValueDistribution::Gaussian, 2));
    let [before, aim] = [&slow, &goal].map(|critic| to_values(critic.mlp.first.weight.val()));
    let after = to_values(slow.towards(&goal, 0.25).mlp.first.weight.val());
    for ((before, aim), after) in before.iter().zip(aim).zip(after) {
        assert!((after - (before + 0.25 * (aim - before))).abs() < 1e-6);
    }
}
