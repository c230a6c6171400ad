"""The one policy of restarts: where a track begins, and when it begins again.

| when | what is tried | what is kept |
|---|---|---|
| before the first frame | `best_restart`: searches and short trials | the cheapest |
| after a gap, at high costs | `relocalised`: restarts, or none | the cheapest |
| several hypotheses | `initial_guess`: poses with the same silhouette | the cheapest |
| several cameras | `tracked_again`: back, then onward | the cheapest |

A body that spins is tracked again in spins.py.
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import deepcopy
from dataclasses import replace
from itertools import islice
from typing import Literal

import numpy as np

from posefit.fitting.carried import with_carried
from posefit.fitting.driving import with_evaluations
from posefit.fitting.space import ROOT_RANGE_DEGREES
from posefit.fitting.tracker import Follow, Frame, Observation, Task, guessed_modes
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit.geometry.symmetry import (
    exchanged_limbs,
    facing,
    mirrored_poses,
    reflected_poses,
    turned_poses,
)
from posefit.reading import counted
from posefit.silhouette.drawn import PoseCount
from posefit.silhouette.mask import coarser_camera, coarser_silhouette
from posefit.tracking.trajectory import with_effort_of
from posefit.uncertainty.modes import Posterior

# Part of the seed of each kind of repeated tracking.
RNG_STREAMS = {"hypothesis": 2005, "spin": 450, "back": 1902, "pass": 1965}
RESTARTS = 8  # searches of the first frame, at most
MIN_MODE_WEIGHT = 0.05  # modes of the first frame with less weight are not tried
TRIAL_FRAMES = 10  # frames that judge a restart
# Every third frame, so that the trial lasts long enough to show which way the person
# walks.
TRIAL_STRIDE = 3
TRIAL_ROWS = 240  # pictures that compare restarts have at least this many rows
WALKED = 0.3  # metres; a person who moves this far in the trial walks
BACKWARDS_PENALTY = 1.1  # factor on the cost of a restart that walks backwards
COST_RISE = 1.5  # a cost above this multiple of the track's typical cost is high
TYPICAL_COST_SECONDS = 1.0  # the typical cost is a median over at least this time
HIGH_COST_SECONDS = 0.5  # a track relocalises after high costs for this long
# Key in the details of a frame that relocalised: whether a restart was better.
RELOCALISED = "relocalised"
SEARCHED = "searched"
SEARCHED_AGAIN = "searched again"


def stream(
    seed: int, kind: Literal["hypothesis", "spin", "back", "pass"], number: int
) -> np.random.Generator:
    """Return the random generator of a repeated track.

    The first track's generator depends on the seed alone.
    """
    return np.random.default_rng([seed, RNG_STREAMS[kind], number])


def independent(rng: np.random.Generator) -> np.random.Generator:
    """Return a generator seeded by the next sample of another, which is not changed."""
    return np.random.default_rng(deepcopy(rng).integers(0, 2**63, 4))


# Restarts before the first frame.


def usable_observations(
    observations: Sequence[Observation], count: int, stride: int = 1, start: int = 0
) -> list[Observation]:
    """Return the first `count` usable observations of every `stride`th from `start`.

    A usable observation shows enough of the person.
    """
    each = (observations[k] for k in range(start, len(observations), stride))
    usable = (observation for observation in each if observation.usable)
    return list(islice(usable, count))


def first_shown_whole(observations: Sequence[Observation]) -> int:
    """Return the first frame in which the most cameras show the whole person.

    It shows the whole person if the edge of its picture cuts nothing off. If no camera
    ever does, return the first usable frame.
    """
    best = 0
    most = 0.0
    for k, observation in enumerate(observations):
        whole = sum(
            np.isfinite(silhouette.extent).all()
            for silhouette in observation.silhouettes
            if silhouette.known
        )
        count = float(whole) if observation.usable else 0.0
        if count > most or (not most and observation.usable):
            best = k
            most = max(count, 0.5)
        if count == len(observation.silhouettes):
            break
    return best


def best_restart(
    task: Task,
    observations: Sequence[Observation],
    follow: Follow,
    restarts: int,
    seed: int | Sequence[int],
    continuation: Task | None = None,
    log: Callable[[str], None] = lambda _message: None,
) -> tuple[Task, list[Frame]]:
    """Return the task that starts from the best of several restarts.

    Each restart searches the first usable frame around one of the likely modes of what
    it may show. If nothing is guessed, it searches anywhere, at all yaws if none is
    known. It then follows the person through a few more frames. The least mean cost
    wins; walking backwards is penalised.

    Large pictures are compared at a lower resolution. The first frame is then searched
    once more at full resolution, around the best restart. The evaluations of the guess
    are added to the first search.

    Args:
        task: The task, before its first frame.
        observations: The frames from the first one on.
        follow: The tracker.
        restarts: How many restarts, at most.
        seed: The seed of the random numbers.
        continuation: The task that continues an earlier track. It competes with the
            restarts, and is returned if none of them is better.
        log: Gets a line that says where the restarts search.

    Returns:
        The task with the best restart as the frame before the first, and all frames of
        the trial.
    """
    chosen = usable_observations(observations, TRIAL_FRAMES, TRIAL_STRIDE)
    if not chosen:
        chosen = usable_observations(observations, 1)
    factor = max(min(camera.height for camera in task.cameras) // TRIAL_ROWS, 1)
    # models of motion need the rate of the frames that are compared
    trial = replace(task, fps=task.fps / TRIAL_STRIDE)
    compared = chosen
    if factor > 1:
        cameras = [coarser_camera(camera, factor) for camera in task.cameras]
        trial = replace(trial, cameras=cameras)
        compared = [_coarser(observation, factor) for observation in chosen]

    prefix = [seed] if isinstance(seed, int) else [*seed]

    def followed(start: Task, number: int) -> list[Frame]:
        """Return the compared frames, followed with random numbers of their own."""
        rng = np.random.default_rng([*prefix, number])
        return list(follow(start, compared, rng))

    best = continuation or task
    least = np.inf
    tried = list[Frame]()
    if continuation is not None:
        start = replace(continuation, fps=trial.fps, cameras=trial.cameras)
        tried += followed(start, restarts + 1)
        least = _trial_cost(tried)

    weighted, guess_evaluations = guessed(task, chosen[0])
    modes = [mode for weight, mode in weighted[:restarts] if weight >= MIN_MODE_WEIGHT]
    where = "anywhere"
    if modes:
        where = f"around {counted(len(modes), 'pose')} with such a silhouette"
    log(f"looking for the first pose {where}")
    starts = [around(trial, mode) for mode in modes] or [trial] * restarts
    for k, start in enumerate(starts):
        frames = followed(start, k)
        if k == 0 and guess_evaluations:
            used = frames[0].evaluations + guess_evaluations
            frames[0] = with_evaluations(frames[0], used)
        tried += frames
        if (cost := _trial_cost(frames)) < least:
            best = after(task, frames[0])
            least = cost

    # the first frame of the best restart, at full resolution
    if factor > 1 and best is not (continuation or task):
        rng = np.random.default_rng([*prefix, restarts])
        tried.append(next(follow(best, chosen[:1], rng)))
        best = after(task, tried[-1])
    return best, tried


def guessed(
    task: Task, observation: Observation
) -> tuple[Sequence[tuple[float, Posterior]], int]:
    """Return modes of the poses that one picture may show, and their evaluations."""
    count = PoseCount()
    with count.counting():
        modes = guessed_modes(task, observation)
    return modes, math.ceil(count.poses / len(task.cameras))


def _coarser(observation: Observation, factor: int) -> Observation:
    """Return an observation whose pictures have a fraction of the rows and columns."""
    silhouettes = [
        coarser_silhouette(silhouette, factor) for silhouette in observation.silhouettes
    ]
    return replace(observation, silhouettes=silhouettes)


def _trial_cost(frames: Sequence[Frame]) -> float:
    """Return the mean cost of frames, penalised if the person walks backwards."""
    path = frames[-1].translation - frames[0].translation
    yaws = np.array([frame.pose[0] for frame in frames])
    ahead = np.array([np.sin(yaws).mean(), 0.0, np.cos(yaws).mean()])
    path[1] = 0.0
    backwards = np.linalg.norm(path) > WALKED and path @ ahead < 0.0
    penalty = BACKWARDS_PENALTY if backwards else 1.0
    return float(np.mean([frame.cost for frame in frames])) * penalty


def around(task: Task, mode: Posterior) -> Task:
    """Return the task that begins around a mode of what the first frame may show."""
    pose = mode.poses[0]
    place = mode.translations[0]
    return replace(
        task, yaw=float(pose[0]), anchor=place, first_pose=pose[3:], modes=[(1.0, mode)]
    )


def after(task: Task, frame: Frame) -> Task:
    """Return the task that continues from a frame."""
    first = replace(
        task,
        yaw=float(frame.pose[0]),
        anchor=frame.translation,
        first_pose=frame.pose[3:],
        modes=(),
    )
    # without the state of the filter: a new one continues from the frame
    return replace(first, before=(with_carried(frame, None),))


# Restarts during a track.


def relocalised(
    task: Task,
    follow: Follow,
    observations: Iterable[Observation],
    rng: np.random.Generator,
    gap: int,
) -> Iterator[Frame]:
    """Yield the frames of `follow`, and search all yaws again if the track may be lost.

    This happens in the first frame that shows the person after a gap: they may have
    turned unseen. It also happens if all costs of half a second are half as high again
    as is typical since the last relocalisation. The restarts and the present track are
    compared over about a second of the coming observations, and the cheapest one
    continues. The frame gets the evaluations and the time of all that were compared.

    Args:
        task: The task.
        follow: The tracker.
        observations: The frames, in order.
        rng: The random numbers.
        gap: The length of a gap: frames without the person. 0: never search again.
    """
    if not gap:
        yield from follow(task, observations, rng)
        return
    coming = _Coming(observations)
    watch = _Watch(task, gap)
    frames = follow(task, coming, rng)
    while shown := coming.ahead(1):
        (observation,) = shown
        trials = list[Frame]()
        if observation.usable and (latest := watch.due()) is not None:
            window = coming.ahead(1 + (TRIAL_FRAMES - 1) * TRIAL_STRIDE)
            seeds = independent(rng).integers(0, 2**32, 2).tolist()
            # the track may be wrong in every way: only its place is kept
            unconstrained = replace(
                task,
                yaw=None,
                anchor=latest.translation,
                first_pose=None,
                modes=(),
                before=(),
            )
            continuation = after(unconstrained, latest)
            best, trials = best_restart(
                unconstrained, window, follow, RESTARTS, seeds, continuation
            )
            if best is not continuation:
                frames = follow(best, coming, rng)
        if (frame := next(frames, None)) is None:
            return
        if trials:
            frame = with_effort_of(frame, [frame, *trials])
            details = {**frame.details, RELOCALISED: best is not continuation}
            frame = replace(frame, details=details)
        watch.add(frame, observation.usable)
        yield frame
    # no frames are left, but the tracker must run to its end
    yield from frames


class _Coming(Iterator[Observation]):
    """Observations that a tracker takes one by one, and that can be read ahead."""

    def __init__(self, observations: Iterable[Observation]) -> None:
        self._observations = iter(observations)
        self._waiting = deque[Observation]()

    def __next__(self) -> Observation:
        return self._waiting.popleft() if self._waiting else next(self._observations)

    def ahead(self, count: int) -> list[Observation]:
        """Return up to `count` of the next observations without taking them."""
        self._waiting.extend(
            islice(self._observations, max(count - len(self._waiting), 0))
        )
        return list(islice(self._waiting, count))


class _Watch:
    """Watches a track for the reasons to relocalise: a gap, or costs that stay high."""

    def __init__(self, task: Task, gap: int) -> None:
        self._gap = gap
        self._typical_frames = max(round(TYPICAL_COST_SECONDS * task.fps), 1)
        self._high_frames = max(round(HIGH_COST_SECONDS * task.fps), 1)
        self._latest: Frame | None = None  # the latest frame that showed the person
        self._missing = 0  # frames since then
        self._costs = list[float]()  # since the last relocalisation
        # a single earlier frame is the start of the track, not part of it
        if len(task.before) > 1:
            for frame in task.before:
                self.add(frame, frame.evaluations > 0)

    def add(self, frame: Frame, usable: bool) -> None:
        """Take the next frame."""
        if RELOCALISED in frame.details:
            self._costs.clear()
        self._missing += 1
        if usable:
            self._latest = frame
            self._missing = 0
            self._costs.append(frame.cost)

    def due(self) -> Frame | None:
        """Return the latest frame that showed the person if it is time to relocalise.

        None if it is not.
        """
        typical = self._costs[: -self._high_frames]
        high = self._costs[-self._high_frames :]
        costly = False
        if len(typical) >= self._typical_frames:
            costly = min(high) > COST_RISE * float(np.median(typical))
        return self._latest if costly or self._missing >= self._gap else None


# Initial guesses of several hypotheses.

# The initial guesses of the hypotheses after the first one, in turn. The ones that are
# mistaken for the right pose most often come first.
GUESSES = (
    "mirrored",
    "reflected",
    SEARCHED_AGAIN,
    "legs exchanged",
    "turned",
    SEARCHED_AGAIN,
    "arms exchanged",
)


def initial_guess(
    number: int, task: Task, yaw: float | None, pose_known: bool, first: Frame
) -> tuple[str, Task]:
    """Return the name and the task of a hypothesis after the first one.

    It starts around a pose with a silhouette similar to that of a frame, or searches
    again as the first hypothesis did.

    Args:
        number: Number of the hypothesis, from 1.
        task: The task of the first hypothesis.
        yaw: The known yaw in radians, or None. Poses that face elsewhere are left out.
        pose_known: Whether the first pose is known. Then only the seeds differ.
        first: The frame, as the first hypothesis estimated it.
    """
    camera_yaw = facing(task.cameras[0], first.translation)
    skeleton = task.body.skeleton
    pose = first.pose[None]
    poses = {
        "mirrored": mirrored_poses(skeleton, pose)[0],
        "reflected": reflected_poses(skeleton, pose, camera_yaw)[0],
        "legs exchanged": exchanged_limbs(skeleton, pose, "legs")[0],
        "turned": turned_poses(pose)[0],
        "arms exchanged": exchanged_limbs(skeleton, pose, "arms")[0],
    }
    if yaw is not None:
        reach = np.radians(ROOT_RANGE_DEGREES[0])
        poses = {
            name: pose
            for name, pose in poses.items()
            if abs(wrapped(pose[0] - yaw)) <= reach
        }
    order = [
        name
        for name in GUESSES
        if name == SEARCHED_AGAIN or (name in poses and not pose_known)
    ]
    name = order[(number - 1) % len(order)]
    if name == SEARCHED_AGAIN:
        return name, task
    return name, replace(after(task, replace(first, pose=poses[name])), before=())


# Tracking again after the last frame.


def tracked_again(
    task: Task,
    observations: Sequence[Observation],
    frames: Sequence[Frame],
    follow: Follow,
    number: int,
    seed: int,
) -> list[Frame]:
    """Return the frames of a track, tracked once more with their poses as candidates.

    Odd passes run back in time, so that early frames profit from what late ones show.

    Args:
        task: The task of the track.
        observations: All frames.
        frames: The track so far.
        follow: The tracker.
        number: Number of the pass, from 1.
        seed: The seed of the random numbers.
    """
    order = range(len(frames))[:: -1 if number % 2 else 1]
    start = replace(after(task, frames[order[0]]), before=())
    shown = (
        replace(observations[k], estimate=(frames[k].pose, frames[k].translation))
        for k in order
    )
    if number % 2:
        start = reversed_task(start)
    again = list(follow(start, shown, stream(seed, "pass", number)))
    return again[:: order.step]


def reversed_task(task: Task) -> Task:
    """Return a task with observations that run back in time."""
    training = [motion.reversed() for motion in task.training]
    return replace(task, training=training, backwards=True)


def joined(skeleton: Skeleton, behind: Sequence[Frame], ahead: Frame) -> list[Frame]:
    """Return frames with the sampled trajectories of the frame where two tracks meet.

    Each trajectory of that frame continues as the nearest one of the other track.

    Args:
        skeleton: The person's skeleton.
        behind: The frames of the track from the meeting frame backwards.
        ahead: The meeting frame, as the other track has it.
    """
    here = ahead.posterior
    there = behind[0].posterior
    if here is None or there is None:
        return list(behind)
    near = skeleton.joints(there.poses)
    rows = np.array(
        [
            ((near - joints) ** 2).sum(axis=(1, 2)).argmin()
            for joints in skeleton.joints(here.poses)
        ]
    )
    frames = []
    for frame in behind:
        if (posterior := frame.posterior) is not None:
            poses = posterior.poses[rows]
            places = posterior.translations[rows]
            posterior = replace(
                posterior, poses=poses, translations=places, weights=np.ones(len(rows))
            )
        frames.append(replace(frame, posterior=posterior))
    return frames
