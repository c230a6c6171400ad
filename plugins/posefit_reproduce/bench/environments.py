"""How long a step of environments takes, natively and one by one."""

from collections.abc import Callable
from typing import Any

import numpy as np

from posefit_reproduce.bench.kernel import fastest

ENVIRONMENTS = 40
EPISODE = 40  # steps of a learner's episodes
ENDLESS: dict[str, Any] = {"max_evaluations": 10**9, "target_cost": -1.0}
# by name: the environment, and its arguments; without an instance each environment has one of its own
CASES: dict[str, tuple[str, dict[str, Any]]] = {
    "fit_shared": ("FitImage-v0", ENDLESS | {"instance": 3}),
    "fit_each": ("FitImage-v0", ENDLESS),
    "track_each": ("Track-v0", {"frames": 2, "evaluations_per_frame": 10**9}),
    "configure_each": ("Configure-v0", {"iterations": 10**9}),
}


def vector_env(threads: int) -> dict[str, dict[str, float]]:
    """Return what a step of 40 environments takes a proposal, in microseconds: natively, and one by one.

    In `fit_shared` all have one instance, elsewhere each has its own. `kernel_us` is the cost of as many proposals
    through the library. In `configure_all_threads` so many `threads` draw. `fit_learning` is what a learner has: random
    instances, episodes of 40 steps, and their resets, in steps a second. The environments are found by name, as by
    users.
    """
    kernel, vectors = _kernel(), {name: _pair(env, arguments) for name, (env, arguments) in CASES.items()}
    vectors["configure_all_threads"] = _pair(*CASES["configure_each"], threads)
    learning = _pair("FitImage-v0", {"max_evaluations": EPISODE, "target_cost": -1.0})
    jobs: dict[str, Callable[[], object]] = {"kernel": kernel}
    for name, envs in vectors.items():
        jobs |= {f"{name} {kind}": _steps(env, 1) for kind, env in envs.items()}
    jobs |= {f"learning {kind}": _steps(env, EPISODE + 1) for kind, env in learning.items()}
    seconds = fastest(jobs)
    figures = {}
    for name, envs in vectors.items():
        proposals = ENVIRONMENTS * _evaluations(envs["native"].unwrapped)
        native, sync = (1e6 * seconds[f"{name} {kind}"] / proposals for kind in envs)
        kernel_us = 1e6 * seconds["kernel"] / ENVIRONMENTS
        figures[name] = {
            "kernel_us": kernel_us,
            "us_per_proposal": native,
            "overhead_us": native - kernel_us,
            "sync_us_per_proposal": sync,
            "times_sync": sync / native,
        }
    steps = {kind: ENVIRONMENTS * EPISODE / seconds[f"learning {kind}"] for kind in learning}
    figures["fit_learning"] = {
        "steps_per_second": steps["native"],
        "sync_steps_per_second": steps["sync"],
        "times_sync": steps["native"] / steps["sync"],
    }
    for env in [env for envs in (*vectors.values(), learning) for env in envs.values()]:
        env.close()
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
    """Return what makes so many random steps."""
    actions = np.random.default_rng(0).uniform(-1.0, 1.0, (count, *env.action_space.shape)).astype(np.float32)

    def job() -> None:
        for action in actions:
            env.step(action)

    return job


def _kernel() -> Callable[[], object]:
    """Return what evaluates as many proposals as there are environments, through the library."""
    import gymnasium

    env: Any = gymnasium.make_vec("posefit_envs:posefit/FitImage-v0", 1).unwrapped
    env.reset(seed=0)
    problem = env.problems[0]
    proposals = np.random.default_rng(0).uniform(-1.0, 1.0, (ENVIRONMENTS, problem.space.dimensions))
    return lambda: problem.evaluate(proposals)


def _evaluations(env: Any) -> int:
    """Return how many proposals one environment evaluates in a step."""
    return int(getattr(env, "population_size", 1)) * int(getattr(env, "every", 1))
