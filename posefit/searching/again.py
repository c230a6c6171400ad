"""A track that looks all around again, after a gap and where its cost stays high."""

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from posefit.fitting.check import whole
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.searching.starts import FRAMES, RESTARTS, STRIDE, Follow, begun
from posefit.searching.tracker import beside

GAP = 5  # frames of a gap, where nobody says: about a sixth of a second
RISE = 1.5  # ours: costs so many times the usual one of the track are high
USUAL_SECONDS = 1.0  # that show what the usual one is
HIGH_SECONDS = 0.5  # for which costs are high before it looks around
LOOKED = "looked_again"  # in the details of a frame in which it did: whether a new start was better


@dataclass(frozen=True, eq=False)
class LookingTracker:
    """Follows as `follow` does, and looks all around again where the person may have turned unseen.

    That is in the first frame that shows him after a `gap` of frames that do not, and where for half a second every
    cost is half as high again as is usual since it looked last. Eight starts are compared as before a first frame, over
    about a second that is looked at ahead, with the track as it is; the best one goes on. Who walks backwards pays for
    it. The frame tells the evaluations and the time of all of them.
    """

    task: Task
    follow: Follow
    gap: int = GAP

    def __post_init__(self) -> None:
        whole("gap", self.gap, 1)

    def track(self, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation."""
        past, ahead = _Past(self.task, self.gap), _Ahead(observations)
        going = self.follow(self.task, ahead.coming(), rng)
        while seen := ahead.peek(1):
            spent = _Spent(self.follow)
            looked: bool | None = None
            if seen[0].usable and past.asks:
                task = self._looked(past, ahead.peek((FRAMES - 1) * STRIDE + 1), spent, beside(rng))
                if looked := task is not None:
                    going = self.follow(task, ahead.coming(), rng)
                past.forget()
            if (frame := next(going, None)) is None:
                return
            ahead.drop()
            past.add(frame, seen[0].usable)
            yield frame if looked is None else spent.told(frame, looked)
        yield from going  # none: whoever follows gets to its end

    def _looked(
        self, past: "_Past", coming: list[Observation], spent: "_Spent", rng: np.random.Generator
    ) -> Task | None:
        """Return the task to go on with anew; None where the track is best as it is."""
        latest = past.latest
        assert latest is not None
        around = replace(self.task, yaw=None, anchor=latest.translation, first_pose=None, before=())
        on = replace(around, yaw=float(latest.pose[0]), first_pose=latest.pose[3:], before=(latest,))
        task = begun(around, coming, spent.follow, RESTARTS, rng.integers(0, 2**32, 2).tolist(), on)
        return None if task is on else task


class _Past:
    """What is remembered of a track: the latest frame that showed the person, and what frames cost."""

    def __init__(self, task: Task, gap: int) -> None:
        self._gap = gap
        self._usual, self._high = (max(round(seconds * task.fps), 1) for seconds in (USUAL_SECONDS, HIGH_SECONDS))
        self.latest: Frame | None = None
        self.forget()
        if len(task.before) > 1:  # a single one is what the track was begun with
            for frame in task.before:
                self.add(frame, frame.evaluations > 0)

    def forget(self) -> None:
        """Begin anew to learn what is usual."""
        self._unseen, self._costs = 0, list[float]()

    def add(self, frame: Frame, usable: bool) -> None:
        """Take a frame that was found, or held where the observation was not usable."""
        if LOOKED in frame.details:
            self.forget()
        self._unseen = 0 if usable else self._unseen + 1
        if usable:
            self.latest = frame
            self._costs.append(frame.cost)

    @property
    def asks(self) -> bool:
        """Whether it is time to look around."""
        if self.latest is None:
            return False
        if self._unseen >= self._gap:
            return True
        usual, high = self._costs[: -self._high], self._costs[-self._high :]
        return len(usual) >= self._usual and min(high) > RISE * float(np.median(usual))


class _Ahead:
    """Observations that may be looked at before they are taken."""

    def __init__(self, observations: Iterable[Observation]) -> None:
        self._rest = iter(observations)
        self._kept: deque[Observation] = deque()
        self._first = 0

    def peek(self, count: int) -> list[Observation]:
        """Return the next so many, or as many as there are."""
        while len(self._kept) < count and (one := next(self._rest, None)) is not None:
            self._kept.append(one)
        return list(self._kept)[:count]

    def drop(self) -> None:
        """Take the next one."""
        self._kept.popleft()
        self._first += 1

    def coming(self) -> Iterator[Observation]:
        """Yield those from here on, whether they are taken meanwhile or not."""
        number = self._first
        while len(self.peek(number - self._first + 1)) > number - self._first:
            yield self._kept[number - self._first]
            number += 1


class _Spent:
    """What is followed through it, counted."""

    def __init__(self, follow: Follow) -> None:
        self._follow = follow
        self._evaluations, self._seconds, self._cpu_seconds = 0, 0.0, 0.0

    def follow(self, task: Task, observations: Iterable[Observation], rng: np.random.Generator) -> Iterator[Frame]:
        """Yield a `Frame` for each observation."""
        for frame in self._follow(task, observations, rng):
            self._evaluations += frame.evaluations
            self._seconds += frame.seconds
            self._cpu_seconds += frame.cpu_seconds or 0.0
            yield frame

    def told(self, frame: Frame, looked: bool) -> Frame:
        """Return a frame with what was spent before it was found."""
        spent: dict[str, Any] = {"evaluations": frame.evaluations + self._evaluations}
        spent["seconds"] = frame.seconds + self._seconds
        if frame.cpu_seconds is not None:
            spent["cpu_seconds"] = frame.cpu_seconds + self._cpu_seconds
        if frame.spent is not None:
            spent["spent"] = frame.spent + self._evaluations
        return replace(frame, **spent, details={**frame.details, LOOKED: looked})
