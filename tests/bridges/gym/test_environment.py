"""Environments: gymnasium's own checker, equal episodes for equal seeds, the bits of a run."""

from __future__ import annotations

import re
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import runtime

gymnasium = pytest.importorskip("gymnasium")
from gymnasium.utils.env_checker import check_env  # noqa: E402
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv  # noqa: E402

import spikeblocks.gym  # noqa: E402
from runtime.graph import open_session  # noqa: E402

BALANCE = "gallery/cart_pole_balance"
ENGINES = ("python", "compiled")
ARM: dict[str, Any] = {
    "graph": "two_inputs",
    "run": {"dt": 0.01, "until": 0.25, "seed": 5},
    "inputs": {
        "push": {"type": "Scalar", "min": -2, "max": 2, "default": 0.0},
        "pull": {"type": "Vector(2)", "min": [-1, -3], "max": [1, 3], "default": 0.0},
    },
    "outputs": {
        "place": {"of": "place.out", "min": -50, "max": 50},
        "noisy": {"of": "sum.out", "min": -50, "max": 50},
    },
    "blocks": {
        "noise": {"type": "WhiteNoise", "density": 0.01},
        "sum": {"type": "Sum"},
        "speed": {"type": "Integrator"},
        "place": {"type": "Integrator", "signal": "Vector(2)", "initial": [0.0, 0.0]},
        "late": {"type": "Function", "expression": "1.0 if t > 0.155 else 0.0"},
    },
    "wires": {
        "sum": {"terms": ["noise.out", "inputs.push"]},
        "speed": {"input": "sum.out"},
        "place": {"input": "inputs.pull"},
    },
    "probes": {"place": "place.out", "speed": "speed.out", "noisy": "sum.out"},
}


def make(graph: Any = ARM, **options: Any) -> Any:
    return spikeblocks.gym.make(graph, **{"reward": "speed.out", **options})


def balance(engine: str = "python", **options: Any) -> Any:
    graph = runtime.load(BALANCE).without("lqr")
    named = {"reward": "reward.out", "terminated": "fallen.out"}
    return make(graph, **{**named, "engine": engine, **options})


def played(env: Any, seed: int | None, steps: int = 12) -> Any:
    """An episode with actions of its own seed, as one row of numbers."""
    rng = np.random.default_rng(9)
    observation, info = env.reset(seed=seed)
    rows = [np.array([*observation, 0.0, 0.0, 0.0, info["t"]])]
    for _ in range(steps):
        space = env.action_space
        observation, reward, terminated, truncated, info = env.step(
            rng.uniform(space.low, space.high)
        )
        rows.append(np.array([*observation, reward, terminated, truncated, info["t"]]))
        if terminated or truncated:
            break
    return np.array(rows)


@pytest.mark.parametrize("as_dict", [False, True])
@pytest.mark.parametrize("engine", ENGINES)
def test_the_checker_of_gymnasium_passes(engine: str, as_dict: bool) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        check_env(balance(engine, as_dict=as_dict))
        check_env(make(engine=engine, as_dict=as_dict))
    # What it advises against: bounds that are infinite or not -1 and 1, no env.spec.
    advice = ("infinity. This is", "symmetric and normalized", "not having a spec")
    said = [str(each.message) for each in caught]
    assert [text for text in said if not any(words in text for words in advice)] == []


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_method_of_stable_baselines3_learns_in_it(engine: str) -> None:
    baselines = pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.env_checker import check_env as accepted

    env = balance(engine)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # what it advises, as gymnasium's checker does
        accepted(env)
    learned = [
        baselines.PPO("MlpPolicy", balance(engine), n_steps=64, seed=1, device="cpu").learn(256)
        for _ in range(2)
    ]
    weights = [each.policy.state_dict() for each in learned]
    # Equal seeds have equal episodes, from which the same is learned.
    assert all(bool((weights[0][key] == weights[1][key]).all()) for key in weights[0])
    observation, _ = env.reset(seed=3)
    action, _ = learned[0].predict(observation, deterministic=True)
    assert env.action_space.contains(action.astype(env.action_space.dtype))


def test_spaces_follow_from_the_ports() -> None:
    env = make()
    assert env.action_space == gymnasium.spaces.Box(
        np.array([-2.0, -1, -3]), np.array([2.0, 1, 3]), dtype=np.float64
    )
    assert env.observation_space.shape == (3,)
    spaces = make(as_dict=True).action_space
    assert {name: space.shape for name, space in spaces.items()} == {"push": (1,), "pull": (2,)}


@pytest.mark.parametrize("engine", ENGINES)
def test_an_episode_has_the_bits_of_a_session(engine: str) -> None:
    env = make(engine=engine, steps=4, info=["place.out.1", "noise.out"])
    session = runtime.load(ARM).session(seed=11, engine=engine)
    env.reset(seed=11)
    rng = np.random.default_rng(2)
    for tick in (4, 8, 12, 16, 20, 24, 25):
        action = rng.uniform(env.action_space.low, env.action_space.high)
        session.write("push", action[0])
        session.write("pull", action[1:])
        session.step(tick - session.tick)
        observation, reward, terminated, truncated, info = env.step(action)
        assert observation.tolist() == [*session.read("place.out"), session.read("sum.out")]
        assert reward == session.read("speed.out")
        assert (terminated, truncated) == (False, tick == 25)
        names = ("place.out.1", "noise.out")
        assert info == {"t": session.t, **{name: session.read(name) for name in names}}
    ours, theirs = env.session.result(), session.result()
    for probe in ours.probes:
        assert np.array_equal(ours[probe], theirs[probe])


@pytest.mark.parametrize("engine", ENGINES)
def test_equal_seeds_give_equal_episodes(engine: str) -> None:
    env, other = balance(engine), balance(engine)
    first = played(env, 3)
    assert not np.array_equal(first, played(env, 4))
    assert np.array_equal(first, played(env, 3))
    assert np.array_equal(first, played(other, 3))
    # What follows without a seed depends on the last one alone.
    again, then = played(env, None), played(other, None)
    assert np.array_equal(again, then)
    assert not np.array_equal(again, first)


def test_actions_and_observations_as_dicts_have_the_same_numbers() -> None:
    env, other = make(), make(as_dict=True)
    env.reset(seed=1)
    other.reset(seed=1)
    row, *_ = env.step(np.array([0.5, -1.0, 2.0]))
    parts, *_ = other.step({"push": np.array([0.5]), "pull": np.array([-1.0, 2.0])})
    assert np.array_equal(row, np.concatenate([parts["place"], parts["noisy"]]))


def test_an_episode_ends_where_it_is_said() -> None:
    env = make(steps=4, terminated="late.out")
    rows = played(env, 1)
    assert rows[:, -3].tolist() == [0, 0, 0, 0, 1] and not rows[:, -2].any()
    # A tick of run.stop is met within a step, and the episode stops there.
    env = make({**ARM, "run": {**ARM["run"], "stop": {"when": "late.out", "above": 0.5}}}, steps=10)
    rows = played(env, 1)
    assert rows[:, -3].tolist() == [0, 0, 1]
    assert rows[-1, -1] < 0.2


def test_rewards_and_ends_as_functions() -> None:
    seen = []

    def reward(observation: Any, action: Any, info: Any) -> float:
        seen.append((observation.copy(), action, info["speed.out"]))
        return float(-(observation**2).sum() - action[0])

    env = make(reward=reward, terminated=lambda o, a, i: i["t"] > 0.15, info=["speed.out"])
    env.reset(seed=1)
    action = np.array([1.0, 0.5, 0.5])
    observation, got, terminated, *_ = env.step(action)
    assert got == -(observation**2).sum() - 1.0 and not terminated
    assert env.step(action)[2] is True
    assert len(seen) == 2


def test_what_differs_in_an_episode() -> None:
    def start(rng: np.random.Generator) -> dict[str, Any]:
        return {"place.initial": rng.uniform(-1, 1, 2), "noise.density": rng.uniform(0, 0.1)}

    env = make(start=start)
    expected = start(np.random.default_rng(7))["place.initial"]
    for _ in range(2):
        observation, _ = env.reset(seed=7)
        assert np.array_equal(observation[:2], expected)
    observation, _ = env.reset(seed=7, options={"place.initial": [3.0, 4.0]})
    assert observation[:2].tolist() == [3.0, 4.0]
    assert np.array_equal(env.reset(seed=7)[0][:2], expected)
    assert np.array_equal(played(env, 8), played(make(start=start), 8))
    with pytest.raises(runtime.GraphError, match="did you mean 'place'"):
        env.reset(options={"plce.initial": [0.0, 0.0]})


# Python 3.12 warns of a fork while threads of the numerical libraries run.
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
@pytest.mark.parametrize("kind", [SyncVectorEnv, AsyncVectorEnv])
def test_vectors_of_environments(kind: Any) -> None:
    env = kind([partial(balance), partial(balance)])
    rng, rows = np.random.default_rng(9), []
    try:
        rows.append(env.reset(seed=[3, 4])[0])
        for _ in range(3):
            action = rng.uniform(-10, 10, (1,))
            rows.append(env.step(np.stack([action, action]))[0])
    finally:
        env.close()
    for index, seed in enumerate((3, 4)):
        alone = played(balance(), seed, 3)[:, :4]
        assert np.array_equal(np.array(rows)[:, index], alone)


def test_the_registered_name() -> None:
    named = {"graph": BALANCE, "reward": "reward.out", "terminated": "fallen.out"}
    env = gymnasium.make("spikeblocks.gym:spikeblocks/Graph-v0", **named)
    assert np.array_equal(played(env, 3), played(make(**named), 3))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"reward": "speed.ot"}, "has no output or state 'ot', did you mean 'out'"),
        ({"reward": "place.out"}, r"reward: 'place.out' has 2 numbers; name one, .* place.out.0"),
        ({"terminated": "place.out"}, "terminated: 'place.out' has 2 numbers"),
        ({"info": ["sped.out"]}, "did you mean 'speed'"),
        ({"steps": 0}, "steps: expected a whole number of at least 1 tick, got 0"),
        ({"steps": 2.5}, "steps: expected a whole number of at least 1 tick, got 2.5"),
        ({"reward": None}, "reward: expected an address or a function, got None"),
        ({"start": lambda rng: 5}, "start: expected values by their addresses, .* got 5"),
    ],
)
def test_what_is_wrong_with_an_environment(options: dict[str, Any], message: str) -> None:
    with pytest.raises(runtime.UsageError, match=message):
        make(**options)


@pytest.mark.parametrize("section", ["inputs", "outputs"])
def test_a_graph_without_ports(section: str) -> None:
    bare = {key: value for key, value in ARM.items() if key != section}
    if section == "inputs":
        bare["wires"] = {"sum": {"terms": "noise.out"}, "speed": {"input": "sum.out"}}
        bare["blocks"] = {name: ARM["blocks"][name] for name in ("noise", "sum", "speed")}
        bare |= {"outputs": {"noisy": "sum.out"}, "probes": {}}
    with pytest.raises(runtime.UsageError, match=f"has no section '{section}'"):
        make(bare)


def test_what_is_wrong_with_an_action() -> None:
    env = make()
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(3))
    env.reset(seed=1)
    for action, message in (
        (np.zeros(2), r"expected an action of shape \(3,\): push, pull; got shape \(2,\)"),
        (np.array([0.0, 2.0, 0.0]), r"'pull\[0\]': expected at most 1, got 2"),
        (np.array([np.nan, 0.0, 0.0]), "'push': expected a finite number"),
        ("left", "expected an action of numbers, got 'left'"),
    ):
        with pytest.raises(runtime.UsageError, match=message):
            env.step(action)
    other = make(as_dict=True)
    other.reset(seed=1)
    with pytest.raises(runtime.UsageError, match="expected an action with push, pull"):
        other.step({"push": np.zeros(1)})
    with pytest.raises(runtime.UsageError, match=r"'pull': expected an action of shape \(2,\)"):
        other.step({"push": np.zeros(1), "pull": np.zeros(3)})


def test_what_is_wrong_with_a_reward() -> None:
    env = make(reward=lambda *_: None)
    env.reset(seed=1)
    with pytest.raises(runtime.UsageError, match="reward: expected a number, got None"):
        env.step(np.zeros(3))
    with pytest.raises(runtime.UsageError, match="options: expected values by their addresses"):
        env.reset(options=[1])


@pytest.mark.parametrize("engine", ENGINES)
def test_an_episode_is_a_session_that_replays(engine: str, tmp_path: Path) -> None:
    env = balance(engine)
    env.reset(seed=1)
    assert played(env, 6).shape[0] > 5
    again = open_session(env.session.save(tmp_path / "episode"))
    ours, theirs = env.session.result(), again.result()
    for probe in ours.probes:
        assert np.array_equal(ours[probe], theirs[probe])
    assert ours["position"].shape == (env.session.tick,)


def test_an_episode_that_failed_can_begin_again() -> None:
    graph = {**ARM, "blocks": {**ARM["blocks"], "bad": {"type": "Function"}}}
    graph["blocks"]["bad"]["expression"] = "sqrt(1.0 - u[0])"
    graph["wires"] = {**ARM["wires"], "bad": {"u": "place.out.0"}}
    graph["probes"] = {"bad": "bad.out"}
    env = make({**graph, "run": {**ARM["run"], "until": 9.0}}, steps=400)
    env.reset(seed=1)
    with pytest.raises(runtime.SimulationError, match="block 'bad'"):
        env.step(np.array([0.0, 1.0, 0.0]))
    assert env.reset(seed=1)[0][0] == 0.0
    assert env.step(np.zeros(3))[4]["t"] == pytest.approx(4.0)


@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_the_python_of_the_page_runs() -> None:
    page = (Path(runtime.PACKAGE) / "docs" / "gym.md").read_text(encoding="utf-8")
    first, vector = re.findall(r"```python\n(.*?)```", page, re.S)
    space: dict[str, Any] = {}
    exec(first, space)
    assert space["info"]["t"] == pytest.approx(2.0) and not space["terminated"]
    exec(vector, space)
    try:
        assert space["envs"].reset(seed=3)[0].shape == (4, 4)
    finally:
        space["envs"].close()
