"""The one loop that drives a tracker.

It checks the frames, counts evaluations, and computes costs and areas again. A broken
rule ends the track with one line that names the tracker. A wrong figure is corrected
and noted in an `Audit`.
"""

import math
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting.tracker import Frame, Observation, Task, Tracker
from posefit.fitting.validation import BrokenRuleError, FreeAxes, plugin_errors
from posefit.reading import quoted
from posefit.silhouette.cost import pose_costs
from posefit.silhouette.drawn import PoseCount, uncounted

# Ours: a frame may rasterise this many poses beyond its evaluations, for example its
# result once more.
UNCOUNTED_POSES = 10
# Ours: rounding of costs that are added in another order.
COST_TOLERANCE = 1e-6


@dataclass(eq=False)
class Audit:
    """The wrong figures in a tracker's frames; `warnings` has a line for each kind."""

    name: str  # the name of the tracker
    beta: float  # the weight in the cost that the tracker reports
    # by kind: the message of the first finding, and the number of findings
    _findings: dict[str, tuple[str, int]] = field(default_factory=dict)

    @property
    def warnings(self) -> list[str]:
        """One line for each kind: its first finding, and the number of frames."""
        lines = []
        for first, count in self._findings.values():
            frames = "frames" if count > 1 else "frame"
            lines.append(f"{first} ({count} such {frames})")
        return lines

    def clear(self) -> None:
        """Forget all findings."""
        self._findings.clear()

    def note(self, kind: str, number: int, what: str) -> None:
        """Add a finding about a frame; only the first of a kind is kept in full."""
        first, count = self._findings.get(
            kind, (f"{self.name}: frame {number} must {what}", 0)
        )
        self._findings[kind] = first, count + 1

    def broken(self, rule: str) -> BrokenRuleError:
        """Return the error that ends a track."""
        return BrokenRuleError(f"{self.name}: {rule}")


def drive(
    make: Callable[[Task], Tracker],
    audit: Audit,
    task: Task,
    observations: Iterable[Observation],
    rng: np.random.Generator,
) -> Iterator[Frame]:
    """Yield a tracker's frame for each observation, with the time that it took.

    Rasterised poses are counted, see `posefit.silhouette.drawn`. Areas and costs are
    computed again from the poses; a frame with correct figures does not change.

    Args:
        make: Makes the tracker of a task.
        audit: Collects the wrong figures.
        task: The task.
        observations: The frames, in order.
        rng: The random numbers.

    Yields:
        A checked frame for each observation.

    Raises:
        BrokenRuleError: A frame is missing or breaks a rule.
    """
    waiting = deque[Observation]()  # taken observations that have no frame yet
    reading = np.zeros(2)  # time of reading observations, which is not the tracker's
    unreadable: Exception | None = None

    def taken() -> Iterator[Observation]:
        """Yield the observations, and measure the time of reading them."""
        nonlocal unreadable
        coming = iter(observations)
        while True:
            start = clocks()
            try:
                # an observation of a known motion is rendered here, which is not an
                # evaluation
                with uncounted():
                    observation = next(coming)
            except StopIteration:
                return
            except Exception as error:
                unreadable = error
                raise
            finally:
                reading[:] += clocks() - start
            waiting.append(observation)
            yield observation

    # ValueErrors of settings and missing libraries are mistakes of the user
    with plugin_errors(audit.name, "construction", (ValueError, ImportError)):
        tracker = make(task)
    source = taken()
    training = (motion.poses[:, 3:] for motion in task.training)
    axes = FreeAxes(task.body.skeleton, training)
    drawn = PoseCount()
    frames: Iterator[Frame] | None = None
    yielded = 0
    evaluations = 0
    passed = (InputError, ImportError, GeneratorExit)
    while True:
        start = clocks() - reading
        try:
            with drawn.counting(), plugin_errors(audit.name, "track", passed):
                if frames is None:
                    frames = iter(tracker.track(source, rng))
                frame = next(frames, None)
        except BrokenRuleError as broken:
            if unreadable is not None and broken.__cause__ is unreadable:
                # an unreadable observation is not the tracker's fault
                raise unreadable from None
            raise
        if frame is None:
            break
        seconds, cpu_seconds = (clocks() - reading - start).tolist()
        if not waiting:
            raise audit.broken(
                "track must yield a frame for each observation,"
                f" got {yielded + 1} for {yielded}"
            )
        observation = waiting.popleft()
        if rule := _broken(frame, axes):
            raise audit.broken(rule)
        # poses of the observations ahead may have been rasterised already
        ahead = task.evaluations * len(waiting)
        counted = math.ceil(drawn.poses / len(task.cameras)) - evaluations - ahead
        leeway = UNCOUNTED_POSES * (yielded + 1 + len(waiting))
        if counted > frame.evaluations + leeway:
            audit.note(
                "evaluations",
                yielded,
                f"count all poses it rasterised, {counted:,},"
                f" got {frame.evaluations:,}",
            )
            frame = with_evaluations(frame, counted)
        if frame.evaluations > task.evaluations:
            audit.note(
                "budget",
                yielded,
                f"use at most {task.evaluations:,} evaluations,"
                f" got {frame.evaluations:,}",
            )
        frame = _with_true_cost(frame, yielded, task, observation, audit)
        yielded = yielded + 1
        evaluations = evaluations + frame.evaluations
        yield replace(frame, seconds=seconds, cpu_seconds=cpu_seconds)
    if waiting or next(source, None) is not None:
        raise audit.broken(
            "track must yield a frame for each observation,"
            f" got {yielded} and then no more"
        )


def clocks() -> Array:
    """Return the time now, and the CPU time of this process (2,), seconds."""
    return np.array([time.perf_counter(), time.process_time()])


def _broken(frame: object, axes: FreeAxes) -> str:
    """Return the rule that a tracker's frame breaks, or ""."""
    if not isinstance(frame, Frame):
        return (
            f"track must yield a Frame for each observation, got {type(frame).__name__}"
        )
    if np.shape(frame.pose) != (66,) or not np.isfinite(frame.pose).all():
        return f"a pose must be 66 finite angles, got shape {np.shape(frame.pose)}"
    if np.shape(frame.translation) != (3,) or not np.isfinite(frame.translation).all():
        return f"a translation must be 3 finite metres, got {frame.translation}"
    if not isinstance(frame.evaluations, int | np.integer) or frame.evaluations < 0:
        came = quoted(frame.evaluations)
        return f"evaluations must be a whole number, 0 or more, got {came}"
    shape = np.shape(frame.trace)
    if len(shape) != 2 or shape[1] != 2:
        return f"a trace must be (n, 2), evaluations and costs, got shape {shape}"
    if rule := axes.broken(np.asarray(frame.pose)[None, 3:]):
        return f"a pose must {rule}"
    return ""


def _with_true_cost(
    frame: Frame, number: int, task: Task, observation: Observation, audit: Audit
) -> Frame:
    """Return the frame with its pose's true areas and cost, and note wrong ones."""
    pose = np.asarray(frame.pose, np.float64)[None]
    place = np.asarray(frame.translation, np.float64)[None]
    # copies without the packed bits, which the tracker may have changed
    observed = [replace(silhouette) for silhouette in observation.silhouettes]
    # checking a frame is not an evaluation
    with uncounted():
        costs, counts = pose_costs(
            task.body, task.cameras, observed, pose, place, audit.beta
        )
    true = counts[:, 0]
    if not np.array_equal(true, frame.areas):
        audit.note(
            "areas",
            number,
            f"have its pose's areas, {true.tolist()}, got {_short(frame.areas)}",
        )
        frame = replace(frame, areas=true)
    cost = float(costs[0])
    if not (
        isinstance(frame.cost, float | int | np.number)
        and abs(frame.cost - cost) <= COST_TOLERANCE
    ):
        audit.note(
            "cost",
            number,
            f"have its pose's cost, {cost:.6g}, got {_short(frame.cost)}",
        )
        frame = replace(frame, cost=cost, trace=np.array([[frame.evaluations, cost]]))
    return frame


def with_evaluations(frame: Frame, evaluations: int) -> Frame:
    """Return a frame with another number of evaluations, its trace stretched to it."""
    stretched = frame.trace.copy()
    stretched[:, 0] = stretched[:, 0] * evaluations // max(frame.evaluations, 1)
    return replace(frame, evaluations=evaluations, trace=stretched)


def _short(value: object) -> str:
    """Return a value as text of at most 80 characters."""
    text = str(np.asarray(value).tolist())
    if isinstance(value, float):
        text = f"{value:.6g}"
    if len(text) <= 80:
        return text
    return text[:77] + "..."
