"""A scene is followed with a method: what `posefit.track`, `posefit fit` and every cell of a sweep come to."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from posefit.fitting.shape import NAMES, Shape
from posefit.fitting.tracker import Frame, Task
from posefit.footage.scene import Scene
from posefit.listening import QUIET, Listener
from posefit.motion.motion import Motion
from posefit.tracking.evaluation import Evaluation
from posefit.tracking.measures import Measures
from posefit.tracking.method import Choice, Method, prepare
from posefit.tracking.opening import Opening, opened, task_of
from posefit.tracking.outputs import Nowhere, Output
from posefit.version import __version__


@dataclass(frozen=True, eq=False)
class Track:
    """A followed motion and what it is worth."""

    motion: Motion  # the estimate
    truth: Motion | None = field(repr=False)
    measures: Measures
    frames: list[dict[str, float]] = field(repr=False)  # one row a frame: see posefit.tracking.measures.FRAME
    summary: dict[str, Any] = field(repr=False)  # what `posefit track --json` prints
    found: list[Frame] = field(repr=False)  # what the tracker yielded


def follow(
    scene: Scene,
    training: Sequence[Motion],
    *,
    choice: Choice | None = None,
    opening: Opening | None = None,
    seed: int = 0,
    threads: int = 1,
    output: Output | None = None,
    listener: Listener = QUIET,
    source: Mapping[str, Any] | None = None,
) -> Track:
    """Return a scene's motion followed by a method that learns from `training`, with what it is worth.

    `output` gets every frame as it comes and everything at the end; `source` is what the summary says of where the
    scene is from. Raises ValueError where something does not fit.
    """
    choice, opening = choice or Choice(), opening or Opening()
    if seed < 0:
        raise ValueError(f"seed must be 0 or more, got {seed}")
    with threadpool_limits(1):  # an optimiser's matrices are small: BLAS is slower with more threads
        for warning in scene.warnings:
            listener.say(f"warning: {warning}")
        task = task_of(scene, opening, training, choice.budget(), threads)
        method = prepare(choice, task)
        task, shape = opened(scene, method, task, opening, seed, listener)
        scene = replace(scene, body=task.body)
        method.audit.forget()  # what was tried before the first frame is in no row
        output = output or Nowhere()
        found = _found(scene, method, task, output, seed, listener)
        evaluation = Evaluation(scene, method.prior, task.angles, method.beta)
        for warning in method.audit.warnings:
            listener.say(f"warning: {warning}")
        for frame, observation in zip(found, scene.observations, strict=True):
            evaluation.add(frame, observation)
        rows, measures = evaluation.close()
        estimate = Motion(
            scene.name,
            scene.body.skeleton,
            np.array([frame.pose for frame in found]),
            np.array([frame.translation for frame in found]),
            scene.fps,
        )
        summary = {
            "motion": scene.name,
            **(source or {}),
            "method": method.name,
            "seed": seed,
            "frames": len(found),
            **measures.as_dict(),
            **({"history": found[0].history.tolist()} if len(found) == 1 else {}),
            "evaluations_per_frame": task.evaluations,
            "version": __version__,
            "train": [motion.name for motion in training],
            "translation": task.translation,
            "first_pose": opening.first_pose,
            "views": len(scene.cameras),
            "camera": scene.placing,
            "size": [scene.cameras[0].width, scene.cameras[0].height],
            "fps": scene.fps,
            "settings": method.settings,
            "body": None if shape is None else _described(shape),
            "warnings": [*scene.warnings, *method.audit.warnings],
        }
        output.finish(scene, estimate, found, rows, summary)
    return Track(estimate, scene.truth, measures, rows, summary, found)


def _found(scene: Scene, method: Method, task: Task, output: Output, seed: int, listener: Listener) -> list[Frame]:
    """Return what is found in all frames, each recorded as it comes; those that were found before stay as they are."""
    found, state = output.earlier()
    rng = np.random.default_rng(seed)
    if state is not None:
        rng.bit_generator.state = state
        listener.say(f"going on from frame {len(found)} of {scene.count}")
        last = found[-1]
        task = replace(task, yaw=float(last.pose[0]), first_pose=last.pose[3:], before=tuple(found))
    rest = (scene.observations[k] for k in range(len(found), scene.count))
    results = method.tracker(task).track(rest, rng) if len(found) < scene.count else iter(())
    for frame in listener.progress(results, scene.count - len(found)):
        output.record(frame, dict(rng.bit_generator.state))
        found.append(frame)
    return found


def _described(shape: Shape) -> dict[str, Any]:
    """Return a build as the summary gives it."""
    return {
        "stature": shape.body.stature,
        "cost": shape.cost,
        "factors": dict(zip(NAMES, shape.factors.tolist(), strict=True)),
        "spread": dict(zip(NAMES, shape.spread.tolist(), strict=True)),
    }
