"""How well a person's build is found: `python -m posefit_experiments.builds`.

Synthetic subjects whose bones and radii are each up to 10 % off the average, and who are up to 10 % taller or smaller.
"""

from dataclasses import replace

import numpy as np

from posefit.footage.scene import synthetic
from posefit.geometry.body import Body, varied
from posefit.geometry.skeleton import BONES
from posefit.motion import library
from posefit.tracking.method import Choice, prepare
from posefit.tracking.opening import BODY_FRAMES, built, following
from posefit.tracking.synthetic import SIZE, task_of

PERCENT = 10.0
SUBJECTS = range(8)
SETUPS = {
    "1 view, stature given": ([90.0], True),
    "1 view, root known": ([90.0], False),
    "2 views": ([0.0, 90.0], False),
    "4 views": ([0.0, 45.0, 90.0, 135.0], False),
}
LIMBS = {
    "thigh": ("lfemur",),
    "shank": ("ltibia",),
    "upper arm": ("lhumerus",),
    "forearm": ("lradius",),
    "forearm and hand": ("lradius", "lwrist", "lhand"),
}


def subject(seed: int) -> Body:
    """Return a person of another build."""
    rng = np.random.default_rng([7, seed])
    body = varied(Body.of(library.average_skeleton()), PERCENT, rng)
    scale = rng.uniform(0.9, 1.1)
    return body.scaled(scale, scale)


def study(motion: str = "walk-b") -> None:
    """Print how far stature and limbs are off, before and after the fit."""
    choice, average = Choice(prior="loose"), Body.of(library.average_skeleton())
    for name, (views, given) in SETUPS.items():
        errors: list[list[float]] = []
        untouched: list[list[float]] = []
        for seed in SUBJECTS:
            true = subject(seed)
            walk = library.built_in(motion)
            walk = replace(walk, skeleton=true.skeleton)
            scene = synthetic(walk, views, SIZE, [], (None, None))
            scene = replace(scene, body=true, observations=replace(scene.observations, body=true))  # type: ignore[type-var]
            height = true.stature if given else None
            start = average if height is None else average.scaled(*[height / average.stature] * 2)
            mode = "known" if name.endswith("known") else "aligned"
            task = task_of(scene, choice, start, translation=mode)
            shape = built(
                task,
                scene.observations,
                following(prepare(choice, task)),
                BODY_FRAMES,
                height,
                seed,
            )
            assert shape is not None
            errors.append(_off(shape.body, true))
            untouched.append(_off(start, true))
        for label, rows in (("fitted", errors), ("average", untouched)):
            means, worst = np.mean(rows, axis=0), np.max(rows, axis=0)
            parts = [
                f"{part} {mean:.1f} (at most {most:.1f})"
                for part, mean, most in zip(("stature", *LIMBS), means, worst, strict=True)
            ]
            print(f"{name:22} {label:8} % off: {', '.join(parts)}", flush=True)


def _off(body: Body, true: Body) -> list[float]:
    """Return by how many percent stature and limbs are off."""
    limbs = [[BONES.index(bone) for bone in bones] for bones in LIMBS.values()]
    lengths, others = ([one.stature, *(one.skeleton.lengths[limb].sum() for limb in limbs)] for one in (body, true))
    return [100.0 * abs(length / other - 1.0) for length, other in zip(lengths, others, strict=True)]


if __name__ == "__main__":
    study()
