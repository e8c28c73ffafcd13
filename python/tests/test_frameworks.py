"""With the real packages: Stable-Baselines3, TorchRL, PyTorch's data loader. `make python-test` installs them; without them these tests fail."""

import numpy as np
import vibes


def test_stable_baselines3_learns_in_it():
    import stable_baselines3
    from stable_baselines3.common.env_checker import check_env
    from stable_baselines3.common.vec_env import DummyVecEnv, VecFrameStack, VecTransposeImage

    check_env(vibes.make(size=36, action_repeat=100))
    envs = DummyVecEnv([lambda seed=seed: vibes.make(size=36, action_repeat=100, seed=seed) for seed in range(2)])
    stacked = VecFrameStack(VecTransposeImage(envs), 3)
    assert stacked.reset().shape == (2, 9, 36, 36)
    model = stable_baselines3.PPO("CnnPolicy", envs, n_steps=16, batch_size=16, n_epochs=1, device="cpu", seed=0)
    before = [weights.clone() for weights in model.policy.parameters()]
    model.learn(32)
    assert any((a != b).any() for a, b in zip(before, model.policy.parameters()))
    action, _ = model.predict(envs.reset())
    assert action.shape == (2, 2)
    both = stable_baselines3.SAC("MultiInputPolicy", vibes.make(size=36, action_repeat=100, observation="both"), buffer_size=100, learning_starts=10, device="cpu", seed=0)
    both.learn(20)


def test_torchrl_collects_from_it():
    import torch
    from torchrl.envs import GymWrapper
    from torchrl.envs.utils import check_env_specs

    env = GymWrapper(vibes.make(size=32, action_repeat=100, observation="both"))
    check_env_specs(env)
    rollout = env.rollout(25, break_when_any_done=False)
    assert rollout["pixels"].shape == (25, 32, 32, 3) and rollout["pixels"].dtype == torch.uint8
    assert rollout["next", "reward"].shape == (25, 1)


def test_torchrls_dm_control_wrapper_takes_it():
    import torch
    from dm_control.rl import control
    from torchrl.envs.libs.dm_control import DMControlWrapper
    from torchrl.envs.utils import check_env_specs
    from vibes.dm import DmEnvironment

    # The wrapper asks for dm_control's own class, of which ours is one by its interface.
    control.Environment.register(DmEnvironment)
    env = DMControlWrapper(vibes.make_dm(size=32, action_repeat=100, observation="both"))
    check_env_specs(env)
    rollout = env.rollout(25, break_when_any_done=False)
    assert rollout["pixels"].shape == (25, 32, 32, 3) and rollout["pixels"].dtype == torch.uint8
    assert rollout["to_target"].shape == (25, 2) and rollout["next", "reward"].shape == (25, 1)
    assert rollout["next", "done"].sum() == 2, "episodes of ten steps"


def test_a_copy_of_a_column_can_be_changed(sample):
    """The column itself is the file, and changing it would end the process: docs/python.md says how to copy it."""
    import torch

    episode = vibes.open(sample)[0]
    before = episode.reward.copy()
    torch.tensor(episode.reward).mul_(0.5)
    np.testing.assert_array_equal(episode.reward, before)


def test_pytorch_loads_windows(sample):
    import torch
    from torch.utils.data import DataLoader

    recording = vibes.open(sample)
    dataset = recording.dataset(length=5)
    loader = DataLoader(dataset, batch_size=8, shuffle=True, num_workers=2)
    batches = list(loader)
    assert sum(len(batch["reward"]) for batch in batches) == len(dataset)
    assert batches[0]["pixels"].dtype == torch.uint8 and batches[0]["pixels"].shape[:2] == (8, 5)
    windows = recording.windows(length=5, batch=4, seed=1)
    loaded = list(DataLoader(windows, batch_size=None, sampler=range(3), num_workers=2))
    for update, batch in enumerate(loaded):
        np.testing.assert_array_equal(batch["pixels"].numpy(), windows[update]["pixels"])
