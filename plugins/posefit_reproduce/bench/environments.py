"""How long a step of environments takes, natively and one by one."""

from collections.abc import Callable
from typing import Any

import numpy as np

from posefit_reproduce.bench.kernel import fastest

ENVIRONMENTS = 40
EPISODE = 40  # steps of a learner's episodes
ENDLESS: dict[str, Any] = {"max_evaluations": 10**9}
# by name: the environment, and its arguments; without an instance each environment has one of its own
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "fit_shared": ("FitImage-v0", ENDLESS | {"instance": 3}),
    "fit_each": ("FitImage-v0", ENDLESS),
    "track_each": ("Track-v0", {"frames": 2, "evaluations_per_frame": 10**9}),
    "race_each": ("Race-v0", {"generations": (10**9, 10**9)}),
}
LEARNING: dict[str, tuple[str, dict[str, Any]]] = {
    "fit_learning": ("FitImage-v0", {"max_evaluations": EPISODE}),
    "race_learning": ("Race-v0", {"generations": (EPISODE, EPISODE)}),
}


def vector_env(threads: int) -> dict[str, dict[str, float]]:
    """Return what a step of 40 environments takes a proposal, in microseconds: natively, and one by one.

    In `fit_shared` all have one instance, elsewhere each has its own. `kernel_us` is the cost of as many proposals
    through the library. In `race_all_threads` so many `threads` draw. `fit_learning` and `race_learning` are what
    a learner has: random instances, episodes of 40 steps, and their resets, in steps a second. The environments are
    found by name, as by users.
    """
    vectors = {name: _pair(*case) for name, case in CASES.items()}
    vectors["race_all_threads"] = _pair(*CASES["race_each"], threads)
    vectors |= {name: _pair(*case) for name, case in LEARNING.items()}
    problem = vectors["fit_each"]["native"].unwrapped.problems[0]
    proposals = np.random.default_rng(0).uniform(-1.0, 1.0, (ENVIRONMENTS, problem.space.dimensions))
    jobs: dict[str, Callable[[], object]] = {"kernel": lambda: problem.evaluate(proposals)}
    for name, envs in vectors.items():
        steps = EPISODE + 1 if name in LEARNING else 1
        jobs |= {f"{name} {kind}": _steps(env, steps) for kind, env in envs.items()}
    seconds = fastest(jobs)
    kernel_us, figures = 1e6 * seconds["kernel"] / ENVIRONMENTS, {}
    for name, envs in vectors.items():
        native, sync = (seconds[f"{name} {kind}"] for kind in envs)
        env = envs["native"].unwrapped
        evaluations = ENVIRONMENTS * int(getattr(env, "population_size", 1))
        if name in LEARNING:
            steps = ENVIRONMENTS * EPISODE
            figures[name] = {"steps_per_second": steps / native, "sync_steps_per_second": steps / sync}
        else:
            native_us = 1e6 * native / evaluations
            figures[name] = {"kernel_us": kernel_us, "us_per_proposal": native_us, "overhead_us": native_us - kernel_us}
            figures[name]["sync_us_per_proposal"] = 1e6 * sync / evaluations
        figures[name]["times_sync"] = sync / native
        for one in envs.values():
            one.close()
    return figures


def _pair(name: str, arguments: dict[str, Any], threads: int = 1) -> dict[str, Any]:
    """Return a vector environment of ours, which draws with so many threads, and Gymnasium's, reset."""
    import gymnasium

    full = f"posefit_envs:posefit/{name}"
    made: dict[str, Any] = {
        "native": gymnasium.make_vec(full, ENVIRONMENTS, threads=threads, **arguments),
        "sync": gymnasium.make_vec(full, ENVIRONMENTS, "sync", **arguments),
    }
    for env in made.values():
        env.reset(seed=0)
    return made


def _steps(env: Any, count: int) -> Callable[[], None]:
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (count, *env.action_space.shape)).astype(np.float32)

    def job() -> None:
        for action in actions:
            env.step(action)

    return job
