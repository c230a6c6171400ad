"""Are observations worth it in Race-v1? Policies without, with, and with learning.

    python docs/studies/race.py --rows race.jsonl

They are tested on held-out instances. All have the same instances, first populations
and budgets, so that they are compared in pairs. The figure is ln(1 + best cost), to
which the rewards of an episode sum up. The table has a line for each policy: trained
steps, seeds, the mean of the figure, and by how much it is below that of round robin,
with a 95 % interval over seeds and instances.
"""

from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import click
import gymnasium as gym
import numpy as np

from agents import HELD_OUT, check_learners
from posefit.arrays import Array
from posefit.cli.output import Command
from posefit.fitting.cma import Strategy
from posefit_envs import to_sb3_vec_env
from posefit_envs.policies import Policy, race_action, race_features
from posefit_envs.race import COMMON_FEATURES, SEARCH_FEATURES, SEARCHES
from table import WORKERS, drawn_means, keyed, markdown, measured, quantiles

NAME = "posefit/Race-v1"
# the people of the test are those of training, as when its page was measured
PEOPLE: dict[str, Any] = {"held_out_people": False}
INSTANCES = 192
SEEDS = 2
# settings of the learners' trainings
CURIOSITIES = (0.1, 0.2, 0.3, 0.4, 0.6, 0.8)
SLOPES = (0.01, 0.03, 0.05, 0.1, 0.2)
# CMA-ES: policies per generation, and episodes of each
CANDIDATES = 16
EPISODES = 24
GENERATIONS = 60
LINEAR_WEIGHTS = 9
DISCOUNT = 0.995
PPO_ENVIRONMENTS = 64
PPO_ROLLOUT = 64
PPO_STEPS = 200_000
PPO_SETTINGS: dict[str, Any] = {
    "n_steps": PPO_ROLLOUT,
    "batch_size": 512,
    "learning_rate": 1e-3,
    "gae_lambda": 0.98,
}
# of PPO's first actions: if several were clipped to 1, the first would always win
LOG_DEVIATION = -1.0
SAC_ENVIRONMENTS = 16
SAC_STEPS = 24_000
SAC_SETTINGS: dict[str, Any] = {"buffer_size": SAC_STEPS, "gradient_steps": 4}
REFERENCES = ("round robin", "random actions", "one restarted", "halving")
LEARNERS = ("bandit", "linear, CMA-ES", "PPO, a shared net", "PPO", "SAC")


class Turn(NamedTuple):
    """One row: a policy, and the seed of its training."""

    agent: str
    seed: int


def round_robin(observation: Any, step: int) -> Array:
    """Return the action with which searches take turns."""
    features, _ = race_features(observation)
    searches: int = features.shape[-2]
    return race_action(np.full(features.shape[:-2], step % searches), searches)


def restarted(observation: Any, _: int, *, slope: float) -> Array:
    """Return the action that advances one search until its slope is below `slope`.

    Then another search is advanced: one that never was, or else a new one.
    """
    features = race_features(observation)[0]
    steep = features[..., 1] >= slope
    longest = np.where(steep, features[..., 3], -1.0).argmax(axis=-1)
    searches = features.shape[-2]
    return race_action(np.where(steep.any(axis=-1), longest, searches), searches)


def halving(observation: Any, _: int) -> Array:
    """Return the action of successive halving.

    The budget has equal parts. After each of them the worse half of the searches stops;
    the others take turns. K. Jamieson, A. Talwalkar, Non-stochastic best arm
    identification and hyperparameter optimization, AISTATS 2016.
    """
    features, common = race_features(observation)
    searches = features.shape[-2]
    parts = int(np.log2(searches)) + 1
    # the observed budget is float32
    done = np.minimum(np.floor(parts * (1.0 - common[..., 1]) + 1e-6), parts - 1)
    ranks = features[..., 0].argsort(axis=-1, kind="stable").argsort(axis=-1)
    # each finished part has left half as many searches
    left = ranks < searches // 2.0 ** done[..., None]
    return race_action(
        np.where(left, features[..., 3], np.inf).argmin(axis=-1), searches
    )


def bandit(observation: Any, step: int, *, curiosity: float) -> Array:
    """Return the action of UCB1: the search with the lowest optimistic best cost.

    The optimistic cost is lower by `curiosity` times the root of ln(generations of all)
    / generations, in observed costs. The policy starts no new search. P. Auer, N.
    Cesa-Bianchi, P. Fischer, Finite-time analysis of the multiarmed bandit problem,
    Machine Learning 47, 2002. Their rewards are means; these are bests.
    """
    features, _ = race_features(observation)
    searches = int(features.shape[-2])
    used = np.asarray(features[..., 3])
    total = step + searches
    # observed shares of the budget become generations, of which the total is known
    generations = used / used.sum(axis=-1, keepdims=True) * total
    index = features[..., 0] - curiosity * np.sqrt(np.log(total) / generations)
    return race_action(index.argmin(axis=-1), searches)


def linear(observation: Any, _: int, *, weights: Array) -> Array:
    """Return the action with the highest score, linear in a search's features.

    `weights` (..., 9) are one policy, or one for each row of observations. Four are for
    the features: best cost above the best of all, slope, spread and use. Four are for
    the same features times the budget left. The last is the score of a new search.
    """
    features, common = race_features(observation)
    features[..., 0] -= common[..., :1]
    shown = np.concatenate([features, features * common[..., 1, None, None]], axis=-1)
    scores = (shown @ weights[..., :-1, None])[..., 0]
    another = np.broadcast_to(weights[..., -1:], (*scores.shape[:-1], 1))
    choice = np.concatenate([scores, another], axis=-1).argmax(axis=-1)
    return race_action(choice, scores.shape[-1])


def final_costs(
    policy: Policy, env: Any, numbers: Sequence[int], seeds: Sequence[int]
) -> tuple[Array, int]:
    """Return ln(1 + best cost) (n,) after an episode of each environment.

    Also return the number of steps made.
    """
    observations, _ = env.reset(seed=list(seeds), options={"instance": list(numbers)})
    costs = np.full(env.num_envs, np.nan)
    step = 0
    taken = 0
    while np.isnan(costs).any():
        taken += int(np.isnan(costs).sum())
        observations, _, ended, _, infos = env.step(policy(observations, step))
        new = ended & np.isnan(costs)
        costs[new] = np.log1p(infos["best_cost"][new])
        step += 1
    return costs, taken


def _made(count: int, split: str = "train") -> Any:
    return gym.make_vec(
        f"posefit_envs:{NAME}", count, errors=False, split=split, **PEOPLE
    )


def chosen(policies: Sequence[Policy], seed: int) -> tuple[Policy, int]:
    """Return the best of several policies on training instances, and the steps made.

    There are as many instances as are held out.
    """
    rng = np.random.default_rng(seed)
    env = _made(INSTANCES)
    numbers = rng.integers(HELD_OUT, size=INSTANCES).tolist()
    seeds = rng.integers(2**31, size=INSTANCES).tolist()
    results = [final_costs(policy, env, numbers, seeds) for policy in policies]
    best = int(np.argmin([costs.mean() for costs, _ in results]))
    return policies[best], sum(steps for _, steps in results)


def evolved(seed: int) -> tuple[Policy, int]:
    """Return the linear policy at the mean of CMA-ES, and the steps made.

    All policies of a generation have the same episodes.
    """
    rng = np.random.default_rng(seed)
    env = _made(CANDIDATES * EPISODES)
    taken = 0
    strategy = Strategy(np.zeros(LINEAR_WEIGHTS), np.ones(LINEAR_WEIGHTS), CANDIDATES)
    for _ in range(GENERATIONS):
        weights = strategy.sample(rng, CANDIDATES)
        numbers = rng.integers(HELD_OUT, size=EPISODES)
        seeds = rng.integers(2**31, size=EPISODES)
        policy = partial(linear, weights=weights.repeat(EPISODES, axis=0))
        tiled = (
            np.tile(numbers, CANDIDATES).tolist(),
            np.tile(seeds, CANDIDATES).tolist(),
        )
        costs, steps = final_costs(policy, env, *tiled)
        strategy.learn(weights, costs.reshape(CANDIDATES, EPISODES).mean(axis=1))
        taken += steps
    return partial(linear, weights=strategy.mean), taken


def trained(agent: str, seed: int) -> tuple[Policy, int]:
    """Return the policy learned by Stable-Baselines3, and the steps made.

    Actions are drawn from its distribution. The distribution's middle is worse: of two
    searches with similar features one would have all turns.
    """
    import torch
    from stable_baselines3 import PPO, SAC

    torch.set_num_threads(1)
    common: dict[str, Any] = {"seed": seed, "device": "cpu", "gamma": DISCOUNT}
    if agent == "SAC":
        model: Any = SAC(
            "MlpPolicy",
            to_sb3_vec_env(_made(SAC_ENVIRONMENTS)),
            **SAC_SETTINGS,
            **common,
        )
    else:
        policy = "MlpPolicy" if agent == "PPO" else _shared_net()
        common |= PPO_SETTINGS | {"policy_kwargs": {"log_std_init": LOG_DEVIATION}}
        model = PPO(policy, to_sb3_vec_env(_made(PPO_ENVIRONMENTS)), **common)
    model.learn(SAC_STEPS if agent == "SAC" else PPO_STEPS)

    def act(observation: Any, _: int) -> Array:
        actions: Array = model.predict(observation, deterministic=False)[0]
        return actions

    return act, int(model.num_timesteps)


def _shared_net() -> type:
    """Return a policy of Stable-Baselines3 with one net that scores every search.

    A new search has a separate score.
    """
    import torch
    from stable_baselines3.common.policies import ActorCriticPolicy
    from torch import nn

    width = 32

    class Scores(nn.Module):  # type: ignore[misc]
        latent_dim_pi = SEARCHES + 1
        latent_dim_vf = 2 * width

        def __init__(self) -> None:
            super().__init__()
            size = SEARCH_FEATURES + COMMON_FEATURES
            self.score = nn.Sequential(
                nn.Linear(size, width), nn.Tanh(), nn.Linear(width, width), nn.Tanh()
            )
            self.last = nn.Linear(width, 1)
            self.another = nn.Linear(COMMON_FEATURES, 1)
            self.value = nn.Sequential(
                nn.Linear(size, width), nn.Tanh(), nn.Linear(width, width), nn.Tanh()
            )

        def _rows(self, shown: Any) -> Any:
            common = shown[:, -COMMON_FEATURES:]
            own = (
                shown[:, :-COMMON_FEATURES]
                .reshape(len(shown), SEARCH_FEATURES, SEARCHES)
                .transpose(1, 2)
            )
            return torch.cat([own, common[:, None].expand(-1, SEARCHES, -1)], dim=2)

        def forward_actor(self, shown: Any) -> Any:
            scores = self.last(self.score(self._rows(shown)))[:, :, 0]
            return torch.cat([scores, self.another(shown[:, -COMMON_FEATURES:])], dim=1)

        def forward_critic(self, shown: Any) -> Any:
            rows = self.value(self._rows(shown))
            return torch.cat([rows.mean(dim=1), rows.amax(dim=1)], dim=1)

        def forward(self, shown: Any) -> Any:
            return self.forward_actor(shown), self.forward_critic(shown)

    class SharedNet(ActorCriticPolicy):  # type: ignore[misc]
        def _build_mlp_extractor(self) -> None:
            self.mlp_extractor: Any = Scores()

        def _build(self, schedule: Any) -> None:
            super()._build(schedule)
            self.action_net = nn.Identity()  # the scores are the actions
            optimizer: Any = self.optimizer_class
            self.optimizer = optimizer(
                self.parameters(), lr=schedule(1), **self.optimizer_kwargs
            )

    return SharedNet


def policy_of(turn: Turn, env: Any) -> tuple[Policy, int]:
    """Return the policy of a row, trained, and the steps of its training."""
    rng = np.random.default_rng(turn.seed)
    plain: dict[str, Policy] = {
        "round robin": round_robin,
        "random actions": lambda _, __: rng.uniform(-1.0, 1.0, env.action_space.shape),
        "halving": halving,
    }
    if turn.agent in plain:
        return plain[turn.agent], 0
    if turn.agent == "one restarted":
        return chosen([partial(restarted, slope=slope) for slope in SLOPES], turn.seed)
    if turn.agent == "bandit":
        return chosen(
            [partial(bandit, curiosity=curiosity) for curiosity in CURIOSITIES],
            turn.seed,
        )
    if turn.agent == "linear, CMA-ES":
        return evolved(turn.seed)
    return trained(turn.agent, turn.seed)


def row_of_turn(turn: Turn) -> dict[str, Any]:
    """Return a row: final costs on held-out instances, and the training's steps."""
    env = _made(INSTANCES, "test")
    numbers = range(HELD_OUT, HELD_OUT + INSTANCES)
    policy, steps = policy_of(turn, env)
    costs, _ = final_costs(policy, env, numbers, numbers)
    return turn._asdict() | {"steps": steps, "costs": costs.tolist()}


def race_lines(rows: Sequence[Mapping[str, Any]]) -> Iterator[str]:
    """Yield the printed table, the highest mean first.

    Intervals are of 95 %, by a bootstrap of seeds and instances.
    """
    agents = dict.fromkeys(row["agent"] for row in rows)
    costs = {
        agent: np.array([row["costs"] for row in rows if row["agent"] == agent])
        for agent in agents
    }
    robin = costs["round robin"]
    cells = []
    for agent, own in sorted(costs.items(), key=lambda item: -float(item[1].mean())):
        steps = np.mean([row["steps"] for row in rows if row["agent"] == agent])
        low, high = quantiles(drawn_means(robin) - drawn_means(own))
        gain = f"{robin.mean() - own.mean():.2f} ({low:.2f} to {high:.2f})"
        cells.append([agent, f"{steps:,.0f}", str(len(own)), f"{own.mean():.2f}", gain])
    yield from markdown(
        ["policy", "trained steps", "seeds", "ln(1 + cost)", "below round robin"], cells
    )


@click.command(cls=Command, help=__doc__)
@click.option(
    "--rows",
    metavar="FILE",
    help="File with one row a line. An earlier run there is continued.",
)
@WORKERS
def main(rows: str | None, workers: int | None) -> None:
    check_learners()
    turns = [Turn(agent, 0) for agent in REFERENCES]
    turns += [Turn(agent, seed) for agent in LEARNERS for seed in range(SEEDS)]
    done = measured(
        {turn: partial(row_of_turn, turn) for turn in turns}, rows, keyed(Turn), workers
    )
    for line in race_lines([*done.values()]):
        click.echo(line)


if __name__ == "__main__":
    main()
