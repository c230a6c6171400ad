"""The one policy of restarts: where a track begins, and when it is begun again from somewhere else.

| when | what is tried | what is kept |
|---|---|---|
| before the first frame | `best_restart`: searches around what it may show, followed for a second | the cheapest |
| after a gap, or while costs are high | `relocalised`: such restarts beside the track as it is | the cheapest |
| with several hypotheses | `initial_guess`: poses with the same silhouette, each tracked to the end | the cheapest |
| where the body spins | `retrack_spins`: all before and after the longest run without | the new one, if as cheap |
| footage by several cameras | `tracked_again`: back, then onward, from what the pass before found | the cheapest |
"""

import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import deepcopy
from dataclasses import replace
from itertools import islice
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.fitting.carried import with_carried
from posefit.fitting.driving import with_evaluations
from posefit.fitting.space import ROOT_RANGE_DEGREES
from posefit.fitting.tracker import Follow, Frame, Observation, Task, guessed_modes
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import Skeleton
from posefit.geometry.symmetry import (
    exchanged_limbs,
    facing,
    mirrored_poses,
    reflected_poses,
    turned_poses,
)
from posefit.motion.steadiness import runs
from posefit.reading import counted
from posefit.silhouette.drawn import PoseCount
from posefit.silhouette.mask import coarser_camera, coarser_silhouette
from posefit.tracking.trajectory import (
    Tracked,
    cheapest_sequence,
    mean_cost,
    with_effort_of,
    with_total_effort,
)
from posefit.uncertainty.modes import Posterior

# part of the seed of what is tracked again
RNG_STREAMS = {"hypothesis": 2005, "spin": 450, "back": 1902, "pass": 1965}
RESTARTS = 8  # searches of the first frame, at most
MIN_WEIGHT = 0.05  # of a mode of the first frame that is tried
TRIAL_FRAMES = 10  # by which a restart is judged
TRIAL_STRIDE = 3  # frames between these, so that they show which way the person walks
TRIAL_ROWS = 240  # pictures have at least so many in which restarts are compared
WALKED = 0.3  # metres; a person who goes so far in the trial goes where they face
BACKWARDS_PENALTY = 1.1  # on the cost of a restart that walks backwards
COST_RISE = 1.5  # times the typical cost of the track: costs above it are high
TYPICAL_COST_SECONDS = 1.0  # of frames that show the typical cost
HIGH_COST_SECONDS = 0.5  # for which costs are high before a track relocalises
# in the details of a frame where it did: whether a restart was better
RELOCALISED = "relocalised"
# a track without spins that costs more is wrong: the person does turn so fast
SPIN_TOLERANCE = 1.5
# a second: the fastest that a person turns on the spot
MAX_TURN_RATE = np.radians(450.0)
SPIN_SECONDS = 0.1
# within that time: more is no turn of a person, even in a smoothed track
SPIN_ANGLE = np.radians(60.0)
END_SECONDS = 0.5  # from the ends of what is without spins, where it goes on from
VOTES_PER_SECOND = 30.0
EXCESS_TURN_VOTES = 30.0  # that a radian costs which is turned faster than a person can
SEARCHED = "searched"
SEARCHED_AGAIN = "searched again"


def stream(
    seed: int, kind: Literal["hypothesis", "spin", "back", "pass"], number: int
) -> np.random.Generator:
    """Return the random generator of something that is tracked again; that of the first track is of the seed alone."""
    return np.random.default_rng([seed, RNG_STREAMS[kind], number])


def independent(rng: np.random.Generator) -> np.random.Generator:
    """Return a generator that is seeded by what another one would draw next, which stays as it is."""
    return np.random.default_rng(deepcopy(rng).integers(0, 2**63, 4))


# Before the first frame.


def usable_observations(
    observations: Sequence[Observation], count: int, stride: int = 1, start: int = 0
) -> list[Observation]:
    """Return the first `count` observations from `start` on, of every `stride`th, that show enough of the person."""
    each = (observations[k] for k in range(start, len(observations), stride))
    return list(
        islice((observation for observation in each if observation.usable), count)
    )


def first_shown_whole(observations: Sequence[Observation]) -> int:
    """Return the first frame of those in which most cameras show all of the person, nothing cut by the picture's edge.

    Where none does, it is the first that is usable.
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
    """Return the task with the best of several restarts as the frame before the first, and all frames of the trial.

    Each searches the first usable frame around a mode of what it may show, as many as are likely; or, where nothing is
    guessed, anywhere, at all yaws where none is known. It then follows the person through a few more frames. The least
    mean cost wins; walking backwards is penalised. Large pictures are compared at a lower resolution, and the first
    frame is then searched once more in the whole one, around the best. The `continuation` of a track is followed beside
    the restarts, and returned where none of them is better. The evaluations of the guess are those of the first search.
    `log` gets a line that says where they search.
    """
    chosen = usable_observations(
        observations, TRIAL_FRAMES, TRIAL_STRIDE
    ) or usable_observations(observations, 1)
    factor = max(min(camera.height for camera in task.cameras) // TRIAL_ROWS, 1)
    # for models of motion
    trial = replace(task, fps=task.fps / TRIAL_STRIDE)
    compared = chosen
    if factor > 1:
        trial = replace(
            trial, cameras=[coarser_camera(camera, factor) for camera in task.cameras]
        )
        masks = [
            [
                coarser_silhouette(silhouette, factor)
                for silhouette in observation.silhouettes
            ]
            for observation in chosen
        ]
        compared = [
            replace(observation, silhouettes=small)
            for observation, small in zip(chosen, masks, strict=True)
        ]
    prefix = [seed] if isinstance(seed, int) else [*seed]
    best = continuation or task
    least = np.inf
    tried = list[Frame]()
    if continuation is not None:
        compared_task = replace(continuation, fps=trial.fps, cameras=trial.cameras)
        tried += follow(
            compared_task, compared, np.random.default_rng([*prefix, restarts + 1])
        )
        least = _trial_cost(tried)
    drawn = PoseCount()
    with drawn.counting():
        guessed = guessed_modes(task, chosen[0])[:restarts]
    guess_evaluations = math.ceil(drawn.poses / len(task.cameras))
    modes = [mode for weight, mode in guessed if weight >= MIN_WEIGHT]
    where = (
        f"around {counted(len(modes), 'pose')} with such a silhouette"
        if modes
        else "anywhere"
    )
    log(f"looking for the first pose {where}")
    for k, start in enumerate(
        [around(trial, mode) for mode in modes] or [trial] * restarts
    ):
        frames = list(follow(start, compared, np.random.default_rng([*prefix, k])))
        if not k and guess_evaluations:
            used = frames[0].evaluations + guess_evaluations
            frames[0] = with_evaluations(frames[0], used)
        tried += frames
        if (cost := _trial_cost(frames)) < least:
            best = after(task, frames[0])
            least = cost
    if factor > 1 and best is not (continuation or task):
        tried.append(
            next(follow(best, chosen[:1], np.random.default_rng([*prefix, restarts])))
        )
        best = after(task, tried[-1])
    return best, tried


def _trial_cost(frames: Sequence[Frame]) -> float:
    """Return the mean cost of frames, penalised where the person walks backwards in them."""
    path = frames[-1].translation - frames[0].translation
    yaws = np.array([frame.pose[0] for frame in frames])
    ahead = np.array([np.sin(yaws).mean(), 0.0, np.cos(yaws).mean()])
    path[1] = 0.0
    backwards = np.linalg.norm(path) > WALKED and path @ ahead < 0.0
    return float(np.mean([frame.cost for frame in frames])) * (
        BACKWARDS_PENALTY if backwards else 1.0
    )


def around(task: Task, mode: Posterior) -> Task:
    """Return the task that begins around a mode of what the first frame may show."""
    pose = mode.poses[0]
    place = mode.translations[0]
    return replace(
        task, yaw=float(pose[0]), anchor=place, first_pose=pose[3:], modes=[(1.0, mode)]
    )


def after(task: Task, frame: Frame) -> Task:
    """Return the task that goes on from a frame."""
    first = replace(
        task,
        yaw=float(frame.pose[0]),
        anchor=frame.translation,
        first_pose=frame.pose[3:],
        modes=(),
    )
    # the filter that goes on from it is a new one
    return replace(first, before=(with_carried(frame, None),))


# While a track goes on.


def relocalised(
    task: Task,
    follow: Follow,
    observations: Iterable[Observation],
    rng: np.random.Generator,
    gap: int,
) -> Iterator[Frame]:
    """Yield the frames that `follow` gives, searched at all yaws again where the person may have turned unseen.

    That is in the first frame that shows the person after a `gap` of frames that do not, none for 0, and where for half
    a second every cost is half as high again as is typical since the last relocalisation. Restarts are compared
    with the track as it is, over about a second of the observations to come; the cheapest goes on. The frame has the
    evaluations and the time of all of them.
    """
    if not gap:
        yield from follow(task, observations, rng)
        return
    coming = _Coming(observations)
    watch = _Watch(task, gap)
    frames = follow(task, coming, rng)
    while shown := coming.ahead(1):
        (observation,), trials = shown, list[Frame]()
        if observation.usable and (latest := watch.due()) is not None:
            window = coming.ahead(1 + (TRIAL_FRAMES - 1) * TRIAL_STRIDE)
            seeds = independent(rng).integers(0, 2**32, 2).tolist()
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
            frame = replace(
                frame, details={**frame.details, RELOCALISED: best is not continuation}
            )
        watch.add(frame, observation.usable)
        yield frame
    yield from frames  # none: the tracker gets to its end


class _Coming(Iterator[Observation]):
    """Observations that a tracker takes one by one, and that can be read ahead."""

    def __init__(self, observations: Iterable[Observation]) -> None:
        self._observations, self._waiting = iter(observations), deque[Observation]()

    def __next__(self) -> Observation:
        return self._waiting.popleft() if self._waiting else next(self._observations)

    def ahead(self, count: int) -> list[Observation]:
        """Return the next observations, up to `count` of them, which stay to be taken."""
        self._waiting.extend(
            islice(self._observations, max(count - len(self._waiting), 0))
        )
        return list(islice(self._waiting, count))


class _Watch:
    """Watches a track for what makes it relocalise: a gap, or costs that stay high."""

    def __init__(self, task: Task, gap: int) -> None:
        self._gap = gap
        self._typical_frames = max(round(TYPICAL_COST_SECONDS * task.fps), 1)
        self._high_frames = max(round(HIGH_COST_SECONDS * task.fps), 1)
        self._latest: Frame | None = None  # that showed the person
        self._missing = 0  # frames since then
        self._costs = list[float]()  # since the last relocalisation
        if len(task.before) > 1:  # a single one is what the track starts from
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
        """Return the latest frame that showed the person where it is time to relocalise, else None."""
        typical = self._costs[: -self._high_frames]
        high = self._costs[-self._high_frames :]
        costly = len(typical) >= self._typical_frames and min(high) > COST_RISE * float(
            np.median(typical)
        )
        return self._latest if costly or self._missing >= self._gap else None


# Several hypotheses.

# The initial guesses of the hypotheses after the first, in turn: those first that are mistaken most often.
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
    """Return the name and the task of a hypothesis after the first; `first` is a frame that the first one estimated.

    It starts around a pose whose silhouette is like that of the frame, or searches as the first one did. Poses that
    face elsewhere than the known `yaw` are left out; where the first pose is known, only seeds differ.
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


# After the last frame. A silhouette hardly distinguishes a body that faces the camera from its reflection, which faces
# away. A track that takes one for the other and back spins; each of its frames then votes for one of the two.


def retrack_spins(
    task: Task,
    observations: Sequence[Observation],
    tracked: Tracked,
    follow: Follow,
    seed: int,
) -> Tracked:
    """Return a track without spins, whose `stay` is the first and last frame of those that stay; None where all do.

    Those are of the longest run that faces as most frames do, see `facing_consensus`, between its best ends. The
    person is followed onward from the last, and backwards from the first by training motions in reverse. The old track
    is kept where the new one spins as often, or costs half as much again. Frames that are tracked again have the effort
    of both tracks.
    """
    frames = tracked.frames
    usable = np.array([observation.usable for observation in observations])

    def spins(track: Sequence[Frame]) -> int:
        return int(
            spin_mask(
                np.array([frame.pose[0] for frame in track]), usable, task.fps
            ).sum()
        )

    before = spins(frames)
    every = (
        runs(facing_consensus(frames, task.cameras, usable, task.fps)) if before else []
    )
    if not every:
        return tracked
    first, last = stay = best_ends(
        frames, *max(every, key=lambda run: run[1] - run[0]), task.fps
    )
    steady = replace(task, fastest_turn=MAX_TURN_RATE)

    def followed_from(number: int, steady: Task, rows: range) -> list[Frame]:
        """Return the frames of some rows but the first, followed from that one."""
        if len(rows) == 1:
            return []
        start = replace(after(steady, frames[rows[0]]), before=())
        tracked_again = list(
            follow(start, (observations[k] for k in rows), stream(seed, "spin", number))
        )
        return joined(task.body.skeleton, tracked_again, frames[rows[0]])[1:]

    ahead = followed_from(0, steady, range(last, len(frames)))
    behind = followed_from(1, reversed_task(steady), range(first, -1, -1))
    new = [*behind[::-1], *frames[first : last + 1], *ahead]
    cheap = mean_cost(new, usable) < SPIN_TOLERANCE * mean_cost(frames, usable)
    better = cheap and spins(new) < before
    new = with_total_effort([frames, new], int(better))
    new[first : last + 1] = frames[first : last + 1]
    return tracked._replace(frames=new, stay=stay if better else None)


def tracked_again(
    task: Task,
    observations: Sequence[Observation],
    frames: Sequence[Frame],
    follow: Follow,
    number: int,
    seed: int,
) -> list[Frame]:
    """Return a track's frames tracked once more, with each of them among the poses that are tried.

    Odd passes go back in time, so that what a late frame shows is known in the early ones.
    """
    order = range(len(frames))[:: -1 if number % 2 else 1]
    start = replace(after(task, frames[order[0]]), before=())
    shown = (
        replace(observations[k], estimate=(frames[k].pose, frames[k].translation))
        for k in order
    )
    again = list(
        follow(
            reversed_task(start) if number % 2 else start,
            shown,
            stream(seed, "pass", number),
        )
    )
    return again[:: order.step]


def reversed_task(task: Task) -> Task:
    """Return a task whose observations go back in time."""
    return replace(
        task, training=[motion.reversed() for motion in task.training], backwards=True
    )


def joined(skeleton: Skeleton, behind: Sequence[Frame], ahead: Frame) -> list[Frame]:
    """Return frames whose posterior trajectories go on as those of the frame from which both ways were followed.

    Each of its trajectories goes on as the nearest one there.
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


def spin_mask(yaws: Array, usable: NDArray[np.bool_], fps: float) -> NDArray[np.bool_]:
    """Return in which frames (T,) a body spins, by its yaws (T,) in radians, where it is visible."""
    spins = np.zeros(len(yaws), dtype=bool)
    reach = max(round(SPIN_SECONDS * fps), 1)
    turned = np.abs(wrapped(yaws[reach:] - yaws[:-reach]))
    for k in np.flatnonzero((turned > SPIN_ANGLE) & usable[reach:] & usable[:-reach]):
        spins[k : k + reach + 1] = True
    return spins


def facing_consensus(
    frames: Sequence[Frame],
    cameras: Sequence[Camera],
    usable: NDArray[np.bool_],
    fps: float,
) -> NDArray[np.bool_]:
    """Return which frames (T,) face where the whole track does, by the likeliest sequence of yaws without spins.

    A frame may face where it was estimated, or where its reflection does; the latter goes against its votes, one for
    each camera that sees the person. Frames that spin have no votes, nor those that show too little.
    """
    yaws = np.array([frame.pose[0] for frame in frames])
    steady = ~spin_mask(yaws, usable, fps)
    # no turn has time during a spin
    rows = np.flatnonzero(usable & steady)
    clock = steady.cumsum()
    agrees = np.zeros(len(frames), dtype=bool)
    if not len(rows):
        return agrees
    voters = [frames[k] for k in rows.tolist()]
    views = np.array([frame.areas.any(axis=1) for frame in voters])
    camera_yaws = [
        facing(cameras[int(seeing.argmax())], frame.translation)
        for frame, seeing in zip(voters, views, strict=True)
    ]
    both = np.column_stack(
        [yaws[rows], 2.0 * np.array(camera_yaws) + np.pi - yaws[rows]]
    )
    against = np.column_stack(
        [np.zeros(len(rows)), views.sum(axis=1) * VOTES_PER_SECOND / fps]
    )
    turned = np.abs(wrapped(both[1:, None] - both[:-1, :, None]))
    seconds = (clock[rows[1:]] - clock[rows[:-1]]) / fps
    excess = np.maximum(turned - MAX_TURN_RATE * seconds[:, None, None], 0.0)
    agrees[rows] = cheapest_sequence(against, EXCESS_TURN_VOTES * excess) == 0
    return agrees


def best_ends(
    frames: Sequence[Frame], start: int, stop: int, fps: float
) -> tuple[int, int]:
    """Return a frame near the beginning of a run, and one near its end: the best that most cameras see.

    The first and the last of all frames need not be good, as nothing goes on from there.
    """
    near = min(max(round(END_SECONDS * fps), 1), (stop - start + 1) // 2)

    def best(rows: range) -> int:
        return min(
            rows,
            key=lambda k: (-int(frames[k].areas.any(axis=1).sum()), frames[k].cost),
        )

    first = best(range(start, start + near)) if start else 0
    return first, best(range(stop - 1, stop - 1 - near, -1)) if stop < len(
        frames
    ) else stop - 1
