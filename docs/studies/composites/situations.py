"""What happens before the cameras, and where they stand: each situation a few times, with other people."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from composites import ways
from composites.ways import Actor, frames_of
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import MIRROR
from posefit.motion.motion import Motion

SIZE = (640, 360)  # pixels of a frame
DISTANCE, HEIGHT = 8.0, 0.95  # metres of a camera from the middle, and above the ground
ACROSS = np.radians(36.0)  # that a camera sees
PLACES: Mapping[int, Sequence[float]] = {1: (0.0,), 2: (-30.0, 30.0), 4: (-30.0, 30.0, 150.0, 210.0)}  # degrees
REACH = {1: 3.4, 2: 5.2, 4: 5.2}  # metres to either side, where nobody is seen any more
EMPTY, AWAY = 10, 20  # frames without anybody: before and after, and until somebody comes back
FARTHER = 1.5  # that whoever passes aside goes to either side, for each metre aside
NEARER = 0.7  # metres from the middle, of each of two who pass
MIRRORED = [joint - 1 for joint in MIRROR[1:]]  # of each bone, the one on the other side
GIRTH = 10.0  # percent that a part of the body may be thicker or thinner than the library's
LONGEST = 240  # frames of somebody who is always there

# Who goes through (clips of one cycle at least), and who is always there (from which frame on, to which): others in
# each try.
WALKS = ("16_47", "02_01", "49_01")
STAYING: Mapping[str, Sequence[tuple[str, int, int]]] = {
    "stands": (("49_15", 0, 150), ("14_04", 0, 150), ("29_02", 100, 250)),
    "waves": (("29_05", 60, 240), ("14_05", 40, 212), ("02_06", 0, 180)),
    "to and fro": (("29_01", 0, LONGEST), ("09_12", 0, LONGEST), ("09_12", 200, 200 + LONGEST)),
}


@dataclass(frozen=True, eq=False)
class Situation:
    """Actors and cameras; who is followed is the first actor."""

    name: str
    views: int
    actors: Sequence[Actor]
    cameras: Sequence[Camera] = field(repr=False)

    def __len__(self) -> int:
        return len(self.actors[0].motion)

    @property
    def people(self) -> Sequence[str]:
        """Who they are, in the library."""
        return sorted({actor.motion.name.partition("_")[0] for actor in self.actors})


SHOWS = {
    "through": "somebody walks through",
    "again": "the same, who comes again the same way",
    "back": "the same, who comes back the other way",
    "two": "two people who pass each other",
    "to and fro": "somebody who is always there and walks to and fro",
    "stands": "somebody who is always there and stands",
    "waves": "somebody who is always there and moves on the spot",
}
PASSING = ("through", "again", "back")  # one person, who is not always there
ALWAYS = ("to and fro", "stands", "waves")


def check_situation(name: str, views: int) -> None:
    """Return nothing. Raises ValueError where there is no situation of that name, or none for so many cameras."""
    if name not in SHOWS:
        raise ValueError(f"situation must be one of {', '.join(SHOWS)}, got {name!r}")
    if views not in PLACES:
        raise ValueError(f"views must be one of {', '.join(map(str, PLACES))}, got {views}")


def situation(name: str, views: int, seed: int) -> Situation:
    """Return a situation before so many cameras. Raises ValueError where there is none of that name or number."""
    check_situation(name, views)
    rng = np.random.default_rng([seed, views])
    turned = rng.uniform(-8.0, 8.0)  # degrees, so that no side view is exactly one
    target = np.array([0.0, HEIGHT, 0.0])
    cameras = [Camera.around(target, np.radians(degrees + turned), DISTANCE, SIZE, ACROSS) for degrees in PLACES[views]]
    return Situation(name, views, _actors(name, views, seed), cameras)


def _actors(name: str, views: int, seed: int) -> Sequence[Actor]:
    walk = WALKS[seed % len(WALKS)]
    if name in STAYING:
        return [_staying(STAYING[name][seed % len(STAYING[name])], seed, along=name == "to and fro")]
    if name == "through":
        return [_walker(walk, views, seed)]
    if name == "two":
        near = _walker(walk, views, seed, aside=NEARER)
        far = _walker(WALKS[(seed + 1) % len(WALKS)], views, seed + 1, back=True, aside=-NEARER)
        count = max(len(near.motion), len(far.motion))
        return [_lasting(actor, count) for actor in (near, far)]
    return [_returning(walk, views, seed, back=name == "back")]


def _dressed(motion: Motion, seed: int) -> tuple[Motion, Body]:
    """Return a motion, and a body whose parts are thicker and thinner than proportions say, left and right alike."""
    body = Body.of(motion.skeleton)
    shares = 1.0 + np.random.default_rng([seed, 1]).uniform(-GIRTH, GIRTH, len(body.radii)) / 100.0
    return motion, body.scaled(1.0, 0.5 * (shares + shares[MIRRORED]))


def _walker(name: str, views: int, seed: int, *, back: bool = False, aside: float = 0.0) -> Actor:
    motion, body = _dressed(frames_of(name), seed)
    walk = ways.through(motion, body, REACH[views] + FARTHER * abs(aside), back=back, aside=aside)
    whole, present = ways.one_after_other([EMPTY, walk, EMPTY])
    return Actor(body, whole, present, seed)


def _returning(name: str, views: int, seed: int, *, back: bool) -> Actor:
    motion, body = _dressed(frames_of(name), seed)
    first, second = (ways.through(motion, body, REACH[views], back=way) for way in (False, back))
    whole, present = ways.one_after_other([EMPTY, first, AWAY, second, EMPTY])
    return Actor(body, whole, present, seed)


def _staying(frames: tuple[str, int, int], seed: int, *, along: bool) -> Actor:
    """Return somebody who is always there: he walks along x, or faces the first camera about."""
    motion, body = _dressed(frames_of(*frames), seed)
    if along:
        turn = ways.ALONG - ways.longest(motion)
    else:
        turn = np.random.default_rng([seed, 2]).uniform(-0.8, 0.8) - motion.poses[0, 0]
    there = ways.on_ground(ways.facing_elsewhere(motion, turn), body)
    there = ways.moved(there, -ways.middle_of(there))
    return Actor(body, there, np.ones(len(there), dtype=bool), seed)


def _lasting(actor: Actor, count: int) -> Actor:
    missing = count - len(actor.motion)
    if not missing:
        return actor
    whole, present = ways.one_after_other([actor.motion, missing])
    present[: len(actor.present)] = actor.present
    return replace(actor, motion=whole, present=present)
