"""The table of agents: scores by hand, rows that are kept, and every agent once."""

import json
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from click.testing import CliRunner

from posefit_experiments.agents import experiment
from posefit_experiments.agents.constants import arms, bandit, evolved, setting_policy
from posefit_experiments.agents.design import TASKS, Training, agent_turns
from posefit_experiments.agents.learners import trained
from posefit_experiments.agents.tables import agent_tables, agents_lines, normalised, score_interval
from posefit_experiments.commands.measurements import agents_command


def test_a_score_is_0_at_random_search_and_1_at_what_is_best_known() -> None:
    chance, best = np.array([10.0, 20.0, 5.0]), np.array([0.0, 10.0, 5.0])
    # by hand: (10 - 5) / 10 and (20 - 25) / 10; the third instance has no room between the two
    np.testing.assert_allclose(normalised(np.array([[5.0, 25.0, 5.0]]), chance, best), [[0.5, -0.5]])
    np.testing.assert_allclose(normalised(np.stack([chance, best]), chance, best), [[0.0, 0.0], [1.0, 1.0]])
    with pytest.raises(ValueError, match="best known must lie below random search, got none of 1 instances"):
        normalised(np.ones((1, 1)), np.ones(1), np.ones(1))


def test_an_interval_holds_the_mean_and_shrinks_where_everything_agrees() -> None:
    scores = np.random.default_rng(0).normal(0.5, 0.1, (5, 40))
    low, high = score_interval(scores)
    assert low < scores.mean() < high
    # seeds and instances are drawn anew, so it is at least as wide as of 200 independent scores: 2 * 1.96 * 0.1 / 14.1
    assert high - low > 0.027
    assert score_interval(np.full((5, 40), 0.5)) == (0.5, 0.5)


def test_random_search_is_always_there_to_be_compared_with() -> None:
    turns = agent_turns(("fit",), ("ppo",), 2, 300, 4)
    assert [(turn.agent, turn.seed, turn.steps) for turn in turns] == [
        ("random search", 0, 0),
        ("ppo", 0, 300),
        ("random search", 1, 0),
        ("ppo", 1, 300),
    ]


class Slope:
    """An environment of one step, whose reward is -|a - 0.5|, where an episode is a reset and a step."""

    action_space = type("Box", (), {"shape": (10,)})

    def reset(self, *, seed: Any, options: Any) -> Any:
        return np.zeros(1), {}

    def step(self, action: Any) -> Any:
        return np.zeros(1), -float(np.abs(action - 0.5).sum()), True, False, {}


def test_cma_over_constants_walks_up_a_slope() -> None:
    looks: list[int] = []
    policy = evolved("configure", Slope(), 1, 8010, 0, lambda steps, policy: looks.append(steps))
    np.testing.assert_allclose(policy(None, 0), 0.5, atol=0.02)
    # generations of 10 settings, 4 episodes each: 4 + 3 ln 10 is 10.9
    assert looks == list(range(40, 8001, 40))


def test_without_steps_for_a_generation_cma_over_constants_is_the_middle() -> None:
    policy = evolved("configure", Slope(), 1, 39, 0, lambda steps, policy: pytest.fail("nothing was learned"))
    np.testing.assert_array_equal(policy(None, 0), np.zeros(10))


@pytest.mark.parametrize(
    ("task", "agent", "asked", "taken"),
    [
        ("configure", "bandit", 20_000, 19_992),  # 1,666 episodes of 12 steps
        ("configure", "bandit", 5, 12),  # one is always tried
        ("configure", "cma over constants", 20_000, 19_680),  # 41 generations of 10 * 4 * 12
        ("configure", "cma over constants", 300, 0),
        ("fit", "cma over constants", 20_000, 19_104),  # 4 generations of 6 * 4 * 199: 4 + 3 ln 2 is 6.1
        ("fit", "ppo", 20_000, 20_480),  # 10 rollouts of 2,048
        ("fit", "sac", 20_000, 20_000),
        ("fit", "gaussian", 0, 0),
    ],
)
def test_a_table_says_the_steps_that_are_taken_of_those_asked_for(
    task: str, agent: str, asked: int, taken: int
) -> None:
    assert experiment.steps_taken(Training(task, agent, 0, asked, 1)) == taken


@pytest.mark.slow
@pytest.mark.parametrize(("agent", "asked"), [("ppo", 100), ("sac", 120)])
def test_learners_take_as_many_steps_as_is_said(agent: str, asked: int) -> None:
    pytest.importorskip("stable_baselines3", reason="needs posefit[rl]")
    looks: list[int] = []
    env = gym.make("Pendulum-v1")
    trained(agent, env, asked, 0, True, lambda steps, policy: looks.append(steps))
    assert looks[-1] == experiment.steps_taken(Training("fit", agent, 0, asked, 1))


def test_a_curve_ends_with_what_was_learned_in_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    def learn(task: str, env: Any, length: int, steps: int, seed: int, look: Any) -> Any:
        for done in range(480, steps + 1, 480):
            look(done, None)

    monkeypatch.setattr(experiment, "evolved", learn)
    monkeypatch.setattr(experiment, "_costs", lambda turn, policy, numbers: [1.0] * len(numbers))
    row = experiment.agent_row(Training("configure", "cma over constants", 0, 1000, 2))
    assert row["curve"] == [[480, [1.0, 1.0]], [960, [1.0, 1.0]]]


def test_the_bandit_finds_the_arm_that_pays_most() -> None:
    class Best(Slope):
        def step(self, action: Any) -> Any:
            return np.zeros(1), -float(np.abs(action - arms("configure")[7]).sum()), True, False, {}

    policy = bandit("configure", Best(), 1, 100, 0, lambda steps, policy: None)
    np.testing.assert_array_equal(policy(None, 0), arms("configure")[7])


def test_a_setting_of_fit_goes_from_its_first_number_to_its_second() -> None:
    policy = setting_policy("fit", np.array([1.0, -1.0]), np.random.default_rng(0), 10, 100)
    assert [policy(None, step)[-1] for step in (0, 50, 100)] == [1.0, 0.0, -1.0]


def test_rows_are_kept_and_go_on(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "rows.jsonl"
    asked: dict[str, Any] = {"environments": ("fit",), "names": ("gaussian",), "seeds": 2, "steps": 100}
    asked |= {"instances": 2, "quick": False, "rows": str(path), "workers": 1}
    measured: list[Training] = []

    def row(turn: Training) -> dict[str, Any]:
        measured.append(turn)
        return turn._asdict() | {"curve": [], "costs": [turn.seed + 10.0 * len(turn.agent)] * 2, "minutes": 0.0}

    def here(jobs: Any, workers: Any, progress: Any) -> Any:
        return dict(progress(((key, job()) for key, job in jobs.items()), len(jobs)))

    monkeypatch.setattr(experiment, "agent_row", row)
    monkeypatch.setattr(experiment, "each", here)
    first = experiment.agents(**asked)
    assert len(measured) == len(path.read_text().splitlines()) == 5  # two agents, two seeds, and what is best known
    path.write_text("".join(f"{line}\n" for line in path.read_text().splitlines()[:3]))
    again = experiment.agents(**asked)
    assert len(measured) == 7
    assert again == first
    assert first["tables"]["fit"][0]["agent"] == "random search"


@pytest.mark.slow
def test_every_reference_and_learner_but_ppo_gives_a_row() -> None:
    # PPO takes 2,048 steps at least; a test of its own says how many it takes
    pytest.importorskip("stable_baselines3", reason="needs posefit[rl]")
    for task in TASKS.values():
        name = next(key for key, one in TASKS.items() if one is task)
        for agent in (*task.references, *(one for one in task.learners if one != "ppo")):
            row = experiment.agent_row(Training(name, agent, 0, 24 if agent in task.learners else 0, 1))
            assert len(row["costs"]) == 1
            assert 0.0 <= row["costs"][0] < 40.0
            json.dumps(row)


def test_the_lines_say_scores_and_curves() -> None:
    rows = [
        Training("fit", "random search", 0, 0, 2)._asdict()
        | {"costs": [10.0, 20.0], "curve": [], "minutes": 0.1, "taken": 0},
        Training("fit", "ppo", 0, 50, 2)._asdict()
        | {"costs": [5.0, 10.0], "curve": [[50, [5.0, 10.0]]], "minutes": 1.0, "taken": 2048},
        Training("fit", "best known", 0, 0, 2)._asdict()
        | {"costs": [0.0, 0.0], "curve": [], "minutes": 0.1, "taken": 0},
    ]
    lines = list(agents_lines({"instances": 2} | agent_tables(rows)))
    assert "| ppo | 2048 | 1 | 0.500 | 0.500 to 0.500 | 7.50 | 7.50 | 1.0 |" in lines
    assert "ppo learns: 50: 0.50 (0.50 to 0.50)" in lines


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--environment", "walk"], "environment must be one of configure, fit, got 'walk'"),
        (["--agent", "dqn"], "agent must be one of random search, .*, got 'dqn'"),
        (["--seeds", "0"], "seeds must be at least 1, got 0"),
        (["--steps", "0"], "steps must be at least 1, got 0"),
        (["--instances", "10001"], "instances must be at most 10000, got 10001"),
    ],
)
def test_what_makes_no_sense_is_named_before_anything_is_measured(arguments: list[str], message: str) -> None:
    ran = CliRunner().invoke(agents_command, arguments)
    with pytest.raises(ValueError, match=message):
        raise ran.exception or AssertionError(ran.output)


ROW: dict[str, Any] = Training("fit", "random actions", 0, 0, 2)._asdict()
ROW |= {"costs": [1.0, 2.0], "curve": [[0, [3.0, 4.0]]], "minutes": 0.1}


@pytest.mark.parametrize(
    "row",
    [
        {"task": "fit"},
        *({name: value for name, value in ROW.items() if name != left} for left in ("costs", "curve", "minutes")),
        ROW | {"costs": [1.0]},
        ROW | {"costs": ["1.0", "2.0"]},
        ROW | {"curve": [[0, [3.0]]]},
        ROW | {"curve": [0]},
        ROW | {"minutes": None},
    ],
)
def test_a_file_that_holds_no_rows_is_refused_before_anything_is_measured(
    tmp_path: Any, monkeypatch: pytest.MonkeyPatch, row: Any
) -> None:
    path = tmp_path / "rows.jsonl"
    path.write_text(f"{json.dumps(ROW)}\n{json.dumps(row)}\n")
    monkeypatch.setattr(experiment, "each", None)
    wanted = "line 2 must be a row with task, agent, seed, steps, instances, costs, curve, minutes, got another text"
    with pytest.raises(ValueError, match=wanted):
        experiment.agents((), ("random actions",), 1, 1, 2, False, str(path), 1)


def test_what_is_asked_for_twice_is_a_row_once(monkeypatch: pytest.MonkeyPatch) -> None:
    def each(jobs: Any, workers: Any, progress: Any) -> Any:
        return {
            turn: turn._asdict() | {"costs": [float(len(turn.agent))], "curve": [], "minutes": 0.0} for turn in jobs
        }

    monkeypatch.setattr(experiment, "each", each)
    once, twice = (experiment.agents(("fit",) * n, ("gaussian",) * n, 2, 1, 1, False, None, 1) for n in (1, 2))
    assert len(once["rows"]) == 5  # two agents, two seeds, and what is best known
    assert twice == once
