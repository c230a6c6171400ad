"""The search that Configure-v1 steers: a population that is moved in several ways, in parts, and restarted."""

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.box import REDRAWS, displacement, draw_population, sample_normal
from posefit_envs.configure import ACCELERATION, ALPHA, FIRST
from posefit_envs.configuring.moves import differential, normal
from posefit_envs.configuring.orders import Order
from posefit_envs.drawing import Picture, portray
from posefit_envs.fit import Episode
from posefit_envs.instance import World
from posefit_swarm.sapso import COOLING
from posefit_swarm.swarm import INERTIA, SwarmState, inertia, speed_limits

LEAST = 4  # particles that move at a time

Rows = NDArray[np.int64]


class Herd:
    """A population in the middle of its search: whoever holds it asks for proposals, and tells what they cost.

    A step is `follow`, and then `ask` and `tell` as long as something is `open`.
    """

    def __init__(
        self, world: World, number: int, generator: np.random.Generator, population_size: int, steps: int, every: int
    ) -> None:
        self.episode = Episode(world, number, population_size * (steps * every + 1))
        self.rng = np.random.default_rng(int(generator.integers(2**63)))
        self.space = self.episode.space
        self.limits = speed_limits(self.space, ALPHA, "symmetric")
        self.flock = SwarmState(self.space, self.rng, population_size, self.limits, REDRAWS, "dimension")
        self.population_size, self.steps, self.every = population_size, steps, every
        self.left, self.used = steps, 0
        root = 6 if world.translation == "searched" else 3
        half = root + (self.space.dimensions - root + 1) // 2
        self.layers = slice(0, root), slice(root, half), slice(half, None)
        self.order, self.stale, self.open = Order(temperature=FIRST), 0, population_size
        self.best, self.leader = np.inf, self.flock.moved[0]
        self._told: list[tuple[Array, NDArray[np.bool_]]] = []
        self._rows: Rows = np.arange(population_size)
        self._part = self.flock

    def follow(self, order: Order) -> None:
        """Begin another step."""
        self.order, self._told, self.open = order, [], self.population_size * self.every
        self.left -= 1
        self.stale += 1
        anew = round(order.restart * self.population_size)
        if anew:
            flock, worst = self.flock, self.flock.best_cost.argsort(kind="stable")[self.population_size - anew :]
            flock.moved[worst] = flock.position[worst] = flock.best[worst] = draw_population(self.space, self.rng, anew)
            flock.velocity[worst], flock.cost[worst], flock.best_cost[worst] = 0.0, np.inf, np.inf

    def ask(self) -> Array:
        """Return the proposals (n, d) of the next turn: of the whole population, or of its best part.

        Particles that begin anew come first, and propose where they are.
        """
        flock, most = self.flock, self.open % self.population_size or self.population_size
        count = min(max(LEAST, round(self.order.population * self.population_size)), most)
        if count == self.population_size:
            self._part = part = flock
        else:
            ranks = np.where(np.isinf(flock.best_cost), -1.0, flock.best_cost)
            self._rows = ranks.argsort(kind="stable")[:count]
            self._part = part = flock.subset(self._rows)
        fresh = np.isinf(part.best_cost)
        anew = part.best[fresh]
        if not fresh.all():
            self._move(part)
        if len(anew):
            part.moved[fresh], part.velocity[fresh] = anew, 0.0
        return part.moved

    def _move(self, part: SwarmState) -> None:
        """Move the particles of a part, whose shares become whole numbers of them in the order of the optimisers.

        Of n particles the swarm has the first round(n share), differential evolution the next round(n share), or all
        that are left if these are fewer, and the normal distribution has the rest. Halves are rounded to even. A part
        of the population is in the order of its bests, the best first, behind those that begin anew; the whole
        population is in its own order, which never changes. Who begins anew is counted, and proposes where he is.
        """
        flock, order, space, count = self.flock, self.order, self.space, len(part.moved)
        known = np.flatnonzero(np.isfinite(flock.best_cost))
        bests = flock.best[known]
        ranks = flock.best_cost[known].argsort(kind="stable")
        stride = order.stride * self._cooler(inertia(1, self.steps * self.every) / INERTIA)
        swarm = round(order.shares[0] * count)
        apart = min(swarm + round(order.shares[1] * count), count)
        if swarm:
            part.move(stride, ACCELERATION, bests[ranks[0]])
        if swarm < count:
            pieces = [part.moved[:swarm]]
            if swarm < apart:
                pieces.append(differential(space, self.rng, part.best[swarm:apart], bests, ranks, stride))
            if apart < count:
                pieces.append(normal(space, self.rng, bests, ranks, count - apart, stride))
            part.moved = np.concatenate(pieces)
            part.velocity[swarm:] = np.clip(displacement(space, part.position, part.moved), *self.limits)[swarm:]
        if any(order.diffusion):
            spread = np.empty(space.dimensions)
            for layer, deviation in zip(self.layers, order.diffusion, strict=True):
                spread[layer] = deviation
            part.moved = sample_normal(space, self.rng, part.moved, spread)

    def _cooler(self, factor: float) -> float:
        """Return what a number that falls by a factor an iteration has fallen by in this step."""
        done = self.every - -(-self.open // self.population_size)
        return float(factor**done)

    def tell(self, costs: Array) -> None:
        """Settle the turn, whose proposals have these costs (n,)."""
        part = self._part
        lowest = int(costs.argmin())
        if costs[lowest] < self.best:
            self.best, self.leader, self.stale = float(costs[lowest]), part.moved[lowest].copy(), 0
        accepted, _ = part.accept(part.moved, costs, self.order.temperature * self._cooler(COOLING))
        if part is not self.flock:
            self.flock.update(self._rows, part)
        self._told.append((costs, accepted))
        self.used += len(costs)
        self.open -= len(costs)

    def portrait(self) -> Picture:
        """Return the picture (height, width, 3) of the best pose."""
        scenery = self.episode.scenery
        poses, places = scenery.problem(self.space).decode(self.leader[None])
        return portray(scenery, poses[0], places[0], f"best {self.best:.1f}, {self.used} evaluations")

    @property
    def costs(self) -> Array:
        """What the proposals of the last step cost (particles,)."""
        return np.concatenate([costs for costs, _ in self._told])

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """Which moves of the last step were accepted (particles,)."""
        return np.concatenate([accepted for _, accepted in self._told])
