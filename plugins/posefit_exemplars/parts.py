"""Poses composed of parts: trunk, legs and arms, each from any pose of the clips.

No clip may show somebody who bends down while an arm waves; one shows such a trunk, and another such an arm. A window
of frames gets many candidates for one part after the other, while the other parts stay: states of the library, the
frames beside it, and the part itself, changed by differences of similar states. Their costs are exact, and the
likeliest sequence through the window is Viterbi's.

One camera leaves open which way the trunk leans or faces. So there a second hypothesis is followed: unlike states of
each frame, and reflections of some, are composed by themselves, and the likeliest sequence of these is swept as well.
Both are fused part by part.
"""

import time
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import chain, pairwise, product
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.rotation import wrapped
from posefit.geometry.skeleton import ANGLES, BONES, JOINTS, LIMBS, Skeleton, turns_of
from posefit.silhouette.limbs import SHARE, Limb
from posefit_exemplars.beam import Steps, squared_distances
from posefit_exemplars.exemplars import Codes, Exemplars, Rows, groups
from posefit_exemplars.frame_costs import FrameCosts
from posefit_exemplars.smoothing import Estimate

OUTER = ("left leg", "right leg", "left arm", "right arm")
_OUTER_BONES = [bone for limb in OUTER for bone in LIMBS[limb]]
PARTS: Mapping[str, Sequence[str]] = {
    "trunk": [bone for bone in BONES if bone not in _OUTER_BONES],  # and the head
    **{limb: LIMBS[limb] for limb in OUTER},
}

STATES = 15000  # of a part's library at most
GROUPS = 120  # of similar states
SPEEDS = {0.0: 0.3, 0.5: 0.1, 1.0: 0.0, 1.4: 0.15}  # at which a part goes on, and what each costs
HIGHEST = 4.0  # cost of a step of one part
WIDE, SMALL = 4, 1  # shares of the candidates: of a limb in the first sweep, of others
SWEEPS = 3  # over all parts
AHEAD = 2  # frames that are composed with those before them, and again with those after them
BEHIND = 3  # frames that stay, from which the next ones go on
LEAST = 6  # candidates; where the budget is for fewer, there are fewer sweeps
MEMBERS = 5  # drawn from each of the groups that fit best
KEPT = 60  # candidates of a frame of which a path is made
NEAR_GROUPS = 3  # whose states are similar to one
SCALES = (0.25, 0.5, 1.0)  # of the differences by which a part is changed
YAW = np.radians(3.0)  # standard deviation of the changes of its yaw
REFLECTED = 3  # poses of a frame whose reflections are composed by themselves, too
ALONE = 0.4  # share of the evaluations for poses by themselves; the rest is for sweeps over both hypotheses


@dataclass(frozen=True, eq=False)
class Part:
    """The states of a part. Its codes are joints where all else is at rest, as far apart as the part sets poses."""

    turns: NDArray[np.intp]  # (k,) where its angles stand in a pose (66,)
    joints: NDArray[np.intp]
    yaw: float  # what a radian of yaw counts in the last dimension of a code, metres; 0 for a limb, which has none
    skeleton: Skeleton = field(repr=False)
    angles: Array = field(repr=False)  # (K, k) radians; a yaw is 0
    codes: Codes = field(repr=False)  # (K, D) metres
    rates: Codes = field(repr=False)  # (K, D) metres a second, in the clip
    centres: Rows = field(repr=False)  # (G,) a state of each group
    members: Sequence[Rows] = field(repr=False)  # the states of each group

    def coded(self, angles: Array) -> Codes:
        """Return the codes (n, D) of angles (n, k)."""
        return _coded(self.skeleton, self.turns, self.joints, self.yaw, angles)

    def similar(self, codes: Codes) -> list[Rows]:
        """Return for each of some codes (n, D) the states of the groups nearest to it."""
        centres = self.codes[self.centres]
        if self.yaw:
            codes, centres = codes[:, :-1], centres[:, :-1]
        nearest = np.argsort(squared_distances(codes, centres), axis=1)[:, :NEAR_GROUPS]
        return [np.concatenate([self.members[group] for group in row]) for row in nearest]


def _coded(skeleton: Skeleton, turns: NDArray[np.intp], joints: NDArray[np.intp], yaw: float, angles: Array) -> Codes:
    poses = np.zeros((len(angles), ANGLES))
    poses[:, turns] = angles
    poses[:, 0] = 0.0
    codes = skeleton.joints(poses)[:, joints].reshape(len(angles), -1) / np.sqrt(len(JOINTS))
    return np.asarray(np.column_stack([codes, yaw * angles[:, 0]]) if yaw else codes, dtype=np.float32)


@lru_cache(maxsize=1)
def parts_of(exemplars: Exemplars, yaw: float) -> list[Part]:
    """Return the parts of exemplars; `yaw` is what a radian of the trunk's counts, metres."""
    states = np.linspace(0, len(exemplars) - 1, min(STATES, len(exemplars))).astype(np.int64)
    lasts = exemplars.lasts[exemplars.clips[states]]
    firsts = np.concatenate([[0], exemplars.lasts[:-1] + 1])[exemplars.clips[states]]
    later, earlier = np.minimum(states + 1, lasts), np.maximum(states - 1, firsts)
    seconds = np.maximum(exemplars.times[later] - exemplars.times[earlier], 1e-3)[:, None]
    now, before, after = (exemplars.poses[rows] for rows in (states, earlier, later))
    now[:, 0], after[:, 0], before[:, 0] = 0.0, wrapped(after[:, 0] - before[:, 0]), 0.0
    parts = []
    for name, bones in PARTS.items():
        ends = bones
        turns = turns_of(bones)
        if name not in OUTER:
            turns = np.concatenate([np.arange(3), turns])
        if name == "trunk":  # with the bones beyond it that it moves most
            ends = [*bones, *(bone for limb in OUTER for bone in LIMBS[limb][:2])]
        joints = np.array([JOINTS.index(bone) for bone in ends])
        how = exemplars.coding.skeleton, turns, joints, 0.0 if name in OUTER else yaw
        codes = _coded(*how, now[:, turns])
        rates = ((_coded(*how, after[:, turns]) - _coded(*how, before[:, turns])) / seconds).astype(np.float32)
        centres, owners = groups(codes, GROUPS)
        members = [np.flatnonzero(owners == group) for group in range(len(centres))]
        parts.append(Part(turns, joints, how[3], how[0], now[:, turns], codes, rates, centres, members))
    return parts


def part_steps(spread: float, codes: Codes, rates: Codes, later: Codes, later_rates: Codes) -> Array:
    """Return what it costs (n, m) that a part goes from codes to `later` ones in a frame, with rates a frame.

    Half the square, over the `spread`, of what it is off where the mean of both rates leads, and of their difference;
    at the cheapest of a few speeds.
    """
    scale = 0.5 / spread**2
    changes = squared_distances(rates, later_rates)
    costs = np.full(changes.shape, HIGHEST)
    for speed, cost in SPEEDS.items():
        half = np.float32(0.5 * speed)
        off = squared_distances(codes + half * rates, later - half * later_rates)
        np.minimum(costs, scale * (off + speed**2 * changes) + cost, out=costs)
    return costs


@dataclass(eq=False)
class Window:
    """Successive frames whose poses are composed; the first few, `fixed` in number, stay as they are."""

    looks: Sequence[FrameCosts]
    poses: Array  # (T, 66)
    places: Array  # (T, 3) metres
    fixed: int
    offset: Array  # (66,) of the latest composed pose from where it began: a person's own style stays


class _Candidates(NamedTuple):
    """Candidates for a part in one frame."""

    angles: Array  # (n, k)
    rates: Codes  # (n, D) metres a frame
    places: Array  # (n, 3)
    fits: Array  # (n,) costs of silhouettes over the temperature

    def chosen(self, rows: Rows) -> "_Candidates":
        """Return some of them."""
        return _Candidates(self.angles[rows], self.rates[rows], self.places[rows], self.fits[rows])


@dataclass(frozen=True, eq=False)
class Composer:
    """Sweeps over the parts of windows: the first with candidates from everywhere, the others with small changes."""

    parts: Sequence[Part]
    limbs: Sequence[Limb | None]  # of each part; None for the trunk, with which everything moves
    spread: float  # metres, as of steps between exemplars
    temperature: float
    seconds: float  # a frame

    @classmethod
    def of(cls, exemplars: Exemplars, body: Body, steps: Steps, temperature: float, seconds: float) -> Self:
        """Return sweeps over the parts of a body, with states from exemplars."""
        parts = parts_of(exemplars, steps.spread / steps.turning)
        limbs = [Limb.of(body, name) if name in OUTER else None for name in PARTS]
        return cls(parts, limbs, steps.spread, temperature, seconds)

    def compose(self, window: Window, evaluations: float, rng: np.random.Generator) -> float:
        """Change the window's poses and places; return the evaluations used, at most so many for each usable frame."""
        window.poses[:, 0] = np.unwrap(window.poses[:, 0])
        rates = [_rates(part.coded(window.poses[:, part.turns])) for part in self.parts]
        for number in range(SWEEPS, 0, -1):
            sweeps = [
                (k, WIDE if k and not first else SMALL) for first in range(number) for k in range(len(self.parts))
            ]
            small = evaluations / sum(share * self._share(k) for k, share in sweeps)
            if small >= LEAST:
                break
        else:
            return 0.0
        used = 0.0
        for k, share in sweeps:
            rates[k], tried = self._swept(window, k, rates[k], int(small * share), share == WIDE, rng)
            used += tried * self._share(k)
        return used

    def _share(self, k: int) -> float:
        return 1.0 if self.limbs[k] is None else SHARE

    def _swept(
        self, window: Window, k: int, rates: Codes, count: int, wide: bool, rng: np.random.Generator
    ) -> tuple[Codes, int]:
        """Give a part its likeliest angles; return its rates (T, D) with them, and the number of candidates."""
        part, looks = self.parts[k], window.looks
        current = window.poses[:, part.turns]
        codes = part.coded(current)
        similar, tried = part.similar(codes), 0
        pools: list[tuple[_Candidates, Codes]] = []
        for t in range(len(looks)):
            pool = _Candidates(current[t : t + 1], rates[t : t + 1], window.places[t : t + 1], np.zeros(1))
            if t >= window.fixed:
                angles, speeds = self._changed(part, window, t, rates, similar[t], count // 4 if wide else count, rng)
                pool = self._evaluated(window, k, t, angles, speeds)
                if wide:
                    pool = self._from_everywhere(pool, window, k, t, count - len(angles), rng)
                tried += len(pool.fits) if looks[t].usable else 0
            reached, beside = part.coded(pool.angles), np.zeros(len(pool.fits))
            if t > 0:
                beside += part_steps(self.spread, codes[[t - 1]], rates[[t - 1]], reached, pool.rates)[0]
            if t + 1 < len(looks):
                beside += part_steps(self.spread, reached, pool.rates, codes[[t + 1]], rates[[t + 1]])[:, 0]
            # half of them for the frames beside it as they are, the others for what these may become
            kept = np.union1d(_least(pool.fits + beside, KEPT // 2), _least(pool.fits, KEPT // 2))
            pools.append((pool.chosen(kept), reached[kept]))
        steps = (
            part_steps(self.spread, one, before.rates, then, pool.rates)
            for (before, one), (pool, then) in pairwise(pools)
        )
        path = [*zip(pools, _likeliest([pool.fits for pool, _ in pools], steps), strict=True)]
        window.poses[:, part.turns] = [pool.angles[row] for (pool, _), row in path]
        window.places[:] = [pool.places[row] for (pool, _), row in path]
        return np.array([pool.rates[row] for (pool, _), row in path]), tried

    def _changed(
        self, part: Part, window: Window, t: int, rates: Codes, similar: Rows, count: int, rng: np.random.Generator
    ) -> tuple[Array, Codes]:
        """Return angles and rates of a part as it is, as it is in the frames beside, and with changes."""
        current = window.poses[:, part.turns]
        beside = [t, t, max(t - 1, 0), min(t + 1, len(current) - 1)]
        angles, speeds = current[beside], rates[beside]
        angles[1] += window.offset[part.turns]
        changes = max(count - len(beside), 1)
        first, second = similar[rng.integers(0, len(similar), (2, changes))]
        scale = rng.choice(SCALES, changes)[:, None]
        moved = current[t] + scale * wrapped(part.angles[first] - part.angles[second])
        if part.yaw:
            moved[:, 0] += rng.normal(0.0, YAW, changes)
        faster = rates[t] + 0.5 * self.seconds * scale * (part.rates[first] - part.rates[second])
        return np.concatenate([angles, moved]), np.concatenate([speeds, faster.astype(np.float32)])

    def _from_everywhere(
        self, pool: _Candidates, window: Window, k: int, t: int, count: int, rng: np.random.Generator
    ) -> _Candidates:
        """Return candidates with others from the library: a state of each group, then more of those that fit best."""
        part = self.parts[k]
        centres = part.centres[: 2 * count // 3]
        first = self._evaluated(window, k, t, part.angles[centres], self.seconds * part.rates[centres])
        left = count - len(centres)
        groups = _least(first.fits, -(-left // MEMBERS))
        states = np.concatenate([rng.choice(part.members[group], MEMBERS) for group in groups])[:left]
        more = self._evaluated(window, k, t, part.angles[states], self.seconds * part.rates[states])
        every = pool, first, more
        return _Candidates(
            np.concatenate([one.angles for one in every]),
            np.concatenate([one.rates for one in every]),
            np.concatenate([one.places for one in every]),
            np.concatenate([one.fits for one in every]),
        )

    def _evaluated(self, window: Window, k: int, t: int, angles: Array, rates: Codes) -> _Candidates:
        """Return candidates with their costs; a frame that shows nothing makes none cost anything."""
        look, limb, pose = window.looks[t], self.limbs[k], window.poses[t]
        places = np.repeat(window.places[t : t + 1], len(angles), axis=0)
        if not look.usable:
            return _Candidates(angles, rates, places, np.zeros(len(angles)))
        if limb is not None:
            costs = look.limb(limb, pose, window.places[t], angles)
        else:
            poses = np.repeat(pose[None], len(angles), axis=0)
            poses[:, self.parts[k].turns] = angles
            places = look.placed(poses, places)
            costs = look.full(poses, places)
        return _Candidates(angles, rates, places, costs / self.temperature)

    def alone(
        self, look: FrameCosts, poses: Array, places: Array, evaluations: float, rng: np.random.Generator
    ) -> tuple["Whole", float]:
        """Return poses (n, 66) of a frame, each composed by itself, and the evaluations used, at most so many."""
        share, used = evaluations / len(poses) - 1.0, float(len(poses))
        windows = [
            Window([look], pose[None].copy(), place[None].copy(), 0, np.zeros(ANGLES))
            for pose, place in zip(poses, places, strict=True)
        ]
        used += sum(self.compose(window, share, rng) for window in windows)
        poses, places = (np.concatenate([getattr(window, name) for window in windows]) for name in ("poses", "places"))
        return self._whole(poses, places, look.full(poses, places), None), used

    def _whole(self, poses: Array, places: Array, costs: Array, rates: Sequence[Codes] | None) -> "Whole":
        """Return poses with their codes; without rates they are at rest."""
        codes = [_round(part, part.coded(poses[:, part.turns])) for part in self.parts]
        return Whole(poses, places, costs / self.temperature, codes, rates or [np.zeros_like(code) for code in codes])

    def _path(self, frames: Sequence["Whole"]) -> list[int]:
        """Return the pose of each frame on the path of least cost."""
        steps = (
            np.sum(
                [
                    part_steps(self.spread, *each)
                    for each in zip(one.codes, one.rates, then.codes, then.rates, strict=True)
                ],
                axis=0,
            )
            for one, then in pairwise(frames)
        )
        return _likeliest([frame.fits for frame in frames], steps)

    def compose_both(
        self, window: Window, others: Sequence["Whole | None"], evaluations: float, rng: np.random.Generator
    ) -> float:
        """Compose the window's poses, and the likeliest sequence of the others, and fuse both; as `compose`."""
        other = self.through(window, others)
        share = 0.5 * (evaluations - 2.0 ** len(self.parts))
        return sum(self.compose(one, share, rng) for one in (window, other)) + self.fused(window, other)

    def through(self, window: Window, frames: Sequence["Whole | None"]) -> Window:
        """Return a window with the likeliest sequence of the frames' poses; None is for a frame that stays."""
        stays = [
            self._whole(window.poses[t : t + 1], window.places[t : t + 1], np.zeros(1), None)
            for t in range(len(frames))
        ]
        given = [frame or stay for frame, stay in zip(frames, stays, strict=True)]
        rows = self._path(given)
        poses, places = (
            np.array([getattr(frame, name)[row] for frame, row in zip(given, rows, strict=True)])
            for name in ("poses", "places")
        )
        return replace(window, poses=poses, places=places)

    def fused(self, window: Window, other: Window) -> float:
        """Give a window the likeliest sequence of poses whose parts are its own or those of another window's.

        Return the evaluations used.
        """
        both, rates = (window, other), []
        for one in both:
            rates.append([_rates(_round(part, part.coded(one.poses[:, part.turns]))) for part in self.parts])
        choices, frames = [*product((0, 1), repeat=len(self.parts))], []
        for t, look in enumerate(window.looks):
            poses = np.repeat(window.poses[t : t + 1], len(choices), axis=0)
            for row, choice in enumerate(choices):
                for part, which in zip(self.parts, choice, strict=True):
                    poses[row, part.turns] = both[which].poses[t, part.turns]
            places = np.array([both[choice[0]].places[t] for choice in choices])
            costs = look.full(poses, places) if look.usable and t >= window.fixed else np.zeros(len(poses))
            speeds = [np.array([rates[choice[k]][k][t] for choice in choices]) for k in range(len(self.parts))]
            frames.append(self._whole(poses, places, costs, speeds))
        for t, row in enumerate(self._path(frames)):
            window.poses[t], window.places[t] = frames[t].poses[row], frames[t].places[row]
        return float(len(choices) * sum(look.usable for look in window.looks[window.fixed :]))


class Whole(NamedTuple):
    """Whole poses of one frame."""

    poses: Array  # (n, 66)
    places: Array  # (n, 3)
    fits: Array  # (n,) costs of silhouettes over the temperature
    codes: Sequence[Codes]  # (n, D) of each part; a yaw is on a circle
    rates: Sequence[Codes]


def _round(part: Part, codes: Codes) -> Codes:
    """Return codes whose yaw, if they have one, is a point on a circle, so that a full turn is no distance."""
    if not part.yaw:
        return codes
    yaws = codes[:, -1:] / part.yaw
    return np.hstack([codes[:, :-1], part.yaw * np.cos(yaws), part.yaw * np.sin(yaws)])


def _likeliest(fits: Sequence[Array], steps: Iterable[Array]) -> list[int]:
    """Return the row of each frame on the path of least cost: `fits` (n,) of each, and steps (n, m) between them."""
    totals, origins = fits[0], []
    for step, fit in zip(steps, fits[1:], strict=True):
        ways = totals[:, None] + step
        origins.append(ways.argmin(axis=0))
        totals = ways.min(axis=0) + fit
    path = [int(totals.argmin())]
    for origin in reversed(origins):
        path.append(int(origin[path[-1]]))
    return path[::-1]


def _rates(codes: Codes) -> Codes:
    """Return how fast codes (T, D) change a frame."""
    return np.gradient(codes, axis=0) if len(codes) > 1 else np.zeros_like(codes)


def _least(costs: Array, count: int) -> Rows:
    return np.argsort(costs, kind="stable")[:count]


def composed(
    frames: Iterable[Estimate], composer: Composer, evaluations: float, delay: int, rng: np.random.Generator
) -> Iterator[Estimate]:
    """Yield each frame with its pose composed of parts, up to `delay` frames later; `evaluations` are for each frame.

    Several frames are composed together, with a few before them that stay and a few later ones, which come again.
    """
    waiting: list[tuple[Estimate, Whole | None]] = []
    latest: deque[Estimate] = deque(maxlen=BEHIND)
    offset = np.zeros(ANGLES)
    for frame in chain(frames, [None]):
        if frame is not None:
            waiting.append(_with_others(frame, composer, ALONE * evaluations, rng))
        if not waiting or (frame is not None and len(waiting) <= delay):
            continue
        count = len(waiting) if frame is None else max(len(waiting) - AHEAD, 1)
        start, cpu_start = time.perf_counter(), time.process_time()
        some = [*latest, *(one for one, _ in waiting)]
        poses, places = np.array([one.pose for one in some]), np.array([one.place for one in some])
        window = Window([one.look for one in some], poses.copy(), places, len(latest), offset)
        usable = [one.look.usable for one, _ in waiting]
        shared = evaluations * sum(usable[:count]) / max(sum(usable), 1)
        others = [None] * len(latest) + [whole for _, whole in waiting]
        if any(others):
            used = composer.compose_both(window, others, (1.0 - ALONE) * shared, rng)
        else:
            used = composer.compose(window, shared, rng)
        used /= max(sum(usable[:count]), 1)
        offset = wrapped(window.poses - poses)[len(latest) + count - 1]
        spent = (time.perf_counter() - start) / count, (time.process_time() - cpu_start) / count
        moved = [*zip(waiting, window.poses[window.fixed :], window.places[window.fixed :], strict=True)]
        waiting = [(replace(one, pose=pose, place=place), whole) for (one, whole), pose, place in moved[count:]]
        for (one, _), pose, place in moved[:count]:
            place = one.look.placed(pose[None], place[None])[0] if one.look.usable else place
            latest.append(replace(one.longer(used * one.look.usable, *spent), pose=pose, place=place))
            yield latest[-1]


def _with_others(
    frame: Estimate, composer: Composer, evaluations: float, rng: np.random.Generator
) -> tuple[Estimate, Whole | None]:
    """Return a frame and its other hypotheses, each composed by itself, or None; the frame has their evaluations."""
    if frame.others is None or not frame.look.usable:
        return frame, None
    start, cpu_start = time.perf_counter(), time.process_time()
    poses = np.concatenate([frame.pose[None], frame.others[0]])
    places = np.concatenate([frame.place[None], frame.others[1]])
    poses = np.concatenate([poses, frame.look.reflected(poses[:REFLECTED], frame.place)])
    places = np.concatenate([places, places[:REFLECTED]])
    whole, used = composer.alone(frame.look, poses, places, evaluations, rng)
    return frame.longer(used, time.perf_counter() - start, time.process_time() - cpu_start), whole
