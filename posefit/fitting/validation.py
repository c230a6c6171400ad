"""Checks what optimisers, priors and trackers of plugins return.

A broken rule ends the search with one line that names the plugin. The evaluations, areas and cost of a tracker's
frames are compared with what is counted and computed here, and put right.
"""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from traceback import extract_tb
from typing import Any, Self

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.box import Space
from posefit.fitting.optimiser import BudgetError, Optimiser
from posefit.fitting.prior import Prior
from posefit.fitting.tracker import Frame, Observation, Task, Tracker
from posefit.geometry.skeleton import Skeleton
from posefit.limits import timed
from posefit.reading import quoted
from posefit.silhouette.cost import pose_costs
from posefit.silhouette.drawn import PoseCount, uncounted

UNCOUNTED_POSES = 10  # ours: a frame may draw so many beyond its evaluations, as to draw its result once more
COST_TOLERANCE = 1e-6  # ours: costs are rounded where they are added up in another order


POSEFIT = Path(__file__).parents[1]  # whose lines are not a plugin's


class BrokenRuleError(InputError):
    """A plugin broke one of the rules that its kind has to keep; it is shown in one line, as a user's mistake."""


class CheckedOptimiser:
    """An optimiser whose proposals are checked; errors name it by `name`.

    `limit` is how many seconds an `ask` or a `tell` may take, where `posefit.limits.timed` can measure that.
    `evaluations` is the budget of a search, which has to hold the first population.
    """

    def __init__(
        self,
        optimiser: Optimiser,
        space: Space,
        name: str,
        limit: float | None = None,
        evaluations: int | None = None,
    ) -> None:
        self._optimiser, self._space, self._name, self._limit = optimiser, space, name, limit
        self._evaluations, self._first, self._drawn = evaluations, True, PoseCount()

    def ask(self) -> Array:
        """Return the optimiser's next population. Raises BrokenRuleError where it is none."""
        with self._called("ask"):
            proposals = self._optimiser.ask()
        self._check(proposals)
        count, budget = len(proposals), self._evaluations
        if self._first and not count:
            raise self._broken("ask must return a first population of one proposal or more, got none")
        if self._first and budget is not None and count > budget:
            raise BudgetError(f"{self._name}: evaluations must hold one population of {count}, got {budget}")
        return proposals

    def _check(self, proposals: Array) -> None:
        """Raise BrokenRuleError where proposals are not (n, d) numbers in the box."""
        plain = type(proposals) is np.ndarray  # neither a matrix nor a masked array, which calculate otherwise
        if not plain or proposals.shape[1:] != (self._space.dimensions,):
            came = f"shape {proposals.shape}" if plain else type(proposals).__name__
            raise self._broken(f"ask must return an array of shape (n, {self._space.dimensions}), got {came}")
        if proposals.dtype.kind != "f":
            raise self._broken(f"ask must return numbers of type float64, got {proposals.dtype}")
        farthest = np.abs(proposals).max(initial=0.0)
        if np.isnan(farthest):
            raise self._broken("ask must return finite proposals, got nan")
        if farthest > 1.0:
            raise self._broken(f"ask must return proposals in [-1, 1], got {proposals.flat[abs(proposals).argmax()]}")

    def tell(self, proposals: Array, costs: Array) -> None:
        """Pass the costs on."""
        self._first = False
        with self._called("tell"):
            self._optimiser.tell(proposals, costs)

    def advance(self, space: Space) -> None:
        """Pass the next frame's space on."""
        self._space, self._first = space, True
        with self._called("advance"):
            self._optimiser.advance(space)  # type: ignore[attr-defined]

    @contextmanager
    def _called(self, what: str) -> Iterator[None]:
        """Raise BrokenRuleError where the body fails, or draws poses: all evaluations are the search's."""
        with self._drawn.counting(), plugin_errors(self._name, what, self._limit):
            yield
        if self._drawn.poses:
            raise self._broken(f"{what} must leave evaluations to the search, got {self._drawn.poses:g} of its own")

    def _broken(self, rule: str) -> BrokenRuleError:
        return BrokenRuleError(f"{self._name}: {rule}")


@contextmanager
def plugin_errors(
    name: str, what: str, limit: float | None = None, passed: tuple[type[BaseException], ...] = ()
) -> Iterator[None]:
    """Raise BrokenRuleError, naming the plugin, for whatever the body raises, SystemExit too, but for what is `passed`.

    A BrokenRuleError stays as it is: it names another plugin, which this one called.
    """
    try:
        with timed(limit):
            yield
    except BrokenRuleError:
        raise
    except passed as error:
        if isinstance(error, ValueError) and not isinstance(error, InputError):
            raise InputError(str(error)) from error  # a plugin's own check of a setting
        raise
    except (Exception, SystemExit) as error:
        if limit is not None and isinstance(error, TimeoutError):
            raise BrokenRuleError(f"{name}: {what} must return within {limit:g} s, and did not") from None
        raise _broken_by(name, what, error) from error


def _broken_by(name: str, what: str, error: BaseException) -> BrokenRuleError:
    """Return the error that names the plugin which raised another."""
    if isinstance(error, SystemExit):
        return BrokenRuleError(f"{name}: {what} must not end the program, got SystemExit: {error.code}")
    # where the plugin raised it, or passed it on from a library
    frames = [frame for frame in extract_tb(error.__traceback__) if POSEFIT not in Path(frame.filename).parents]
    own = [frame for frame in frames if Path(frame.filename).parent == Path(frames[0].filename).parent]
    place = f" ({Path(own[-1].filename).name}:{own[-1].lineno})" if own else ""
    return BrokenRuleError(f"{name}: {what} must not fail, got {type(error).__name__}: {error}{place}")


class CheckedPrior:
    """A prior that has learned; an error in it names it, whichever plugin called it."""

    def __init__(self, prior: Prior, name: str) -> None:
        self._prior, self._name = prior, name
        self.low, self.high = np.asarray(prior.low), np.asarray(prior.high)

    def fit(self, angles: Array, skeleton: Skeleton | None = None) -> Self:
        """Learn from joint angles (T, 63), and return itself."""
        CheckedPrior.__init__(self, self._call("fit", angles, skeleton), self._name)
        return self

    def transform(self, angles: Array) -> Any:
        """Return the latents (n, m) of joint angles (n, 63)."""
        return self._call("transform", angles)

    def inverse_transform(self, latents: Array) -> Any:
        """Return the joint angles (n, 63) of latents (n, m)."""
        return self._call("inverse_transform", latents)

    def feasible(self, latents: Array) -> Any:
        """Return which latents (n, m) are poses at all (n,)."""
        return self._call("feasible", latents)

    def save(self, path: str | Path) -> None:
        """Write what it learned to an .npz file."""
        self._call("save", path)

    def _call(self, method: str, *arguments: Any) -> Any:
        try:  # not `plugin_errors`, which takes as long as a few poses
            return getattr(self._prior, method)(*arguments)
        except (Exception, SystemExit) as error:
            raise _broken_by(self._name, method, error) from error


@dataclass(eq=False)
class Audit:
    """What trackers reported wrongly of their frames; `warnings` has a line for each kind."""

    _findings: dict[str, tuple[str, int]] = field(default_factory=dict)  # by kind: the first of them, and how many

    @property
    def warnings(self) -> list[str]:
        """One line for each kind: the first of it, and how many frames it concerns."""
        return [f"{first} ({count} such frame{'s' if count > 1 else ''})" for first, count in self._findings.values()]

    def clear(self) -> None:
        """Forget all findings."""
        self._findings.clear()

    def note(self, kind: str, what: str) -> None:
        """Add a finding; only the first of a kind is kept in full."""
        first, count = self._findings.get(kind, (what, 0))
        self._findings[kind] = first, count + 1


class AuditedTracker:
    """A tracker whose frames are checked and audited: a wrong figure is noted and put right.

    Poses are counted where they are drawn, see `posefit.silhouette.drawn`; areas and cost are computed again from the
    pose. An honest frame stays as it is.
    """

    def __init__(self, tracker: Tracker, task: Task, name: str, beta: float, audit: Audit) -> None:
        self._tracker, self._task, self._name, self._beta, self._audit = tracker, task, name, beta, audit
        self.lag: int | None = getattr(tracker, "lag", None)  # None for one that does not look ahead

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield the tracker's frame for each observation. Raises BrokenRuleError where one is missing or wrong."""
        waiting: deque[Observation] = deque()  # those whose frames are still to come
        unread: Exception | None = None  # why an observation could not be read
        taken = reported = given = 0

        def stream() -> Iterator[Observation]:
            nonlocal taken, unread
            rest = iter(observations)
            while True:
                try:
                    with uncounted():  # to render a motion is no evaluation
                        observation = next(rest, None)
                except Exception as error:
                    unread = error
                    raise
                if observation is None:
                    return
                taken += 1
                waiting.append(observation)
                yield observation

        drawn, source = PoseCount(), stream()
        frames: Iterator[Frame] | None = None
        while True:
            try:
                with drawn.counting(), plugin_errors(self._name, "it", passed=(ImportError, GeneratorExit)):
                    frames = iter(self._tracker.track(source, rng)) if frames is None else frames
                    frame = next(frames, None)
            except BrokenRuleError as broken:
                if unread is not None and broken.__cause__ is unread:
                    raise unread from None  # what could not be read is not the tracker's fault
                raise
            if frame is None:
                break
            given += 1
            if given > taken:
                raise self._broken(f"track must yield a frame for each observation, got {given} for {given - 1}")
            self._check(frame)
            # it may have drawn poses for observations that it looks at ahead
            ahead = self._task.evaluations * (taken - given)
            counted = math.ceil(drawn.poses / len(self._task.cameras)) - reported - ahead
            frame = self._counted(frame, given - 1, counted, UNCOUNTED_POSES * taken)
            frame = self._computed(frame, given - 1, waiting.popleft())
            reported += frame.evaluations
            yield frame
        if given < taken or next(source, None) is not None:
            raise self._broken(f"track must yield a frame for each observation, got {given} and then no more")

    def _check(self, frame: Frame) -> None:
        if np.shape(frame.pose) != (66,) or not np.isfinite(frame.pose).all():
            raise self._broken(f"a pose must be 66 finite angles, got shape {np.shape(frame.pose)}")
        if np.shape(frame.translation) != (3,) or not np.isfinite(frame.translation).all():
            raise self._broken(f"a translation must be 3 finite metres, got {frame.translation}")
        if not isinstance(frame.evaluations, int | np.integer) or frame.evaluations < 0:
            raise self._broken(f"evaluations must be a whole number, 0 or more, got {quoted(frame.evaluations)}")
        if not isinstance(frame.seconds, float | int | np.number) or not 0.0 <= frame.seconds < math.inf:
            raise self._broken(f"seconds must be a number, 0 or more, got {quoted(frame.seconds)}")

    def _counted(self, frame: Frame, number: int, counted: int, leeway: int) -> Frame:
        """Return the frame with the evaluations that were counted, where it reports fewer, and note it."""
        label, budget = f"{self._name}: frame {number}", self._task.evaluations
        if counted > frame.evaluations + leeway:
            self._audit.note("said", f"{label} must say how many poses it drew, {counted:,}, got {frame.evaluations:,}")
            frame = replace(frame, evaluations=counted, spent=None)
        if frame.evaluations > budget:
            self._audit.note("budget", f"{label} must use at most {budget:,} evaluations, got {frame.evaluations:,}")
        return frame

    def _computed(self, frame: Frame, number: int, observation: Observation) -> Frame:
        """Return the frame with the areas and the cost of its pose, and note where it reports others."""
        label = f"{self._name}: frame {number}"
        pose, place = np.asarray(frame.pose, np.float64)[None], np.asarray(frame.translation, np.float64)[None]
        observed = [replace(silhouette) for silhouette in observation.silhouettes]  # without bits that it may change
        scene = self._task.body, self._task.cameras, observed
        costs, counts = pose_costs(*scene, pose, place, self._beta)
        true = counts[:, 0]
        if not np.array_equal(true, frame.areas):
            self._audit.note("areas", f"{label} must have its pose's areas, {true.tolist()}, got {_short(frame.areas)}")
            frame = replace(frame, areas=true)
        cost = float(costs[0])
        if not (isinstance(frame.cost, float | int | np.number) and abs(frame.cost - cost) <= COST_TOLERANCE):
            self._audit.note("cost", f"{label} must have its pose's cost, {cost:.6g}, got {_short(frame.cost)}")
            frame = replace(frame, cost=cost, history=np.array([cost]), spent=None)
        return frame

    def _broken(self, rule: str) -> BrokenRuleError:
        return BrokenRuleError(f"{self._name}: {rule}")


def _short(value: object) -> str:
    text = f"{value:.6g}" if isinstance(value, float) else str(np.asarray(value).tolist())
    return text if len(text) <= 80 else text[:77] + "..."
