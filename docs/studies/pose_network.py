"""Teaches a network to correct proposals in FitImage, on silhouettes that it draws.

agents.py and make_agent.py import this module; it prints nothing. agents.py measures
what is learned.

The environment draws any proposal. So a proposal near a training person's pose gives a
silhouette of which the answer is known, and any other proposal is something to
correct.
"""

from typing import Any, NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit_envs.corrections import REACH, features, shrunk

CORRECTIONS = 2  # per silhouette
SILHOUETTES = 6  # for each instance, before others are drawn
POOLS = {1: 2048, 9: 6144}  # training instances, by the number of motions
SPREAD = 0.3  # spread of answers around true poses, in half-ranges of the box
TILTS = 0.5  # pitch and roll are drawn from a narrower spread
NOISE = 0.1  # largest deviation of a proposal in training
LEARNING_RATE = 1e-3
PASSES = 2
BATCH = 256


class Lesson(NamedTuple):
    """Silhouettes (n, p) and the proposals (n, d) that are the answers."""

    observed: Any
    answers: Array


def teach(network: Any, env: Any, seed: int, steps: int, drawn: float) -> None:
    """Teach a network in a vector of FitImage whose episodes do not end.

    Args:
        network: A module of torch, from the observations of
            `posefit_envs.Corrections` to actions.
        env: The vector, without wrappers.
        seed: Seed of the silhouettes.
        steps: Number of steps of the environment.
        drawn: Share of silhouettes that are drawn near a person's pose. The others are
            the instances' silhouettes, and the answers their `truth`.
    """
    import torch

    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    optimiser = torch.optim.Adam(network.parameters(), LEARNING_RATE)
    count = env.num_envs
    per_round = count * (2 + CORRECTIONS)
    rounds = -(-steps // per_round)
    instances = Instances(env, rng)
    for number in range(rounds):
        if number % SILHOUETTES == 0:
            instances.change()
        lesson = instances.lesson(drawn)
        inputs, targets, weights = corrections(network, instances, lesson)
        left = max(1.0 - number / rounds, 0.02)
        for group in optimiser.param_groups:
            group["lr"] = LEARNING_RATE * left
        for _ in range(PASSES):
            for rows in torch.split(torch.randperm(len(inputs)), BATCH):
                off = instances.off(
                    network(inputs[rows]) - targets[rows], weights[rows]
                )
                loss = off.square().sum(dim=1).mean()
                optimiser.zero_grad()
                loss.backward()
                optimiser.step()


class Instances:
    """Training instances in a vector, and the silhouettes that it draws."""

    def __init__(self, env: Any, rng: np.random.Generator) -> None:
        self.env = env
        self.rng = rng
        self.world = env.unwrapped.world
        self.dimensions = env.single_action_space.shape[0]
        self.turns = self.world.yaw == "unknown"

    def change(self) -> None:
        """Draw other instances."""
        pool = POOLS[len(self.world.motion)]
        people = self.rng.choice(pool, self.env.num_envs, replace=False)
        pictures, infos = self.env.reset(options={"instance": people})
        self.truths = infos["truth"]
        self.own = shrunk(pictures[..., ::2])
        self.damage = np.zeros_like(self.own)
        if self.world.noise:
            self.damage = self.own - self.draw(self.truths)

    def draw(self, proposals: Array) -> Any:
        """Return the silhouettes (n, p) of proposals (n, d)."""
        return shrunk(self.env.step(proposals)[0][..., 1::2])

    def boxed(self, proposals: Array) -> Array:
        """Return proposals within the box; an unknown yaw wraps around."""
        proposals = proposals.copy()
        if self.turns:
            proposals[:, 0] = (proposals[:, 0] + 1.0) % 2.0 - 1.0
        return np.clip(proposals, -1.0, 1.0)

    def near(self) -> Array:
        """Return a random proposal (n, d) near each true pose."""
        spread = np.full(self.dimensions, SPREAD)
        spread[1:3] *= TILTS
        deviations = spread * self.rng.standard_normal(self.truths.shape)
        return self.boxed(self.truths + deviations)

    def lesson(self, share: float) -> Lesson:
        """Return silhouettes, a share of them drawn, and their answers."""
        near = self.near()
        drawn = self.rng.random(len(self.truths)) < share
        answers = np.where(drawn[:, None], near, self.truths)
        observed = np.clip(self.draw(answers) + self.damage, 0.0, 1.0)
        return Lesson(np.where(drawn[:, None], observed, self.own), answers)

    def off(self, errors: Any, reach: Any) -> Any:
        """Return errors of actions as errors of proposals, the short way round."""
        import torch

        off = errors * reach
        if self.turns:
            turn = torch.remainder(off[:, :1] + 1.0, 2.0) - 1.0
            off = torch.cat([turn, off[:, 1:]], dim=1)
        return off


def corrections(network: Any, instances: Instances, lesson: Lesson) -> tuple[Any, ...]:
    """Return inputs, the actions that lead to the answers, and the reach of actions.

    The network's own proposals are corrected, with some noise.
    """
    import torch

    observed, answers = lesson
    rng = instances.rng
    count = len(observed)
    proposal = np.zeros_like(answers)
    drawn = np.zeros_like(observed)
    inputs = []
    targets = []
    reaches = []
    for step in range(1 + CORRECTIONS):
        first = np.full(count, step == 0)
        reach = REACH if step else 1.0
        seen = features(observed, drawn, proposal, first, np.zeros(count))
        inputs.append(torch.from_numpy(seen))
        targets.append((answers - proposal) / reach)
        reaches.append(np.full((count, 1), reach))
        with torch.no_grad():
            change = reach * np.asarray(network(inputs[-1]), dtype=np.float64)
        noise = NOISE * rng.random((count, 1)) * rng.standard_normal(answers.shape)
        proposal = instances.boxed(proposal + change + noise)
        drawn = instances.draw(proposal)
    wanted = torch.as_tensor(np.concatenate(targets), dtype=torch.float32)
    reach = torch.as_tensor(np.concatenate(reaches), dtype=torch.float32)
    return torch.cat(inputs), wanted, reach
