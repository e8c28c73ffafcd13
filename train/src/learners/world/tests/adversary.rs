//! The adversary's way to the encoder: through the latents, with its own weights held fixed.

use burn::tensor::TensorData;
use vibes_model::init::normal;
use vibes_model::parameters::read_parameters;

use super::*;
use crate::learners::objective::Definition;
use crate::learners::objective::vibes::Vibes;
use crate::learners::scene::predict;

/// Nothing is cut. Otherwise the adversary also decides which terms are, and so moves the encoder even where no gradient passes through it.
const UNCUT: &str = "dynamics_weight = 1.0\nclip = 'none'";

#[test]
fn the_adversary_moves_the_encoder_through_the_latents() {
    // Two learners that differ in their adversary's rate alone: after one update ψ differs, and so does the encoder's step, because ψ steps first and its
    // log-likelihood passes gradients to the latents. Reward and dynamics are the same in both.
    let encoder_after = |rate: f64| {
        let (learner, batch, options) = learner("vibes", UNCUT);
        let settings = Settings { adversary_lr: rate, ..options.settings };
        let options = Options { settings, ..options };
        let (learner, _) = learner
            .update(&batch, options.schedule(0, Some(0)), options.parts(), &mut ChaCha8Rng::seed_from_u64(6))
            .unwrap();
        let adversary = learner.model.adversary.as_ref().unwrap();
        (read_parameters(&learner.model.world.encoder, ""), read_parameters(adversary, ""))
    };
    let (slow, fast) = (encoder_after(1e-6), encoder_after(0.1));
    assert_ne!(slow.1, fast.1);
    assert_ne!(slow.0, fast.0);
    assert_eq!(slow, encoder_after(1e-6));
}

/// Of the whole value: dynamics, adversary and reward, each of which sees the latents in ways of its own. A step's latents are moved together in a direction that was drawn.
#[test]
fn the_gradient_of_the_latents_is_that_of_finite_differences() {
    const STEP: f32 = 0.01;
    let (learner, batch, options) = learner("vibes", UNCUT);
    let Model { config, world, adversary } = &learner.model;
    // The adversary's step looks at the latents too; at a rate of 0 it leaves ψ as it is.
    let schedule = Schedule { adversary_lr: 0.0, ..options.schedule(0, Some(0)) };
    let device = Device::flex();
    let drawn = || {
        let rng = &mut ChaCha8Rng::seed_from_u64(6);
        Scene::new((world, config), &batch, (&options.settings, schedule), rng, &device).unwrap()
    };
    let objective = |latents: Tensor<3>| {
        let mut scene = drawn();
        scene.predictions = predict(world, &batch, &latents, latents.clone()).0;
        scene.latents = latents;
        let (mut adversary, mut optimizer) = (adversary.clone(), Optimizer::new(1e-8));
        let rival = Rival { adversary: &mut adversary, optimizer: &mut optimizer };
        // Summed over the rows, so that differences are far above the rounding of single precision.
        Vibes.value(&scene, rival, &mut ChaCha8Rng::seed_from_u64(1)).unwrap().objective * batch.count
    };
    let latents = drawn().latents;
    let shape = latents.dims();
    let values = to_values(latents);
    let tensor = |values: Vec<f32>| Tensor::<3>::from_data(TensorData::new(values, shape), &device.clone().autodiff());
    let leaf = tensor(values.clone()).require_grad();
    let gradient = to_values(leaf.grad(&objective(leaf.clone()).backward()).unwrap());
    let (row, mut rng) = (shape[1] * shape[2], ChaCha8Rng::seed_from_u64(2));
    for at in 0..shape[0] {
        let direction = normal(row, &mut rng);
        let moved = |step: f32| {
            let mut moved = values.clone();
            moved[at * row..].iter_mut().zip(&direction).for_each(|(value, along)| *value += step * along);
            f64::from(scalar(&objective(tensor(moved))))
        };
        let wanted = (moved(STEP) - moved(-STEP)) / f64::from(2.0 * STEP);
        let found: f64 =
            gradient[at * row..].iter().zip(&direction).map(|(slope, along)| f64::from(slope * along)).sum();
        assert!(
            (found - wanted).abs() < 0.03 * wanted.abs().max(1.0),
            "latents of step {at}: {found} against {wanted}"
        );
    }
}
