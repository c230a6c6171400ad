"""Are observations worth it? FitImage-v1 by blind searches, cloning and PPO.

    python docs/studies/agents.py --rows agents.jsonl --picture agents.png

All are tested on held-out instances. A learner's row is one training: by
Stable-Baselines3's PPO, by cloning the answers to silhouettes, or by cloning and then
PPO. A search's row has every instance once. There is a table for each level.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from time import process_time
from typing import Any, NamedTuple

import click
import gymnasium as gym
import numpy as np

from pose_network import Instances, teach
from posefit import Problem, minimise
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.errors import InputError
from posefit.fitting.box import Space
from posefit.registry import registry
from posefit.settings import planned
from posefit_envs import Corrections, to_sb3_vec_env
from posefit_envs.corrections import shrunk
from posefit_envs.fit import MAX_EVALUATIONS
from table import WORKERS, drawn_means, keyed, markdown, measured, quantiles

HELD_OUT = 10_000  # the first instance of the test split
INSTANCES = 200
SEEDS = 5
STEPS = 1_000_000  # about five minutes of one core
TESTED = list(range(HELD_OUT, HELD_OUT + INSTANCES))
LEVELS = {
    "easy": "FitImage-easy-v1",
    "default": "FitImage-v1",
    "medium": "FitImage-medium-v1",
    "hard": "FitImage-hard-v1",
}
BUDGETS = (8, 40, 200, 800, 2440)  # evaluations of blind searches
SEARCHES = ("sapso", "cma")
# references that learn nothing: the k-th proposal of the look-up is the truth of the
# training instance whose silhouette is the k-th most similar
LOOK_UP = "look-up"
LOOKED_UP = 10_000  # training instances
LOOKED_UP_AT_ONCE = 500
# the same look-up among silhouettes that are drawn near the training people's poses,
# without damage
DRAWN_LOOK_UP = "look-up of drawn silhouettes"
DRAWN_SILHOUETTES = 400_000
DRAWN_OF_INSTANCE = 40
LOOK_UPS = (LOOK_UP, DRAWN_LOOK_UP)
CONSTANTS = ("uniform", "the truth, projected", *LOOK_UPS)
COMPARED_AT_ONCE = 20  # pictures: more take a gigabyte
# networks that are taught the answers to training silhouettes, or to silhouettes that
# are drawn; see pose_network.py
CLONING = "cloning"
POSING = "pose network"
DRAWN = {CLONING: 0.0, POSING: 0.7}  # share of drawn silhouettes
TAUGHT_STEPS = 240_000
TEACHERS = 256  # environments
# PPO, and PPO that continues from a pose network
CONTINUED = "pose network, then PPO"
LEARNERS = (CLONING, "PPO", POSING, CONTINUED)
ENVIRONMENTS = 64
ROLLOUT = 16
BATCH = 256
EPOCHS = 6
LEARNING_RATE = 1.5e-3
CLIP = 0.2  # PPO's clip of the ratio of probabilities
LOG_DEVIATION = -1.6
SHOWN = (12, 16)  # height and width of small pictures, where nothing is corrected
NETWORKS: dict[str, list[int]] = {"pi": [384, 128], "vf": [128]}  # hidden layers
# gentler steps of a taught network, after its estimates of rewards are learned
CONTINUED_TAUGHT_STEPS = 100_000
CONTINUED_STEPS = 120_000
# larger steps or deviations forget within seconds what was taught
CONTINUED_RATE = 2e-4
CONTINUED_CLIP = 0.1
CONTINUED_LOG_DEVIATION = -2.7
VALUE_STEPS = 8_192
VALUE_PASSES = 10
LEARNING = {
    CLONING: TAUGHT_STEPS,
    POSING: TAUGHT_STEPS,
    CONTINUED: CONTINUED_TAUGHT_STEPS + CONTINUED_STEPS,
}
WHITE = (255, 255, 255)

# actions (n, d) in an environment of observations (n, ...)
Policy = Callable[[Any], Array]


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
    """Return a vector environment of a level."""
    return gym.make_vec(name_of(training.level), count, **arguments)


def tested(training: Training, proposals: int) -> Any:
    """Return the vector environment that an agent is tested in.

    Learners correct proposals; others propose.
    """
    env = made(training, INSTANCES, split="test", max_evaluations=proposals)
    return Corrections(env) if training.agent in LEARNERS else env


def episodes(policy: Policy, training: Training, count: int) -> tuple[Array, Array]:
    """Return proposals (k, n, d) and costs (k, n) of an episode on each instance."""
    env = tested(training, count)
    observations, _ = env.reset(seed=0, options={"instance": TESTED})
    proposals = []
    costs = []
    for _ in range(count):
        actions = np.clip(policy(observations), -1.0, 1.0)
        corrects = isinstance(env, Corrections)
        proposals.append(env.proposals(actions) if corrects else actions)
        observations, _, _, _, infos = env.step(actions)
        costs.append(infos["cost"])
    return np.array(proposals), np.array(costs)


def row_of(training: Training, policies: str | None) -> dict[str, Any]:
    """Return a row: best costs on held-out instances, proposals, CPU seconds.

    What a learner has learned is saved in the folder `policies`, if any.
    """
    start_time = process_time()
    row = training._asdict()
    if training.agent in SEARCHES:
        row["costs"] = searched(training)
        return row | {"cpu_seconds": round(process_time() - start_time, 1)}
    learns = training.agent in LEARNERS
    if learns:
        model = trained(training)
        policy = policy_of(model)
        if policies is not None:
            name = f"{training.level}-{training.agent}-{training.seed}.npz"
            np.savez_compressed(Path(policies) / name, *layers_of(model))
    elif training.agent == LOOK_UP:
        policy = looked_up(training)
    elif training.agent == DRAWN_LOOK_UP:
        policy = looked_up_drawn(training)
    else:
        policy = constant(training)
    row["cpu_seconds"] = round(process_time() - start_time, 1)
    several = learns or training.agent in ("uniform", *LOOK_UPS)
    count = MAX_EVALUATIONS if several else 1
    proposals, costs = episodes(policy, training, count)
    row["costs"] = costs.min(axis=0).tolist()
    if learns:
        row |= {
            "proposals": proposals.round(4).tolist(),
            "proposal_costs": costs.round(2).tolist(),
        }
    return row


def constant(training: Training) -> Policy:
    """Return the policy of a reference that ignores its observations."""
    rng = np.random.default_rng(training.seed)
    env = made(training, INSTANCES, split="test")
    if training.agent == "uniform":
        return lambda _: rng.uniform(-1.0, 1.0, env.action_space.shape)
    env.reset(options={"instance": TESTED})
    truths = np.array([problem.truth for problem in env.unwrapped.problems])
    return lambda _: truths


def looked_up(training: Training) -> Policy:
    """Return a policy that proposes the truths of the nearest training silhouettes."""
    env = made(training, LOOKED_UP_AT_ONCE)
    silhouettes = []
    truths = []
    for first in range(0, LOOKED_UP, LOOKED_UP_AT_ONCE):
        numbers = list(range(first, first + LOOKED_UP_AT_ONCE))
        pictures, _ = env.reset(options={"instance": numbers})
        silhouettes.append(shrunk(pictures[..., ::2]))
        truths.append([problem.truth for problem in env.unwrapped.problems])
    return nearest_policy(np.concatenate(silhouettes), np.concatenate(truths))


def looked_up_drawn(training: Training) -> Policy:
    """Return a policy that proposes the poses of the nearest drawn silhouettes."""
    env = made(training, LOOKED_UP_AT_ONCE, max_evaluations=10**9)
    instances = Instances(env, np.random.default_rng(training.seed))
    silhouettes: list[Any] = []
    poses: list[Array] = []
    while len(poses) * LOOKED_UP_AT_ONCE < DRAWN_SILHOUETTES:
        instances.change()
        for _ in range(DRAWN_OF_INSTANCE):
            poses.append(instances.near())
            silhouettes.append(instances.draw(poses[-1]))
    return nearest_policy(np.concatenate(silhouettes), np.concatenate(poses))


def nearest_policy(known: Any, answers: Array) -> Policy:
    """Return a policy that proposes the answers to the most similar silhouettes.

    The most similar one comes first.

    Args:
        known: Silhouettes (m, p), shrunk.
        answers: The proposal (m, d) for each.
    """
    squares = (known**2).sum(axis=1)
    nearest: list[Any] = []
    asked = 0

    def policy(pictures: Any) -> Array:
        nonlocal asked
        if not nearest:
            seen = shrunk(pictures[..., ::2])
            for first in range(0, len(seen), COMPARED_AT_ONCE):
                some = seen[first : first + COMPARED_AT_ONCE]
                distances = squares - 2.0 * some @ known.T
                few = np.argpartition(distances, MAX_EVALUATIONS, axis=1)
                few = few[:, :MAX_EVALUATIONS]
                order = np.take_along_axis(distances, few, axis=1).argsort(axis=1)
                nearest.extend(np.take_along_axis(few, order, axis=1))
        proposals: Array = answers[np.array(nearest)[:, asked]]
        asked += 1
        return proposals

    return policy


def searched(training: Training) -> list[float]:
    """Return the costs that an optimiser reaches blindly on the held-out instances."""
    env = made(training, INSTANCES, split="test")
    env.reset(options={"instance": TESTED})
    costs = []
    for number, problem in enumerate(env.unwrapped.problems):
        seed = [training.seed, number]
        found = minimum(problem, problem.space, training.agent, training.budget, seed)
        costs.append(found.best_cost)
    return costs


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


def ppo(vector: Any, seed: int, rate: float = LEARNING_RATE, clip: float = CLIP) -> Any:
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
        learning_rate=lambda left: rate * left, clip_range=clip,
        n_steps=ROLLOUT, batch_size=BATCH, n_epochs=EPOCHS,
        policy_kwargs=policy_settings,
    )  # fmt: skip


def trained(training: Training) -> Any:
    """Return the model of a learner after its training."""
    import torch

    continued = training.agent == CONTINUED
    env = Corrections(made(training, ENVIRONMENTS, errors=False))
    if continued:
        model = ppo(to_sb3_vec_env(env), training.seed, CONTINUED_RATE, CONTINUED_CLIP)
    else:
        model = ppo(to_sb3_vec_env(env), training.seed)
    practised = {CLONING: 0, POSING: 0, CONTINUED: CONTINUED_STEPS}
    steps = practised.get(training.agent, training.budget)
    taught = training.budget - steps
    if taught:
        layers = model.policy.mlp_extractor.policy_net
        network = torch.nn.Sequential(*layers, model.policy.action_net)
        endless = made(training, TEACHERS, max_evaluations=10**9)
        drawn = DRAWN.get(training.agent, DRAWN[POSING])
        teach(network, endless, training.seed, taught, drawn)
    if continued:
        model.policy.log_std.data.fill_(CONTINUED_LOG_DEVIATION)
        know_rewards(model, env)
    if steps:
        model.learn(steps)
    return model


def policy_of(model: Any) -> Policy:
    """Return the policy of a model, the mean of its distribution."""
    return lambda observations: np.asarray(
        model.predict(observations, deterministic=True)[0], dtype=np.float64
    )


def layers_of(model: Any) -> list[Array]:
    """Return weights (inputs, outputs) and biases of a policy's layers, in turn.

    They are rounded to 16 bits, as `posefit_envs.trained_policy` reads them.
    """
    policy = model.policy
    arrays = []
    for layer in (*policy.mlp_extractor.policy_net, policy.action_net):
        if hasattr(layer, "weight"):
            arrays.append(layer.weight.detach().numpy().T.astype(np.float16))
            arrays.append(layer.bias.detach().numpy().astype(np.float16))
    return arrays


def know_rewards(model: Any, env: Any) -> None:
    """Teach a model the rewards of its actions, and leave its actions as they are.

    PPO compares rewards with what it expects. While that is wrong, it would change a
    good policy for the worse.
    """
    import torch

    shown = []
    rewards = []
    observations, _ = env.reset(seed=model.seed)
    for _ in range(VALUE_STEPS // ENVIRONMENTS):
        shown.append(observations)
        actions, _ = model.predict(observations)
        observations, reward, _, _, _ = env.step(actions)
        rewards.append(reward)
    inputs = torch.from_numpy(np.concatenate(shown))
    answers = torch.as_tensor(np.concatenate(rewards), dtype=torch.float32)
    policy = model.policy
    values = torch.nn.Sequential(*policy.mlp_extractor.value_net, policy.value_net)
    optimiser = torch.optim.Adam(values.parameters(), 1e-3)
    for _ in range(VALUE_PASSES):
        for rows in torch.split(torch.randperm(len(inputs)), BATCH):
            off = values(inputs[rows])[:, 0] - answers[rows]
            optimiser.zero_grad()
            off.square().mean().backward()
            optimiser.step()


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
        proposals = "8" if agent in (*LEARNERS, "uniform", *LOOK_UPS) else "1"
        steps = f"{budget:,}"
        cpu = f"{np.mean([row['cpu_seconds'] for row in group]):.0f}"
        training = ["", "", ""]
        if agent in LEARNERS:
            training = [steps, cpu, str(len(group))]
        elif agent in LOOK_UPS:
            training = ["", cpu, ""]
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
        "evaluations of SAPSO",
        "of CMA-ES",
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
    help="PNG to write: eight proposals of the first PPO.",
)
@click.option(
    "--policies",
    metavar="DIR",
    type=click.Path(exists=True, file_okay=False),
    help="Folder for what learners have learned: a file for each row.",
)
@WORKERS
def main(
    names: tuple[str, ...],
    agents: tuple[str, ...],
    seeds: int,
    rows: str | None,
    drawn: str | None,
    policies: str | None,
    workers: int | None,
) -> None:
    check_learners()
    if drawn is not None and "PPO" not in (agents or LEARNERS):
        raise InputError("--picture must come with the agent PPO")
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
        {turn: partial(row_of, turn, policies) for turn in turns},
        rows,
        keyed(Training),
        workers,
    )
    for level in names or ("default",):
        click.echo(f"\n{level}, {INSTANCES} held-out instances\n")
        for line in table([row for turn, row in done.items() if turn.level == level]):
            click.echo(line)
    if drawn is not None:
        picture(next(done[turn] for turn in turns if turn.agent == "PPO"), drawn)


if __name__ == "__main__":
    main()
