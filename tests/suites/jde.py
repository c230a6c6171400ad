"""jDE, written with no more than the protocol of an optimiser.

J. Brest, S. Greiner, B. Bošković, M. Mernik, V. Žumer, Self-adapting control parameters in differential evolution, IEEE
Transactions on Evolutionary Computation 10, 2006: rand/1/bin, F and CR of each individual drawn anew with probability
0.1, F from 0.1 to 1.
"""

import numpy as np


class JDE:
    def __init__(self, space, rng, *, population_size=20):
        self.rng, self.shape = rng, (population_size, space.dimensions)
        self.population = rng.uniform(-1.0, 1.0, self.shape)
        self.costs, self.f, self.cr = (
            np.full(population_size, np.inf),
            np.full(population_size, 0.5),
            np.full(population_size, 0.9),
        )
        self.next = self.population, self.f, self.cr

    def ask(self):
        return self.next[0].copy()

    def tell(self, proposals, costs):
        better = costs <= self.costs
        self.population = np.where(better[:, None], proposals, self.population)
        self.costs = np.where(better, costs, self.costs)
        self.f, self.cr = np.where(better, self.next[1], self.f), np.where(better, self.next[2], self.cr)
        n, d = self.shape
        f = np.where(self.rng.random(n) < 0.1, 0.1 + 0.9 * self.rng.random(n), self.f)
        cr = np.where(self.rng.random(n) < 0.1, self.rng.random(n), self.cr)
        a, b, c = np.array([self.rng.permutation(np.delete(np.arange(n), i))[:3] for i in range(n)]).T
        mutants = self.population[a] + f[:, None] * (self.population[b] - self.population[c])
        crossed = self.rng.random((n, d)) < cr[:, None]
        crossed[np.arange(n), self.rng.integers(d, size=n)] = True
        self.next = np.where(crossed, np.clip(mutants, -1.0, 1.0), self.population), f, cr
