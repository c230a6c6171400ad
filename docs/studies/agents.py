"""Are observations worth it? FitImage-v1 by blind searches, cloning and PPO.

    python docs/studies/agents.py --rows agents.jsonl --picture agents.png

All are tested on held-out instances. A learner's row is one training: of
Stable-Baselines3's PPO, or on the truths of training instances. A search's row has
every instance once. There is a table for each level.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from time import process_time
from typing import Any, NamedTuple

import click
import gymnasium as gym
import numpy as np
from gymnasium.wrappers.vector import ResizeObservation, TransformObservation

from posefit import Problem, minimise
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.errors import InputError
from posefit.fitting.box import Space, Start
from posefit.registry import registry
from posefit.settings import planned
from posefit_envs import to_sb3_vec_env
from posefit_envs.fit import MAX_EVALUATIONS
from table import WORKERS, drawn_means, keyed, markdown, measured, quantiles

HELD_OUT = 10_000  # the first instance of the test split
INSTANCES = 200
SEEDS = 3
STEPS = 270_000
TESTED = list(range(HELD_OUT, HELD_OUT + INSTANCES))
LEVELS = {
    "easy": "FitImage-easy-v1",
    "default": "FitImage-v1",
    "medium": "FitImage-medium-v1",
    "hard": "FitImage-hard-v1",
}
BUDGETS = (8, 40, 200, 800, 2440)  # evaluations of blind searches
SEARCHES = ("sapso", "cma")
# what learns nothing: the k-th proposal of the look-up is the truth of the training
# instance whose silhouette is the k-th nearest
LOOK_UP = "look-up"
CONSTANTS = ("uniform", "the truth, projected", LOOK_UP)
LOOKED_UP = 10_000  # training instances
LOOKED_UP_AT_ONCE = 500
# taught on silhouettes that the environment draws; see pose_network.py
POSING = "pose network"
POSING_STEPS = 240_000
POSING_ENVIRONMENTS = 256
LEARNERS = ("PPO, blank", "cloning", "PPO", "cloning, then PPO", POSING)
# CMA-ES, started from the best of PPO's proposals
STARTED = "PPO, then cma"
STARTED_BUDGET = 200
STARTED_SPREAD = 0.1
ENVIRONMENTS = 64
ROLLOUT = 16
BATCH = 256
EPOCHS = 6
LEARNING_RATE = 1.5e-3
LOG_DEVIATION = -1.6
SHOWN = (12, 16)  # height and width of the networks' pictures
NETWORKS: dict[str, list[int]] = {"pi": [384, 128], "vf": [128]}  # hidden layers
# steps of cloning before PPO continues, and the narrower deviation with which it does
CLONING_STEPS = 30_720
CLONED_LOG_DEVIATION = -2.3
LEARNING = {"cloning": CLONING_STEPS, POSING: POSING_STEPS}
WHITE = (255, 255, 255)

# of small pictures (n, 12, 16, 2 views), and the costs (n,) of the last proposals
Policy = Callable[[Any, Array], Array]


class Training(NamedTuple):
    """The key of a row.

    `budget` is the steps of a training, or the evaluations of a search.
    """

    level: str
    agent: str
    budget: int
    seed: int


def check_learners() -> None:
    """Raise ImportError if Stable-Baselines3, which PPO needs, is not installed."""
    if find_spec("stable_baselines3") is None:
        raise ImportError("ppo and sac need Stable-Baselines3: pip install posefit[rl]")


def name_of(level: str) -> str:
    """Return the name of a level's environment."""
    return f"posefit_envs:posefit/{LEVELS[level]}"


def made(training: Training, count: int, **arguments: Any) -> Any:
    """Return a vector environment of a level with small pictures.

    For a blank agent the observed silhouettes are blank.
    """
    env = ResizeObservation(
        gym.make_vec(name_of(training.level), count, **arguments), SHOWN
    )
    channels = np.arange(env.single_observation_space.shape[-1])
    channels_shown = np.ones_like(channels)
    if "blank" in training.agent:
        channels_shown = channels % 2
    mask = channels_shown.astype(np.uint8)
    return TransformObservation(env, lambda pictures: pictures * mask)


def episodes(policy: Policy, training: Training, proposals: int) -> tuple[Array, Array]:
    """Return actions (k, n, d) and costs (k, n) of an episode on each test instance."""
    env = made(training, INSTANCES, split="test", max_evaluations=proposals)
    pictures, infos = env.reset(seed=0, options={"instance": TESTED})
    actions = []
    costs = []
    for _ in range(proposals):
        actions.append(np.clip(policy(pictures, infos["cost"]), -1.0, 1.0))
        pictures, _, _, _, infos = env.step(actions[-1])
        costs.append(infos["cost"])
    return np.array(actions), np.array(costs)


def row_of(
    training: Training, start: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Return a row: best costs on held-out instances, proposals, CPU seconds."""
    start_time = process_time()
    row = training._asdict()
    if training.agent in (*SEARCHES, STARTED):
        row["costs"] = searched(training, start)
        return row | {"cpu_seconds": round(process_time() - start_time, 1)}
    learns = training.agent in LEARNERS
    if learns:
        policy = trained(training)
    elif training.agent == LOOK_UP:
        policy = looked_up(training)
    else:
        policy = constant(training)
    row["cpu_seconds"] = round(process_time() - start_time, 1)
    several = learns or training.agent in ("uniform", LOOK_UP)
    count = MAX_EVALUATIONS if several else 1
    actions, costs = episodes(policy, training, count)
    row["costs"] = costs.min(axis=0).tolist()
    if learns:
        row |= {
            "proposals": actions.round(4).tolist(),
            "proposal_costs": costs.round(2).tolist(),
        }
    return row


def constant(training: Training) -> Policy:
    """Return the policy of a reference that ignores its observations."""
    rng = np.random.default_rng(training.seed)
    env = made(training, INSTANCES, split="test")
    if training.agent == "uniform":
        return lambda *_: rng.uniform(-1.0, 1.0, env.action_space.shape)
    env.reset(options={"instance": TESTED})
    truths = np.array([problem.truth for problem in env.unwrapped.problems])
    return lambda *_: truths


def looked_up(training: Training) -> Policy:
    """Return a policy that proposes the truths of the nearest training silhouettes."""
    env = made(training, LOOKED_UP_AT_ONCE)
    silhouettes = []
    truths = []
    for first in range(0, LOOKED_UP, LOOKED_UP_AT_ONCE):
        numbers = list(range(first, first + LOOKED_UP_AT_ONCE))
        pictures, _ = env.reset(options={"instance": numbers})
        silhouettes.append(observed(pictures))
        truths.append([problem.truth for problem in env.unwrapped.problems])
    known = np.concatenate(silhouettes)
    answers = np.concatenate(truths)
    asked = 0

    def policy(pictures: Any, _: Array) -> Array:
        nonlocal asked
        seen = observed(pictures)
        squares = (seen**2).sum(axis=1)[:, None] - 2.0 * seen @ known.T
        squares += (known**2).sum(axis=1)
        nearest = np.argpartition(squares, asked, axis=1)[:, asked]
        asked += 1
        return answers[nearest]

    return policy


def observed(pictures: Any) -> Array:
    """Return the observed silhouettes (n, p) of small pictures, of 0 to 1."""
    return np.asarray(pictures[..., ::2].reshape(len(pictures), -1) / 255.0)


def searched(training: Training, start: Mapping[str, Any] | None) -> list[float]:
    """Return the costs that an optimiser reaches on the held-out instances.

    It searches blindly, or from the proposals of the row `start`.
    """
    name = "cma" if training.agent == STARTED else training.agent
    env = made(training, INSTANCES, split="test")
    costs = []
    env.reset(options={"instance": TESTED})
    for number, problem in enumerate(env.unwrapped.problems):
        space = problem.space
        if start is not None:
            best = int(np.argmin(np.array(start["proposal_costs"])[:, number]))
            mean = np.array(start["proposals"])[best, number]
            space = replace(
                space,
                start=Start(
                    mean, np.full(len(mean), STARTED_SPREAD), np.zeros(len(mean))
                ),
            )
        costs.append(
            minimum(
                problem, space, name, training.budget, [training.seed, number]
            ).best_cost
        )
    return costs if start is None else np.minimum(costs, start["costs"]).tolist()


def minimum(
    problem: Problem, space: Space, name: str, budget: int, seed: Sequence[int]
) -> Problem:
    """Return a problem minimised in a space.

    A budget below 40 is spent on one population.
    """
    factory = registry().optimiser(name)
    settings = planned(
        factory, {"population_size": budget} if budget < 40 else {}, budget
    )
    optimiser = factory(space, np.random.default_rng(seed), **settings)
    searched = Problem(problem.cost, space, budget)
    return minimise(searched, optimiser, budget_known=True)


def ppo(vector: Any, seed: int) -> Any:
    """Return the untrained learner of a vector environment for Stable-Baselines3."""
    import torch
    from stable_baselines3 import PPO

    torch.set_num_threads(1)
    policy_settings = {
        "log_std_init": LOG_DEVIATION,
        "net_arch": NETWORKS,
        "activation_fn": torch.nn.ReLU,
    }
    return PPO(
        "MlpPolicy", vector, seed=seed, device="cpu", gamma=0.0,
        learning_rate=lambda left: LEARNING_RATE * left,
        n_steps=ROLLOUT, batch_size=BATCH, n_epochs=EPOCHS,
        policy_kwargs=policy_settings,
    )  # fmt: skip


def trained(training: Training) -> Policy:
    """Return the policy of a learner, the mean of its distribution."""
    if training.agent == POSING:
        from pose_network import PoseNetwork

        endless: dict[str, Any] = {"max_evaluations": 10**9}
        env = made(training, POSING_ENVIRONMENTS, **endless)
        network = PoseNetwork(env, training.seed)
        network.learn(training.budget)
        return network.policy()
    model = ppo(
        to_sb3_vec_env(made(training, ENVIRONMENTS, errors=False)), training.seed
    )
    learning = training.budget
    if "cloning" in training.agent:
        cloned(model, made(training, ENVIRONMENTS))
        model.policy.log_std.data.fill_(CLONED_LOG_DEVIATION)
        learning -= CLONING_STEPS
    if learning:
        model.learn(learning)
    return lambda pictures, _: np.asarray(
        model.predict(pictures, deterministic=True)[0], dtype=np.float64
    )


def cloned(model: Any, env: Any) -> None:
    """Teach a model the truths of the observations that its own proposals lead to.

    DAgger: Ross, Gordon, Bagnell, AISTATS 2011.
    """
    import torch

    pictures, infos = env.reset(seed=model.seed)
    length = ROLLOUT * ENVIRONMENTS
    for _ in range(CLONING_STEPS // length):
        shown = []
        targets = []
        for _ in range(ROLLOUT):
            shown.append(pictures)
            targets.append(infos["truth"])
            pictures, _, _, _, infos = env.step(
                np.clip(model.predict(shown[-1])[0], -1.0, 1.0)
            )
        inputs = model.policy.obs_to_tensor(np.concatenate(shown))[0]
        answers = torch.as_tensor(np.concatenate(targets), dtype=torch.float32)
        for rows in [
            part
            for _ in range(EPOCHS)
            for part in torch.split(torch.randperm(length), BATCH)
        ]:
            means = model.policy.get_distribution(inputs[rows]).distribution.mean
            model.policy.optimizer.zero_grad()
            (means - answers[rows]).square().sum(dim=1).mean().backward()
            model.policy.optimizer.step()


def table(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the table of a level's rows.

    It has mean costs, and the evaluations that blind searches need for the same cost.
    """
    groups: dict[str, dict[int, list[Mapping[str, Any]]]] = {}
    for row in rows:
        groups.setdefault(row["agent"], {}).setdefault(row["budget"], []).append(row)
    blind = {
        name: {
            budget: float(np.mean([row["costs"] for row in group]))
            for budget, group in groups[name].items()
        }
        for name in SEARCHES
    }
    cells = []
    for agent, budgets in groups.items():
        if agent in SEARCHES:
            proposals = "; ".join(f"{n:,}" for n in budgets)
            cost = "; ".join(f"{c:.1f}" for c in blind[agent].values())
            cells.append([agent, proposals, "", "", "", cost, "", "", ""])
            continue
        ((budget, group),) = budgets.items()
        costs = np.array([row["costs"] for row in group])
        proposals = {STARTED: f"8 + {budget}", "uniform": "8", LOOK_UP: "8"}.get(
            agent, "8" if agent in LEARNERS else "1"
        )
        steps = f"{budget:,}"
        cpu = f"{np.mean([row['cpu_seconds'] for row in group]):.0f}"
        training = [steps, cpu, str(len(group))] if agent in LEARNERS else ["", "", ""]
        low, high = quantiles(drawn_means(costs))
        equal = [equivalent(blind[name], float(costs.mean())) for name in SEARCHES]
        cells.append(
            [
                agent,
                proposals,
                *training,
                f"{costs.mean():.1f}",
                f"{low:.1f} to {high:.1f}",
                *equal,
            ]
        )
    heads = [
        "",
        "proposals",
        "steps",
        "CPU s",
        "seeds",
        "cost",
        "95 % interval",
        "as SAPSO",
        "as CMA-ES",
    ]
    yield from markdown(heads, cells)


def equivalent(blind: Mapping[int, float], cost: float) -> str:
    """Return the evaluations that a blind search needs for a mean cost.

    They are interpolated logarithmically between the measured budgets. A search's costs
    are cumulative minima, so that they never rise.
    """
    budgets = np.array(list(blind))
    costs = -np.minimum.accumulate(list(blind.values()))
    if not -costs[-1] <= cost <= -costs[0]:
        return f"< {budgets[0]}" if cost > -costs[0] else f"> {budgets[-1]:,}"
    return f"{np.exp(np.interp(-cost, costs, np.log(budgets))):,.0f}"


def picture(row: Mapping[str, Any], path: str) -> None:
    """Write the picture of a row's eight proposals with their costs.

    It shows the instance with the median best cost.
    """
    import cv2

    instance = int(np.argsort(row["costs"])[INSTANCES // 2])
    env = gym.make(name_of(row["level"]), split="test", render_mode="rgb_array")
    env.reset(options={"instance": HELD_OUT + instance})
    panels = []
    for proposals in row["proposals"]:
        info = env.step(np.array(proposals[instance]))[-1]
        panel = np.ascontiguousarray(np.asarray(env.render())[:240, 80:240])
        cv2.putText(
            panel,
            f"{info['cost']:.1f}",
            (8, 28),
            cv2.FONT_HERSHEY_SIMPLEX,
            0.8,
            WHITE,
            2,
            cv2.LINE_AA,
        )
        panels.append(panel)
    cv2.imwrite(path, np.hstack(panels)[..., ::-1])


@click.command(cls=Command, help=__doc__)
@click.option(
    "--level",
    "names",
    multiple=True,
    type=click.Choice(list(LEVELS)),
    help="By default the default one.",
)
@click.option(
    "--agent",
    "agents",
    multiple=True,
    type=click.Choice(LEARNERS),
    help="By default all. Repeatable.",
)
@click.option(
    "--seeds",
    type=click.IntRange(1),
    default=SEEDS,
    show_default=True,
    help="Number of trainings of each learner.",
)
@click.option(
    "--rows",
    metavar="FILE",
    help="File with one row a line. An earlier run there is continued.",
)
@click.option(
    "--picture",
    "drawn",
    metavar="FILE",
    help="PNG to write: eight proposals of the first pose network.",
)
@WORKERS
def main(
    names: tuple[str, ...],
    agents: tuple[str, ...],
    seeds: int,
    rows: str | None,
    drawn: str | None,
    workers: int | None,
) -> None:
    check_learners()
    if drawn is not None and POSING not in (agents or LEARNERS):
        raise InputError(f"--picture must come with the agent {POSING}")
    turns = []
    for level in names or ("default",):
        turns += [Training(level, agent, 0, 0) for agent in CONSTANTS]
        turns += [
            Training(level, agent, budget, 0)
            for agent in SEARCHES
            for budget in BUDGETS
        ]
        turns += [
            Training(level, name, LEARNING.get(name, STEPS), seed)
            for seed in range(seeds)
            for name in agents or LEARNERS
        ]
    done = measured(
        {turn: partial(row_of, turn) for turn in turns}, rows, keyed(Training), workers
    )
    for turn in turns:
        if turn.agent == "PPO":
            started = Training(turn.level, STARTED, STARTED_BUDGET, turn.seed)
            done[started] = row_of(started, done[turn])
    for level in names or ("default",):
        click.echo(f"\n{level}, {INSTANCES} held-out instances\n")
        for line in table([row for turn, row in done.items() if turn.level == level]):
            click.echo(line)
    if drawn is not None:
        picture(next(done[turn] for turn in turns if turn.agent == POSING), drawn)


if __name__ == "__main__":
    main()
