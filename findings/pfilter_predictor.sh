#!/bin/sh
# pfilter 0.2.5: ParticleFilter.copy loses the noise, so that `predictor` is as sure of the future as of now.
#
# `copy` passes on every function but `noise_fn`, though it promises an exact copy, and `predictor` runs such a copy
# ahead. For a random walk that spreads by 1 a step, nine steps without observations give particles a standard
# deviation of 3.2 in the filter, and 1.0 in its copy and its predictor, that of the first step. The argument
# `observed` of `predictor` is not used either. Set `noise_fn` of a copy, and update it yourself: `observed` in the
# first step, None afterwards.
#
# Ends with 0 while it is so, and with 1 once it is not.
set -eu
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
"${PYTHON:-python3}" -m venv "$folder/venv"
"$folder/venv/bin/python" -m pip install --quiet pfilter==0.2.5 numpy==2.4.6 scipy==1.17.1
cd "$folder"
venv/bin/python - <<'PYTHON'
from importlib.metadata import version

import numpy as np
from pfilter import ParticleFilter

print("pfilter", version("pfilter"))
rng = np.random.default_rng(1)


def spread(states):
    return states + rng.normal(0.0, 1.0, states.shape)


def likeness(expected, seen):
    return np.exp(-2.0 * (expected - seen).ravel() ** 2)


def walk():
    """Return a random walk that begins with a standard deviation of 1."""
    return ParticleFilter(
        prior_fn=lambda n: rng.normal(0.0, 1.0, (n, 1)),
        n_particles=4000,
        noise_fn=spread,
        weight_fn=likeness,
    )


def after(steps, particles):
    for _ in range(steps):
        particles.update(None)
    return float(particles.particles.std())


*_, last = walk().predictor(9)
again = walk().copy()
again.noise_fn = spread
deviations = {
    "filter": after(9, walk()),
    "copy": after(9, walk().copy()),
    "predictor": float(last.particles.std()),
    "copy with its noise": after(9, again),
}
for name, deviation in deviations.items():
    print(f"{name}: a standard deviation of {deviation:.2f} after nine steps")
first = next(walk().predictor(1, observed=np.array([3.0])))
told = walk()
told.update(np.array([3.0]))
means = [float(first.mean_state[0]), float(told.mean_state[0])]
print(f"mean given 3: predictor {means[0]:.2f}, filter {means[1]:.2f}")
unchanged = np.allclose(list(deviations.values()), [3.16, 1.0, 1.0, 3.16], rtol=0.1)
unchanged = unchanged and abs(means[0]) < 0.2 and means[1] > 2.0
raise SystemExit(not unchanged)
PYTHON
