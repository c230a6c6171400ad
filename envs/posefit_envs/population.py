"""The population that Configure-v0 steers: its control by actions, its moves, and the features that are observed."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import REDRAWS, Space, displacement, draw_population, fold, repair, sample_normal
from posefit.silhouette.mask import box_of
from posefit_envs.base import log_cost, scaled, unscaled
from posefit_envs.instance import World, first_episode
from posefit_envs.stage import Rows
from posefit_envs.swarm import COOLING, SwarmState, inertia, speed_limits
from posefit_envs.swarm import INERTIA as SAPSO_INERTIA
from posefit_envs.turns import products

# what the numbers of an action stand for
ACTION_NUMBERS = 10  # three optimisers, four of the population, three layers
SHARPNESS = 5.0
LOG_POPULATION = (0.0, -2.0)  # powers of two, of all particles
INERTIA = (0.0, 1.2)
LOG_TEMPERATURE = (-3.0, 1.5)  # powers of ten
MAX_DIFFUSION = 0.3  # in half-ranges
# how particles move
ACCELERATION, ALPHA = 2.0, 0.15  # as SAPSO's
FIRST_TEMPERATURE = 1.0  # of a first population, where nothing is refused
MIN_PARTICLES = 4  # that move at a time
GREEDY_SHARE = 0.1  # p of JADE: the share of the bests that attract
CROSSOVER_RATE = 0.9  # CR: the share of coordinates that move
NEUTRAL_STRIDE = 0.6  # at which a normal distribution is drawn from as it is
ELITE_SHARE = 0.5  # of the bests, which a normal distribution is estimated from
# what is observed
MIN_SPREAD, MAX_SPREAD = 1e-3, 1.0  # deviations of bests, in half-ranges, that show as 0 and 1
INSTANCE_FEATURES, PROGRESS_FEATURES = 9, 16

State = NDArray[np.float32]


@dataclass(frozen=True)
class ControlAction:
    """The control of one step of Configure-v0; by default all of the population is a swarm."""

    shares: tuple[float, float, float] = (1.0, 0.0, 0.0)  # of the population, by optimiser; they sum to 1
    population: float = 1.0  # share that moves at a time, the best first
    stride: float = 0.6
    temperature: float = 1.0
    restart: float = 0.0  # share that is restarted, the worst first
    diffusion: tuple[float, float, float] = (0.0, 0.0, 0.0)  # standard deviations in half-ranges, by layer


def control_of(action: Array) -> ControlAction:
    """Return the control that an action (10,) in [-1, 1] stands for."""
    _, _, _, power, stride, log_temperature, restart, *kicks = action.tolist()
    weights = np.exp(SHARPNESS * action[:3])
    first, second, third = (weights / weights.sum()).tolist()
    root, near, far = (max(kick, 0.0) * MAX_DIFFUSION for kick in kicks)
    return ControlAction(
        (first, second, third),
        2.0 ** scaled(LOG_POPULATION, min(max(2.0 * power, -1.0), 1.0)),
        scaled(INERTIA, stride),
        10.0 ** scaled(LOG_TEMPERATURE, log_temperature),
        max(restart, 0.0),
        (root, near, far),
    )


def action_of(control: ControlAction) -> Array:
    """Return the action (10,), float64, that stands for a control, but for rounding; -1 stands for nothing.

    Raises ValueError where no action stands for it.
    """
    shares = 1.0 + np.log(np.maximum(np.array(control.shares) / max(control.shares), 1e-9)) / SHARPNESS
    amounts = np.array([control.restart, *np.array(control.diffusion) / MAX_DIFFUSION])
    action = np.array(
        [
            *np.maximum(shares, -1.0),
            0.5 * unscaled(LOG_POPULATION, np.log2(control.population)),
            unscaled(INERTIA, control.stride),
            unscaled(LOG_TEMPERATURE, np.log10(control.temperature)),
            *np.where(amounts > 0.0, amounts, -1.0),
        ]
    )
    if not (np.abs(action) <= 1.0).all():
        raise InputError(f"a control must lie in the range of actions, got {control}")
    return action


class Population:
    """The population that Configure-v0 steers: moved in several ways, in parts, and restarted.

    A step is `begin_step`, and then `ask` and `tell` as long as evaluations are `open`.
    """

    def __init__(
        self, world: World, number: int, generator: np.random.Generator, size: int, steps: int, every: int
    ) -> None:
        self.episode = first_episode(world, number, size * (steps * every + 1))
        self.rng = np.random.default_rng(int(generator.integers(2**63)))
        self.space = self.episode.problem.space
        self.limits = speed_limits(self.space, ALPHA, "symmetric")
        self.swarm = SwarmState(self.space, self.rng, size, self.limits, REDRAWS, "dimension")
        self.size, self.steps, self.every = size, steps, every
        self.left, self.used = steps, 0
        root = 6 if world.translation == "searched" else 3
        half = root + (self.space.dimensions - root + 1) // 2
        self.layers = slice(0, root), slice(root, half), slice(half, None)
        self.control, self.stale, self.open = ControlAction(temperature=FIRST_TEMPERATURE), 0, size
        self.best, self.leader = np.inf, self.swarm.moved[0]
        self._turns: list[tuple[Array, NDArray[np.bool_]]] = []
        self._rows: Rows = np.arange(size)
        self._part = self.swarm

    def begin_step(self, control: ControlAction) -> None:
        """Begin another step."""
        self.control, self._turns, self.open = control, [], self.size * self.every
        self.left -= 1
        self.stale += 1
        restarted = round(control.restart * self.size)
        if restarted:
            swarm, worst = self.swarm, self.swarm.best_cost.argsort(kind="stable")[self.size - restarted :]
            drawn = draw_population(self.space, self.rng, restarted)
            swarm.moved[worst] = swarm.position[worst] = swarm.best[worst] = drawn
            swarm.velocity[worst], swarm.cost[worst], swarm.best_cost[worst] = 0.0, np.inf, np.inf

    def ask(self) -> Array:
        """Return the proposals (n, d) of the next turn: of the whole population, or of its best part.

        Restarted particles come first, and propose where they are.
        """
        swarm, most = self.swarm, self.open % self.size or self.size
        count = min(max(MIN_PARTICLES, round(self.control.population * self.size)), most)
        if count == self.size:
            self._part = part = swarm
        else:
            ranks = np.where(np.isinf(swarm.best_cost), -1.0, swarm.best_cost)
            self._rows = ranks.argsort(kind="stable")[:count]
            self._part = part = swarm.subset(self._rows)
        fresh = np.isinf(part.best_cost)
        restarted = part.best[fresh]
        if not fresh.all():
            self._move(part)
        if len(restarted):
            part.moved[fresh], part.velocity[fresh] = restarted, 0.0
        return part.moved

    def _move(self, part: SwarmState) -> None:
        """Move the particles of a part, each share of them with its optimiser.

        Of n particles the swarm has the first round(n share), differential evolution the next round(n share), or all
        that are left if these are fewer, and the normal distribution has the rest. Halves are rounded to even. A part
        of the population is in the order of its bests, the best first, behind restarted particles, which count but
        stay where they are; the whole population is in its own order, which never changes.
        """
        swarm, control, space, count = self.swarm, self.control, self.space, len(part.moved)
        known = np.flatnonzero(np.isfinite(swarm.best_cost))
        bests = swarm.best[known]
        ranks = swarm.best_cost[known].argsort(kind="stable")
        stride = control.stride * self._cooling(inertia(1, self.steps * self.every) / SAPSO_INERTIA)
        swarm_count = round(control.shares[0] * count)
        apart = min(swarm_count + round(control.shares[1] * count), count)
        if swarm_count:
            part.move(stride, ACCELERATION, bests[ranks[0]])
        if swarm_count < count:
            pieces = [part.moved[:swarm_count]]
            if swarm_count < apart:
                pieces.append(differential(space, self.rng, part.best[swarm_count:apart], bests, ranks, stride))
            if apart < count:
                pieces.append(normal(space, self.rng, bests, ranks, count - apart, stride))
            part.moved = np.concatenate(pieces)
            part.velocity[swarm_count:] = np.clip(displacement(space, part.position, part.moved), *self.limits)[
                swarm_count:
            ]
        if any(control.diffusion):
            spread = np.empty(space.dimensions)
            for layer, deviation in zip(self.layers, control.diffusion, strict=True):
                spread[layer] = deviation
            part.moved = sample_normal(space, self.rng, part.moved, spread)

    def _cooling(self, factor: float) -> float:
        """Return the product of a factor per iteration over the iterations of this step so far."""
        done = self.every - -(-self.open // self.size)
        return float(factor**done)

    def tell(self, costs: Array) -> None:
        """Take the costs (n,) of the turn's proposals, and accept or refuse the moves."""
        part = self._part
        lowest = int(costs.argmin())
        if costs[lowest] < self.best:
            self.best, self.leader, self.stale = float(costs[lowest]), part.moved[lowest].copy(), 0
        accepted, _ = part.accept(part.moved, costs, self.control.temperature * self._cooling(COOLING))
        if part is not self.swarm:
            self.swarm.update(self._rows, part)
        self._turns.append((costs, accepted))
        self.used += len(costs)
        self.open -= len(costs)

    @property
    def costs(self) -> Array:
        """The costs of the last step's proposals (n,)."""
        return np.concatenate([costs for costs, _ in self._turns])

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """Which moves of the last step were accepted (n,)."""
        return np.concatenate([accepted for _, accepted in self._turns])


def differential(
    space: Space, rng: np.random.Generator, points: Array, bests: Array, order: NDArray[np.int64], weight: float
) -> Array:
    """Return feasible trials (k, d) for points (k, d) among n bests (n, d): current to p-best, binomial crossover.

    `order` ranks the bests (n,), the cheapest first; differences count by `weight`. J. Zhang, A. C. Sanderson, JADE:
    adaptive differential evolution with optional external archive, IEEE Trans. Evolutionary Computation 13(5), 2009,
    equation (7), without its archive and with one weight for all.
    """
    k, (n, d) = len(points), bests.shape
    leaders = bests[order[rng.integers(max(1, round(GREEDY_SHARE * n)), size=k)]]
    first, second = rng.integers(n, size=(2, k))
    step = displacement(space, points, leaders) + displacement(space, bests[second], bests[first])
    crossed = rng.random((k, d)) < CROSSOVER_RATE
    crossed[np.arange(k), rng.integers(d, size=k)] = True
    return repair(space, fold(space, points + np.where(crossed, weight * step, 0.0)), bests[order[0]])


def normal(
    space: Space, rng: np.random.Generator, bests: Array, order: NDArray[np.int64], count: int, stride: float
) -> Array:
    """Return feasible draws (count, d) from the normal distribution of the cheaper half of n bests (n, d).

    `order` ranks the bests (n,), the cheapest first. The distribution has their mean and covariance, and is wider by
    `stride` / 0.6: one generation of an estimation of multivariate normal algorithm.
    """
    elite = bests[order[: max(2, round(ELITE_SHARE * len(order)))]]
    offsets = displacement(space, elite[0], elite)
    mean = offsets.mean(axis=0)
    steps = np.empty((count, space.dimensions))
    products(rng.standard_normal((count, len(elite))), offsets - mean, steps)
    wide = stride / NEUTRAL_STRIDE * (steps / np.sqrt(len(elite)))
    return repair(space, fold(space, elite[0] + mean + wide), bests[order[0]])


def instance_features(population: Population) -> Array:
    """Return the features of an instance (9,), in [0, 1]: its silhouettes, and the costs of the first population.

    The means over views of the silhouette's share of the picture, its height, its width, its share of the box around
    it, and of its pixels at an edge; the dimensions / 66; the median and the deviation of the first costs / 100; and
    the correlation of the first costs with the distance to the cheapest, -1 to 1 mapped to 0 to 1.
    """
    silhouettes = population.episode.problem.silhouettes
    shapes = np.array([_shape(silhouette.mask) for silhouette in silhouettes]).mean(axis=0)
    first, costs = population.swarm.best, population.swarm.best_cost
    distances = np.sqrt((displacement(population.space, first[costs.argmin()], first) ** 2).sum(axis=1))
    spread = costs.std() * distances.std()
    slope = float(((costs - costs.mean()) * (distances - distances.mean())).mean() / spread) if spread > 0.0 else 0.0
    landscape = [population.space.dimensions / 66.0, np.median(costs) / 100.0, costs.std() / 100.0, 0.5 + 0.5 * slope]
    return np.concatenate([shapes, landscape])


def _shape(mask: NDArray[np.bool_]) -> list[float]:
    count = int(np.count_nonzero(mask))
    if not count:
        return [0.0] * 5
    left, top, right, bottom = box_of(mask)
    tall, wide = bottom - top, right - left
    cross = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))
    inner = cv2.erode(mask.astype(np.uint8), cross, borderType=cv2.BORDER_CONSTANT, borderValue=0)
    edge = 1.0 - np.count_nonzero(inner) / count
    return [count / mask.size, tall / mask.shape[0], wide / mask.shape[1], count / (tall * wide), edge]


def observed_state(features: Array, population: Population) -> State:
    """Return the observation (25,) of an instance's features and of the progress of a search."""
    swarm, costs, control = population.swarm, population.costs, population.control
    spreads = swarm.best.std(axis=0)
    layers = [max(float(spreads[layer].mean()), MIN_SPREAD) / MIN_SPREAD for layer in population.layers]
    shown = population.best, float(swarm.best_cost.min()), costs.min(), costs.mean(), costs.std()
    progress = [
        *(log_cost(cost) for cost in shown),
        *(float(np.log(spread) / np.log(MAX_SPREAD / MIN_SPREAD)) for spread in layers),
        float(np.abs(swarm.velocity).mean()) / ALPHA,
        float(population.accepted.mean()),
        population.left / population.steps,
        min(population.stale / 10.0, 1.0),
        *control.shares,
        control.population,
    ]
    return np.asarray(np.clip([*features, *progress], 0.0, 1.0), dtype=np.float32)
