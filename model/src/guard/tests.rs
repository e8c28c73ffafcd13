//! Members that agree, members that differ by a known amount, and the way back from a file.

use super::*;
use crate::actions::noise;
use crate::golden::small_model;
use crate::parameters::to_values;

fn guard(members: usize) -> (Guard, Tensor<3>, Tensor<3>) {
    let (mut rng, device) = (ChaCha8Rng::seed_from_u64(7), Device::flex());
    let guard = Guard::init(&ModelConfig { reward_scale: 2.0, ..small_model(2) }, members, &mut rng, &device);
    (guard, noise([3, 4, 5], &mut rng, &device), noise([3, 4, 2], &mut rng, &device))
}

#[test]
fn members_that_agree_disagree_by_nothing_and_apart_by_their_standard_deviation() {
    let (mut guard, latents, actions) = guard(3);
    let own = guard.members.expected(latents.clone(), actions.clone());
    assert_eq!(own.dims(), [3, 4, 3]);
    assert!(to_values(guard.members.disagreement(own)).iter().all(|&apart| apart > 0.0));
    let head = guard.members.heads[0].clone();
    guard.members.heads = vec![head.clone(); 3];
    let agreed = guard.members.expected(latents.clone(), actions.clone());
    assert!(to_values(guard.members.disagreement(agreed)).iter().all(|apart| apart.abs() < 1e-6));
    // 0, 1 and 2 more than the same: a standard deviation of √(2/3), and a unit of 2.
    for (more, head) in guard.members.heads.iter_mut().enumerate() {
        let bias = head.last.bias.clone();
        head.last.bias = bias.map(|bias| bias + more as f32);
    }
    let apart = to_values(guard.members.disagreement(guard.members.expected(latents, actions)));
    let wanted = 2.0 * (2.0_f32 / 3.0).sqrt();
    assert!(apart.iter().all(|apart| (apart - wanted).abs() < 1e-3), "{apart:?}");
}

#[test]
fn gradients_are_finite_where_members_agree_and_lead_to_where_they_agree_elsewhere() {
    let (mut guard, latents, actions) = guard(4);
    let wanted = |guard: &Guard| {
        let actions = Tensor::from_data(actions.to_data(), &Device::flex().autodiff()).require_grad();
        let apart = guard.members.disagreement(guard.members.expected(latents.clone(), actions.clone()));
        let gradient = actions.grad(&apart.clone().sum().backward()).unwrap();
        (to_values(apart.inner()), actions.inner(), gradient)
    };
    let (before, at, gradient) = wanted(&guard);
    let moved = guard.members.expected(latents.clone(), at - gradient.clone() * 1e-3);
    let after = to_values(guard.members.disagreement(moved));
    let sum = |numbers: &[f32]| numbers.iter().sum::<f32>();
    let slope = to_values(gradient.square().sum())[0] * 1e-3;
    assert!((sum(&before) - sum(&after) - slope).abs() < 0.05 * slope, "{before:?} {after:?} {slope}");
    let head = guard.members.heads[0].clone();
    guard.members.heads = vec![head; 4];
    let (_, _, gradient) = wanted(&guard);
    assert!(to_values(gradient).iter().all(|number| number.is_finite()));
}

#[test]
fn every_episode_teaches_its_own_share_of_the_members_for_ever() {
    let (guard, ..) = guard(5);
    let episodes = 400;
    let mut taught = [0; 5];
    for episode in 0..episodes {
        let learns = guard.learns_from(episode);
        assert_eq!(learns, guard.learns_from(episode));
        learns.iter().zip(&mut taught).for_each(|(learns, taught)| *taught += u32::from(*learns));
    }
    assert!(taught.iter().all(|taught| taught.abs_diff(episodes / 2) < 50), "{taught:?}");
    assert!((0..episodes).any(|episode| guard.learns_from(episode) != guard.learns_from(0)));
}

#[test]
fn a_guard_is_the_same_after_its_file() {
    let (guard, latents, actions) = guard(3);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("guard.safetensors");
    guard.save(&path).unwrap();
    let found = Guard::load(&path, &small_model(2), &Device::flex()).unwrap();
    assert_eq!(found.config, guard.config);
    let [mine, theirs] =
        [&guard, &found].map(|guard| to_values(guard.members.expected(latents.clone(), actions.clone())));
    assert_eq!(mine, theirs);
}
