"""The tracker by name: its settings, checked."""

import importlib
import math
from functools import partial
from typing import cast

import numpy as np

from posefit import settings
from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.tracker import Task
from posefit.registry import registry
from posefit_exemplars.beam import Steps, Transition, Transitions, transition_costs
from posefit_exemplars.exemplars import exemplars_of
from posefit_exemplars.refinement import Make
from posefit_exemplars.tracker import REFINED, ExemplarTracker

MIN_EVALUATIONS = 300  # of a frame, so that each stage has some


def exemplars(
    task: Task,
    *,
    spread: float = 0.03,
    turning_degrees: float = 4.0,
    jump: float = 12.0,
    temperature: float = 2.0,
    straying: float = 0.01,
    depth: float = 0.03,
    pace: float = 0.008,
    lag: int = 15,
    mirrored: bool = True,
    refiner: str = "cma",
    pull: float = 0.3,
    smoothing: float = 1.0,
    transitions: str = "clips",
    samples: int = 24,
    posterior_temperature: float = 8.0,
) -> ExemplarTracker:
    """The likeliest path through recorded clips (Toyama and Blake, 2001).

    Distances and turns in the settings are for a thirtieth of a second, whatever the frame rate.

    Settings:
        spread: distance of joints from where a clip goes on, metres, root mean square; above 0.
        turning_degrees: standard deviation of turns away from the clip; above 0.
        jump: cost of a step to any other pose, in units of cost over the temperature; 0 or more.
        temperature: divides silhouette costs; above 0. Errors of successive frames are correlated, so more than 1.
        straying: distance of an aligned root from where its clip goes on, to the side or up, metres; above 0.
        depth: the same towards or away from a single camera, metres; above 0.
        pace: distance of a known root from where its clip goes on, metres; above 0.
        lag: later frames that are used before a pose is reported, 0 or more.
        mirrored: whether the mirror images of all clips are learned from as well.
        refiner: the optimiser that searches around the path, or "none".
        pull: cost of a standard deviation away from the path, beside the silhouette, 0 or more.
        smoothing: standard deviation of the smoothing of angles over time, in thirtieths of a second, 0 or more.
        transitions: the costs of steps: "clips", or MODULE:FUNCTION, which is called with a `Transition`.
        samples: tracks drawn from the posterior, 0 or more; with 0 frames have no probability of being lost.
        posterior_temperature: divides silhouette costs in that posterior; above 0.
    """
    for name, value in (
        ("spread", spread),
        ("turning_degrees", turning_degrees),
        ("temperature", temperature),
        ("posterior_temperature", posterior_temperature),
        ("straying", straying),
        ("depth", depth),
        ("pace", pace),
    ):
        if not 0.0 < value < math.inf:
            raise InputError(f"{name} must be above 0 and finite, got {value}")
    for name, value in (("jump", jump), ("pull", pull), ("smoothing", smoothing)):
        if not 0.0 <= value < math.inf:
            raise InputError(f"{name} must be 0 or more and finite, got {value}")
    if task.evaluations < MIN_EVALUATIONS:
        raise InputError(f"evaluations must be at least {MIN_EVALUATIONS} for exemplars, got {task.evaluations}")
    for name, count in (("lag", lag), ("samples", samples)):
        if count < 0:
            raise InputError(f"{name} must be 0 or more, got {count}")
    power = temperature / posterior_temperature
    intervals = 30.0 / task.fps  # of a thirtieth of a second, for which the settings are meant, in a frame
    temperature /= intervals
    slack = math.sqrt(intervals)
    fastest = math.inf if task.fastest_turn is None else task.fastest_turn / task.fps
    steps = Steps(
        spread * slack, math.radians(turning_degrees) * slack, jump, straying, depth, pace * intervals, fastest
    )
    states = exemplars_of(task.training, task.body.skeleton, mirrored)
    costs = partial(transition_costs, steps=steps) if transitions == "clips" else partial(_checked, _named(transitions))
    make = _maker(task, refiner)
    return ExemplarTracker(task, states, steps, costs, temperature, lag, make, pull, smoothing, samples, power)


def _maker(task: Task, refiner: str) -> Make | None:
    """Return what makes the optimiser of a frame. Raises ValueError where there is none of that name."""
    if refiner == "none":
        return None
    factory = registry().optimiser(refiner)
    return partial(factory, **settings.planned(factory, {}, int(REFINED * task.evaluations)))


def _named(name: str) -> Transitions:
    """Return the function MODULE:FUNCTION. Raises ValueError where there is none."""
    module, _, function = name.partition(":")
    try:
        found = getattr(importlib.import_module(module), function)
    except (ImportError, AttributeError, ValueError) as error:
        raise InputError(
            f"transitions must be clips or MODULE:FUNCTION that can be imported, got {name}: {error}"
        ) from None
    if not callable(found):
        raise InputError(f"transitions must name a function, got {name}, which is a {type(found).__name__}")
    return cast(Transitions, found)


def _checked(transitions: Transitions, transition: Transition) -> Array:
    """Return the costs of a model of transitions. Raises ValueError where they are not one finite number a step."""
    costs, shape = np.asarray(transitions(transition), dtype=np.float64), (len(transition.before), len(transition.beam))
    if costs.shape != shape or not np.isfinite(costs).all():
        raise InputError(f"transitions must return finite costs of shape {shape}, got shape {costs.shape}")
    return costs
