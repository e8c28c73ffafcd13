"""The measures on arrays say what they say elsewhere, and know what was put into the latents."""

import numpy as np
import pytest
import vibes
from conftest import collect, forked
from vibes import measures


def grid(states=6, distractors=5, steps=8, dims=4, state=1.0, distractor=0.0, noise=0.0, seed=0):
    """Latents that are a sum of a state's, a distractor's and noise, with the keys of their rows."""
    rng = np.random.default_rng(seed)
    shape = (states, distractors, steps)
    z = state * rng.normal(size=(states, 1, steps, dims)) + distractor * rng.normal(size=(1, distractors, steps, dims))
    z = z + noise * rng.normal(size=(*shape, dims))
    i, j, t = np.indices(shape)
    keys = {"episode": (i * distractors + j).ravel(), "step": t.ravel(), "state": i.ravel(), "distractor": j.ravel()}
    return measures.Table(z.reshape(-1, dims), **keys), keys


def test_shares_are_those_that_were_put_in():
    pure, _ = grid(noise=1e-3)
    shares = measures.variance_shares(pure)
    assert shares["state_share"]["estimate"] > 0.999
    assert shares["state_share"]["low"] <= shares["state_share"]["estimate"] <= shares["state_share"]["high"]
    even, _ = grid(states=40, distractors=40, distractor=1.0)
    shares = measures.variance_shares(even)
    assert all(shares[name]["estimate"] == pytest.approx(0.5, abs=0.05) for name in ["state_share", "distractor_share"])
    assert sum(shares[name]["estimate"] for name in ["state_share", "distractor_share", "interaction_share"]) == pytest.approx(1)


@pytest.mark.parametrize("among", ["same_step", "any_step"])
def test_retrieval_finds_states_and_not_noise(among):
    found = measures.retrieval(grid(noise=1e-3)[0], among=among)[f"retrieval_{among}@1"]
    assert found["estimate"] == 1 and found["chance"] < 0.2
    blind = measures.retrieval(grid(state=0, noise=1)[0], among=among)[f"retrieval_{among}@1"]
    assert blind["estimate"] == pytest.approx(blind["chance"], abs=0.15)


def test_all_numbers_of_a_grid_stand_beside_chance_and_the_control():
    table, keys = grid(noise=0.1)
    control, _ = grid(noise=2.0, seed=1)
    numbers = measures.grid_numbers(table, past_actions=control, k=(1, 3))
    for name in ["retrieval_same_step@1", "retrieval_same_step@3", "retrieval_any_step@1", "state_share", "distractor_share", "denoising_factor", "effective_rank"]:
        assert set(numbers[name]) >= {"estimate", "low", "high", "chance", "past_actions"}, name
    assert numbers["state_share"]["estimate"] > numbers["state_share"]["past_actions"]["estimate"]


def test_a_number_alone_has_the_name_and_value_that_it_has_among_all():
    table, _ = grid(noise=0.1, distractor=0.3)
    alone = measures.variance_shares(table) | measures.retrieval(table, k=3) | measures.retrieval(table, among="any_step", k=3)
    numbers = measures.grid_numbers(table, k=(3,))
    assert set(numbers) - set(alone) == {"denoising_factor", "effective_rank"} and set(alone) - set(numbers) == {"by_step", "queries"}
    for name in set(numbers) & set(alone):
        assert alone[name] == numbers[name], name
    assert measures.denoising_factor(table).items() <= numbers["denoising_factor"].items()


def test_neighbours_are_those_of_brute_force():
    rng = np.random.default_rng(0)
    z = rng.normal(size=(300, 7)).astype(np.float32) * [1, 2, 3, 4, 5, 6, 7]
    episode, step = np.divmod(np.arange(300), 30)
    found = measures.neighbours(measures.Table(z, episode=episode, step=step), [5, 77], k=4)
    scaled = z.astype(float) / z.astype(float).std(0)
    for query, rows, distances in zip([5, 77], found["rows"], found["distances"]):
        distance = np.linalg.norm(scaled - scaled[query], axis=1)
        distance[episode == episode[query]] = np.inf
        expected = np.argsort(distance)[:4]
        np.testing.assert_array_equal(rows, expected)
        np.testing.assert_allclose(distances, distance[expected], rtol=1e-5)


def test_neighbours_leave_out_what_they_are_told_to():
    table, keys = grid(noise=1e-3)
    trajectory, state, row = (measures.neighbours(table, [9], k=3, exclude=exclude)["rows"][0] for exclude in ("trajectory", "state", "row"))
    assert 9 not in row and keys["state"][row].tolist() == [0, 0, 0]
    assert keys["state"][trajectory].tolist() == [0, 0, 0] and keys["episode"][9] not in keys["episode"][trajectory]
    assert 0 not in keys["state"][state]


def test_probes_read_what_is_there():
    table, keys = grid(states=10, noise=0.01, dims=3)
    rng = np.random.default_rng(3)
    read = table.latents[:, 0] * 2.0 + 1
    scores = measures.probes(table, {"linear": read.astype(float), "noise": rng.normal(size=len(read)), "video": keys["distractor"] % 2}, hold_out={"video": "state"})
    by_name = {(score["quantity"], score["probe"]): score for score in scores}
    assert by_name["linear", "linear"]["score"]["estimate"] > 0.99 and by_name["linear", "linear"]["measure"] == "R²"
    assert by_name["noise", "linear"]["score"]["estimate"] < 0.1
    assert by_name["video", "linear"]["measure"] == "accuracy" and by_name["video", "linear"]["score"]["estimate"] < 0.75
    other, _ = grid(states=12, noise=0.01, dims=3, seed=5)
    fitted = measures.probes(table, {"linear": read.astype(float)}, fit_on=(other, {"linear": other.latents[:, 0] * 2.0 + 1}))
    assert fitted[0]["score"]["estimate"] > 0.99


def test_shuffled_columns_of_the_distractors_are_not_their_own():
    """As ``vibes-analyze probe --target`` has them: another state's cells hold the same values in the same order."""
    _, keys = grid(states=8, distractors=6)
    rng = np.random.default_rng(5)
    shade = rng.normal(size=6)[keys["distractor"]]
    table = measures.Table(shade[:, None] * [1.0, -2.0, 0.5] + 0.01 * rng.normal(size=(len(shade), 3)), **keys)
    for fit_on in (None, (table, {"shade": shade})):
        for score in measures.probes(table, {"shade": shade}, fit_on=fit_on):
            assert score["score"]["estimate"] > 0.95 and score["shuffled"]["estimate"] < 0.6, score


def test_a_map_is_the_same_for_the_same_seed_and_keeps_neighbours():
    rng = np.random.default_rng(0)
    centres = rng.normal(size=(4, 10)) * 10
    label = np.repeat(np.arange(4), 60)
    table = measures.Table(centres[label] + rng.normal(size=(240, 10)), episode=label, step=np.tile(np.arange(60), 4))
    one, two = measures.umap(table, seed=1, epochs=100), measures.umap(table, seed=1, epochs=100)
    np.testing.assert_array_equal(one["positions"], two["positions"])
    assert one["positions"].shape == (240, 2) and one["trustworthiness"] > 0.9
    means = np.stack([one["positions"][label == i].mean(0) for i in range(4)])
    spread = max(one["positions"][label == i].std(0).max() for i in range(4))
    assert min(np.linalg.norm(means[i] - means[j]) for i in range(4) for j in range(i)) > spread


def test_a_map_takes_latents_as_they_are_unless_told_otherwise():
    """As ``vibes-analyze umap`` does, so that both draw the same neighbours."""
    rng = np.random.default_rng(0)
    table = measures.Table(rng.normal(size=(80, 3)) * [1, 10, 100], episode=np.repeat(np.arange(4), 20), step=np.tile(np.arange(20), 4))
    told = [{}, {"metric": "euclidean"}, {"metric": "standardized"}]
    unless_told, euclidean, standardized = (measures.umap(table, seed=1, epochs=20, **metric)["positions"] for metric in told)
    np.testing.assert_array_equal(unless_told, euclidean)
    assert not np.array_equal(unless_told, standardized)


def test_the_effective_rank_is_of_all_rows_and_that_of_a_grid_of_its_complete_part():
    def of_grid(table):
        return measures.grid_numbers(table, k=(1,))["effective_rank"]["estimate"]

    table, keys = grid(noise=0.1)
    rank = measures.effective_rank(table)["effective_rank"]
    assert isinstance(rank, float) and rank == pytest.approx(of_grid(table))
    # Without one cell the grid lacks its state, and the table no row.
    state = np.where((keys["state"] == 5) & (keys["distractor"] == 4), -1, keys["state"])
    holed = measures.Table(table.latents, **{**keys, "state": state})
    assert measures.effective_rank(holed)["effective_rank"] == rank
    assert of_grid(holed) != pytest.approx(rank)


def test_symmetry_of_reacher():
    rng = np.random.default_rng(0)
    episode, step = np.divmod(np.arange(400), 20)
    base = rng.uniform(-1, 1, (200, 3))
    turn = rng.uniform(1, 3, 200)
    shoulder = np.concatenate([base[:, 0], base[:, 0] + turn])
    wrist = np.tile(base[:, 1], 2)
    angle = np.concatenate([base[:, 2], base[:, 2] + turn])
    target = 0.15 * np.stack([np.cos(angle), np.sin(angle)], 1)
    relative = angle - shoulder
    pixels = np.stack([np.cos(shoulder), np.sin(shoulder), *target.T * 5], 1)
    symmetric = measures.Table(np.stack([np.cos(relative), np.sin(relative), wrist], 1), episode=episode, step=step)
    found = measures.symmetry(symmetric, np.stack([shoulder, wrist], 1), target, pixels)
    assert found["symmetry_ratio"]["estimate"] < 0.2 and found["symmetry_percentile"]["estimate"] > 0.9 and len(found["pairs"]) > 100
    assert found["symmetry_ratio"]["chance"] == 1 and found["symmetry_percentile_equal_distance"]["chance"] == 0.5
    not_so = measures.Table(pixels, episode=episode, step=step)
    assert measures.symmetry(not_so, np.stack([shoulder, wrist], 1), target, pixels)["symmetry_ratio"]["estimate"] > 0.5


def test_rows_of_a_recording_are_its_keys(sample):
    recording = vibes.open(sample)
    observation = np.concatenate([episode.observation for episode in recording])
    table = measures.Table(observation, recording=recording)
    assert len(table) == sum(episode.steps + 1 for episode in recording)
    shares = measures.variance_shares(table)
    assert shares["state_share"]["estimate"] == pytest.approx(1) and shares["distractor_share"]["estimate"] == pytest.approx(0, abs=1e-6)
    control = measures.past_actions_table(recording)
    assert len(control) == len(table)
    numbers = measures.grid_numbers(table, past_actions=control, k=[1])
    assert numbers["retrieval_same_step@1"]["estimate"] == 1


def test_the_child_of_a_fork_measures_too():
    """Rayon's threads stay in the parent; the child starts its own, and so does a child of it."""
    table, _ = grid(noise=0.3)

    def measured():
        return measures.umap(table, epochs=20)["positions"].tolist(), measures.variance_shares(table)["state_share"]["estimate"]

    here = measured()
    assert forked(measured) == here
    assert forked(lambda: (measured(), forked(measured))) == (here, here)


def test_latents_may_lie_in_any_order_in_memory():
    table, keys = grid(noise=0.3)
    columns = measures.Table(np.asfortranarray(table.latents), **keys)
    backwards = measures.Table(np.ascontiguousarray(table.latents[::-1])[::-1], **keys)
    for other in (columns, backwards):
        assert measures.variance_shares(other) == measures.variance_shares(table)
        # Laid out by numpy, which lets other threads of Python run meanwhile, and not number by number by the extension, which does not.
        assert other.latents.flags.c_contiguous


def test_views_within_a_recording_are_held_out_together(recorded, tmp_path):
    """As ``vibes-analyze probe`` has them: ``vibes-collect merge`` leaves views without cells, and the same actions are the same trajectory."""
    one = recorded("--episodes", "4", "--steps", "8", "--size", "16", "--seed", "3")
    collect("render", one, "--size", "16", "--distract", "none", "--no-mcap", "--quiet", "-o", tmp_path / "again")
    collect("merge", one, tmp_path / "again", "--quiet", "-o", tmp_path / "merged")
    groups = {}
    for name, path in [("one", one), ("merged", tmp_path / "merged")]:
        recording = vibes.open(path)
        observation = np.concatenate([episode.observation for episode in recording])
        table = measures.Table(observation, recording=recording)
        scores = measures.probes(table, {"angle": observation[:, 0]}, folds=2)
        groups[name] = {score["groups"] for score in scores}
    assert len(vibes.open(tmp_path / "merged")) == 8
    assert groups == {"one": {4}, "merged": {4}}


def test_what_probes_are_fitted_on_is_found_by_name():
    table, _ = grid(states=10, noise=0.01, dims=3)
    one, two = (table.latents[:, place].astype(float) for place in (0, 1))
    judged = {"one": one, "two": two}
    for theirs in (judged, {"two": two, "one": one}):
        scores = measures.probes(table, judged, fit_on=(table, theirs))
        assert [score["quantity"] for score in scores] == ["one", "two"] * 2
        assert all(score["score"]["estimate"] > 0.9 for score in scores), "its own column, whatever the order"


def test_a_recording_without_a_finished_episode_is_named(tmp_path):
    spec = {"task": "mine", "action_low": [-1, -1], "action_high": [1, 1], "observation": {"x": 2}}
    vibes.Writer(tmp_path / "empty", spec=spec, mcap=False).close()
    recording = vibes.open(tmp_path / "empty")
    assert len(recording) == 0
    for call in (lambda: measures.past_actions_table(recording), lambda: measures.Table(np.zeros((0, 2)), recording=recording), lambda: measures.Table(np.eye(2), recording=recording)):
        with pytest.raises(vibes.Error, match="the recording has no finished episode; right is at least one: .*empty"):
            call()


def test_errors_name_what_would_be_right(sample):
    table, keys = grid()
    recording = vibes.open(sample)
    rows = sum(episode.steps + 1 for episode in recording)
    some, pairs = np.arange(len(table)) * 0.5, np.ones((len(table), 2))
    wrong = [
        (lambda: measures.Table(np.zeros((3, 2)), episode=[0, 0], step=[0, 1]), "expected"),
        (lambda: measures.Table(np.zeros(3), episode=[0], step=[0]), r"\[rows, dims\]"),
        (lambda: measures.Table(np.zeros((5, 2)), recording=recording), rf"latents of 5 rows; the recording has {rows} \({len(recording)} episodes, each with its T \+ 1 rows\)"),
        (lambda: measures.Table(np.zeros((3, 2)), episode=[0, 1, 0], step=[4, 4, 4]), "episode 0, step 4 occurs twice; right is one row for each"),
        (lambda: measures.Table(np.zeros((2, 2)), episode=[0, 0], step=[4, 4], state=[0, 1], distractor=[0, 0]), "occurs twice"),
        (lambda: measures.Table([[np.nan]], episode=[0], step=[0]), "finite"),
        (lambda: measures.Table(np.zeros((0, 2)), episode=np.zeros(0, int), step=np.zeros(0, int)), "found 0"),
        (lambda: measures.Table(np.zeros((1, 2))), "give recording"),
        (lambda: measures.variance_shares(measures.Table(np.eye(4), episode=[0, 0, 1, 1], step=[0, 1, 0, 1])), "state and a distractor"),
        (lambda: measures.retrieval(table, among="some"), "same_step, any_step"),
        (lambda: measures.retrieval(table, k=0), "at least 1"),
        (lambda: measures.neighbours(table, k=10**9), "no more than the rows"),
        (lambda: measures.neighbours(table, [10**6]), "past the table"),
        (lambda: measures.neighbours(table, metric="city"), "standardized, euclidean, cosine"),
        (lambda: measures.neighbours(table, exclude="all"), "trajectory, state, row"),
        (lambda: measures.neighbours(measures.Table(np.eye(4), episode=[0, 0, 1, 1], step=[0, 1, 0, 1]), k=1, exclude="state"), "on no grid"),
        (lambda: measures.probes(table, {"a": np.zeros(3)}), "a"),
        (lambda: measures.probes(table, {"a": np.zeros(len(table))}, hold_out={"b": "state"}), "no quantities"),
        (lambda: measures.umap(table, neighbours=1), "at least 2"),
        (lambda: measures.umap(table, min_dist=-1), "between 0"),
        (lambda: measures.symmetry(table, [[0, 0]], [[0, 0]], [[0]]), "for this table"),
        (lambda: measures.past_actions([1, 2]), r"\[T, action\]"),
        (lambda: measures.past_actions("ab"), r"actions of type <U2; right is numbers \[T, action\]"),
        (lambda: measures.Table("ab", episode=[0], step=[0]), r"latents of type <U2; right is numbers \[rows, dims\]"),
        (lambda: measures.Table(np.eye(2), episode=[0, 0], step=[0, 1], state=[0.5, 0], distractor=[0, 0]), "state of type float64"),
        # A column that is not looked at would be a wrong number silently: without cells, views of one state are apart in the folds of the probes.
        (lambda: measures.Table(np.eye(2), episode=[0, 0], step=[0, 1], state=[0, 0]), "state alone; right is state and distractor"),
        (lambda: measures.Table(np.eye(2), episode=[0, 0], step=[0, 1], distractor=[0, 0]), "distractor alone; right is state and distractor"),
        (lambda: measures.Table(np.zeros((rows, 2)), recording=recording, episode=np.zeros(rows, int)), "recording and episode; .* give one or the other"),
        (lambda: measures.Table(np.zeros((rows, 2)), recording=recording, step=[0]), "recording and step; .* give one or the other"),
        (lambda: measures.Table(np.zeros((rows, 2)), recording=recording, state=[0], distractor=[0]), "recording and state, distractor; .* give one or the other"),
        (lambda: measures.Table(np.eye(2), episode=[0, 0], step=[0, 1], state=[-5, 0], distractor=[0, 0]), "state from -5 to 0; right is whole numbers from 0"),
        (lambda: measures.Table(np.eye(2), episode=[0, 0], step=[0, 1], state=[0, 0], distractor=[0, 2**40]), r"distractor from 0 to [0-9]+; right is whole numbers from 0 to 2\*\*32 - 1"),
        (lambda: measures.probes(table, [some]), "quantities of type list; right is a dictionary"),
        (lambda: measures.probes(table, {1: some, "1": some}), "some have the same name"),
        (lambda: measures.probes(table, {"a": some}, hold_out="state"), "hold_out of type str; right is a dictionary"),
        (lambda: measures.probes(table, {"a": some}, hold_out=0), "hold_out of type int; right is a dictionary"),
        (lambda: measures.probes(table, {"a": some}, hold_out={"a": 3}), "hold_out of a 3; right is a name"),
        (lambda: measures.probes(table, {"a": some}, folds=1), "1 folds; right is at least 2"),
        (lambda: measures.probes(table, {"a": some}, fit_on=table), r"fit_on that is no pair .*right is \(another Table"),
        (lambda: measures.probes(table, {"a": some}, fit_on=(table.latents, {"a": some})), "fit_on that is no pair of a table and quantities"),
        (lambda: measures.probes(table, {"a": some}, fit_on=(table, {"b": some})), r"fit_on with the quantities \['b'\]; right is those that are judged, \['a'\]"),
        (lambda: measures.probes(table, {"a": some}, fit_on=(table, {"a": np.zeros(len(table), int)})), "a holds numbers, and classes in fit_on"),
        (lambda: measures.neighbours(table, metric=3), "metric 3; right is a name"),
        (lambda: measures.neighbours(table, exclude=None), "exclude None; right is a name"),
        (lambda: measures.umap(table, metric=3), "metric 3; right is a name"),
        (lambda: measures.retrieval(table, among=np.array(["same_step", "any_step"])), "choose one of: same_step, any_step"),
        (lambda: measures.past_actions([[0.5], [np.nan]]), "nan in actions; right is finite numbers"),
        (lambda: measures.symmetry(table, pairs, pairs, np.full((len(table), 1), np.inf)), "inf in pixels; right is finite numbers"),
        (lambda: measures.symmetry(table, pairs * np.nan, pairs, np.zeros((len(table), 1))), "nan in joints; right is finite numbers"),
        (lambda: measures.grid_numbers(table, k=5), r"k 5; right is whole numbers"),
        (lambda: measures.retrieval(table, k=0.5), "k 0.5; right is a whole number"),
        (lambda: measures.umap(table, spread="wide"), "spread 'wide'; right is a number"),
    ]
    for call, words in wrong:
        with pytest.raises(vibes.Error, match=words):
            call()
