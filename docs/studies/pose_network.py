"""A pose network for FitImage, taught on silhouettes that the environment draws itself.

The network sees a silhouette, where it differs from that of the best proposal so far,
and this proposal. It gives a correction. It is taught by supervision: the environment
draws any proposal, so that a proposal near a training person's pose is a silhouette of
which the answer is known. `agents.py` measures it.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from posefit.arrays import Array

CORRECTIONS = 2  # per silhouette of training
SILHOUETTES = 6  # for each instance, before others are drawn
POOLS = {1: 2048, 9: 6144}  # training instances, by the number of motions
SPREAD = 0.3  # of the answers around true poses, in half-ranges of the box
TILTS = 0.5  # pitch and roll are drawn from a narrower spread
DRAWN = 0.7  # share of silhouettes that are drawn; the others are the instances' own
NOISE = 0.1  # largest deviation of a proposal in training
HIDDEN = (384, 192)
LEARNING_RATE = 1e-3
PASSES = 2
BATCH = 256

Policy = Callable[[Any, Array], Array]


def split(pictures: Any) -> tuple[Array, Array]:
    """Return the observed and the proposed silhouettes (n, p) of small pictures."""
    flat = pictures.reshape(len(pictures), -1, 2) / 255.0
    return flat[..., 0], flat[..., 1]


class PoseNetwork:
    """A network that learns in a vector environment of small pictures, of one view.

    Args:
        env: the environment. Its episodes must not end by themselves.
        seed: of the network and the training.
    """

    def __init__(self, env: Any, seed: int) -> None:
        import torch

        torch.set_num_threads(1)
        torch.manual_seed(seed)
        self.rng = np.random.default_rng(seed)
        self.env = env
        self.world = env.unwrapped.world
        self.dimensions = env.single_action_space.shape[0]
        pixels = int(np.prod(env.single_observation_space.shape))
        first, second = HIDDEN
        self.network = torch.nn.Sequential(
            torch.nn.Linear(pixels + self.dimensions + 1, first),
            torch.nn.ReLU(),
            torch.nn.Linear(first, second),
            torch.nn.ReLU(),
            torch.nn.Linear(second, self.dimensions),
        )
        self.optimiser = torch.optim.Adam(self.network.parameters(), LEARNING_RATE)

    def boxed(self, proposals: Array) -> Array:
        """Return proposals within the box; an unknown yaw goes round."""
        proposals = proposals.copy()
        if self.world.yaw == "unknown":
            proposals[:, 0] = (proposals[:, 0] + 1.0) % 2.0 - 1.0
        return np.clip(proposals, -1.0, 1.0)

    def inputs(self, observed: Array, drawn: Array, best: Array, begins: bool) -> Any:
        """Return what the network sees (n, inputs)."""
        import torch

        start = np.full((len(observed), 1), float(begins))
        seen = np.concatenate([observed, observed - drawn, best, start], axis=1)
        return torch.as_tensor(seen, dtype=torch.float32)

    def corrections(self, inputs: Any) -> Array:
        """Return the corrections (n, d) of proposals."""
        import torch

        with torch.no_grad():
            return np.asarray(self.network(inputs), dtype=np.float64)

    def learn(self, steps: int) -> None:
        """Learn from so many steps of the environment."""
        count = self.env.num_envs
        per_round = count * (2 + CORRECTIONS)
        pool = POOLS[len(self.world.motion)]
        spread = np.full(self.dimensions, SPREAD)
        spread[1:3] *= TILTS
        for number in range(-(-steps // per_round)):
            if number % SILHOUETTES == 0:
                people = self.rng.choice(pool, count, replace=False)
                pictures, infos = self.env.reset(options={"instance": people})
                own = split(pictures)[0]
                truths = infos["truth"]
                plain = split(self.env.step(truths)[0])[1]
            deviations = spread * self.rng.standard_normal(truths.shape)
            drawn = self.rng.random(count) < DRAWN
            answers = np.where(drawn[:, None], self.boxed(truths + deviations), truths)
            observed = split(self.env.step(answers)[0])[1]
            if self.world.noise:
                observed = np.clip(observed + own - plain, 0.0, 1.0)
            observed[~drawn] = own[~drawn]
            left = max(1.0 - number * per_round / steps, 0.02)
            self.fit(self.lesson(observed, answers), LEARNING_RATE * left)

    def lesson(self, observed: Array, answers: Array) -> tuple[Any, Any]:
        """Return inputs, and the corrections that lead to the answers."""
        count = len(observed)
        proposal = np.zeros_like(answers)
        drawn = np.zeros_like(observed)
        inputs = []
        targets = []
        for step in range(1 + CORRECTIONS):
            inputs.append(self.inputs(observed, drawn, proposal, step == 0))
            targets.append(answers - proposal)
            noise = NOISE * self.rng.random((count, 1))
            noise = noise * self.rng.standard_normal(answers.shape)
            change = self.corrections(inputs[-1]) + noise
            proposal = self.boxed(proposal + change)
            drawn = split(self.env.step(proposal)[0])[1]
        import torch

        wanted = torch.as_tensor(np.concatenate(targets), dtype=torch.float32)
        return torch.cat(inputs), wanted

    def fit(self, lesson: tuple[Any, Any], rate: float) -> None:
        """Take a few passes of Adam over a lesson."""
        import torch

        inputs, targets = lesson
        for group in self.optimiser.param_groups:
            group["lr"] = rate
        for _ in range(PASSES):
            for rows in torch.split(torch.randperm(len(inputs)), BATCH):
                off = self.network(inputs[rows]) - targets[rows]
                if self.world.yaw == "unknown":
                    turn = torch.remainder(off[:, :1] + 1.0, 2.0) - 1.0
                    off = torch.cat([turn, off[:, 1:]], dim=1)
                loss = off.square().sum(dim=1).mean()
                self.optimiser.zero_grad()
                loss.backward()
                self.optimiser.step()

    def policy(self) -> Policy:
        """Return the policy of one episode, of small pictures and last costs.

        It corrects the best proposal so far. A correction that made it worse is halved.
        """
        best: Array | None = None
        best_costs: Array = np.empty(0)
        best_drawn: Array = np.empty(0)
        halvings: Array = np.empty(0)
        proposal: Array = np.empty(0)

        def act(pictures: Any, costs: Array) -> Array:
            nonlocal best, best_costs, best_drawn, halvings, proposal
            observed, drawn = split(pictures)
            begins = best is None
            if best is None:
                best = np.zeros((len(observed), self.dimensions))
                best_costs = costs.copy()
                best_drawn = np.zeros_like(observed)
                halvings = np.zeros(len(observed))
            else:
                better = costs < best_costs
                best[better] = proposal[better]
                best_costs[better] = costs[better]
                best_drawn[better] = drawn[better]
                halvings = np.where(better, 0.0, halvings + 1.0)
            shown = self.inputs(observed, best_drawn, best, begins)
            change = self.corrections(shown) * 0.5 ** halvings[:, None]
            proposal = self.boxed(best + change)
            return proposal

        return act
