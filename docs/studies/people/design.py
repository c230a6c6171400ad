"""Which tracks there are: a base, one thing changed at a time, other methods on the same, and a walker's own clips.

The base are walks from every side and in two cameras: the first yaw told to 25 degrees, the translation known, the body
exact, the silhouettes clean. The full product would be thousands of tracks. Which half-cycle a walk from one side is
taken for hangs on a few draws, so that these are followed with several seeds.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from people.clips import GROUPS, RUNS, WALKS, Piece
from posefit.motion import recorded
from posefit.sweep.cell import ALL_AROUND

Views = tuple[float, ...]

TOLD_DEGREES = 25.0  # to which a first yaw is told
OFF_PERCENT = 10.0  # that bones and radii of another body are off at most: five per cent, root mean square
DAMAGE = {"holes": 0.3, "blobs": 0.3, "jitter": 0.3, "dropped": 0.1}
BASE, AGAIN, OTHERS, OWN = "base", "other seeds", "methods", "own clips"
TOLD: Mapping[str, Any] = {"yaw_off_degrees": TOLD_DEGREES}
CHANGES: dict[str, Mapping[str, Any]] = {
    "first yaw unknown": {"yaw_off_degrees": ALL_AROUND},
    "translation aligned": {"translation": "aligned"},
    "aligned, first yaw unknown": {"translation": "aligned", "yaw_off_degrees": ALL_AROUND},
    "body 5 % off": {"body_off_percent": OFF_PERCENT},
    "damaged silhouettes": {"corruption": DAMAGE},
    "all of these": {
        "translation": "aligned",
        "yaw_off_degrees": ALL_AROUND,
        "body_off_percent": OFF_PERCENT,
        "corruption": DAMAGE,
    },
}
# What a tracker that follows the library gains by each of its steps: the same without it.
EXEMPLARS = "exemplars"
STEPS: dict[str, Mapping[str, Any]] = {
    "the path alone": {"settings": {f"{EXEMPLARS}.refiner": "none", f"{EXEMPLARS}.smoothing": 0.0}},
    "refined, not smoothed": {"settings": {f"{EXEMPLARS}.smoothing": 0.0}},
    "no mirror images": {"settings": {f"{EXEMPLARS}.mirrored": False}},
}
METHODS = ("sapso@pca", "annealed@pca", "sapso@loose", "annealed@loose", "vsmm")
OWN_CLIP, OWN_TRAIN, OWN_FRAMES = "16_17", "16_15", 60  # as in the accuracy table
SIDES: tuple[Views, ...] = ((0.0,), (45.0,), (90.0,), (135.0,), (180.0,))
PAIRS: tuple[Views, ...] = ((0.0, 90.0), (45.0, 135.0))
OBLIQUE: Views = (45.0,)


class Planned(NamedTuple):
    """One track: why it is there, and what of."""

    part: str  # BASE, AGAIN, a name of CHANGES or of STEPS, OTHERS or OWN
    group: str
    clip: Piece
    views: Views
    method: str
    spec: Mapping[str, Any]

    @property
    def place(self) -> tuple[str, Piece, Views]:
        """What two tracks have in common that are compared."""
        return self.group, self.clip, self.views


@dataclass(frozen=True, kw_only=True)
class Extent:
    """How many of each group's clips, seen from where."""

    walks: int = 9
    views: Sequence[Views] = (*SIDES, *PAIRS)
    seeds: Sequence[int] = (1, 2)  # walks in one view are followed again with these
    changed: int = 7  # walks of which one thing is changed at a time
    changed_views: Sequence[Views] = SIDES[:3]
    runs: int = 8
    run_views: Sequence[Views] = SIDES
    stepped_runs: int = 8  # runs on which a step is left out, as on all walks of which something is changed
    rest: int = 5
    rest_views: Sequence[Views] = (*SIDES[:3], PAIRS[1])
    compared: int = 5  # walks that other methods follow, too
    compared_views: Sequence[Views] = SIDES[1:3]
    compared_rest: int = 2  # of every other group, from 45 degrees


FULL = Extent()
QUICK = Extent(
    walks=4,
    views=(*SIDES[:3], PAIRS[0]),
    seeds=(),
    changed=1,
    changed_views=SIDES[1:2],
    runs=1,
    run_views=SIDES[1:2],
    stepped_runs=0,
    rest=1,
    rest_views=SIDES[1:2],
    compared=1,
    compared_views=SIDES[2:3],
    compared_rest=0,
)


def design(extent: Extent, method: str, evaluations: int, others: Sequence[str]) -> list[Planned]:
    """Return the tracks of a method; with those of `others` on some of the base, and of a walker's own clips."""
    steps = STEPS if method == EXEMPLARS else {}
    return [
        track
        for part in (
            _base(extent),
            _again(extent),
            _changed(extent),
            _stepped(extent, steps),
            _compared(extent, others),
            _own(),
        )
        for track in (_completed(one, method, evaluations) for one in part)
    ]


def _base(extent: Extent) -> Iterator[Planned]:
    counts = {WALKS: (extent.walks, extent.views), RUNS: (extent.runs, extent.run_views)}
    for group, clips in GROUPS.items():
        count, views = counts.get(group, (extent.rest, extent.rest_views))
        yield from (Planned(BASE, group, clip, view, "", TOLD) for clip in clips[:count] for view in views)


def _again(extent: Extent) -> Iterator[Planned]:
    for seed in extent.seeds:
        for clip in GROUPS[WALKS][: extent.walks]:
            yield from (
                Planned(AGAIN, WALKS, clip, view, "", {**TOLD, "seed": seed}) for view in extent.views if len(view) == 1
            )


def _changed(extent: Extent) -> Iterator[Planned]:
    for name, change in CHANGES.items():
        for clip in GROUPS[WALKS][: extent.changed]:
            for view in extent.changed_views:
                yield Planned(name, WALKS, clip, view, "", {**TOLD, **change})


def _stepped(extent: Extent, steps: Mapping[str, Mapping[str, Any]]) -> Iterator[Planned]:
    counts = {WALKS: extent.changed, RUNS: extent.stepped_runs}
    for name, step in steps.items():
        for group, count in counts.items():
            for clip in GROUPS[group][:count]:
                yield from (Planned(name, group, clip, view, "", {**TOLD, **step}) for view in extent.changed_views)


def _compared(extent: Extent, others: Sequence[str]) -> Iterator[Planned]:
    places = [(WALKS, clip, view) for clip in GROUPS[WALKS][: extent.compared] for view in extent.compared_views]
    places += [
        (group, clip, OBLIQUE) for group in GROUPS if group != WALKS for clip in GROUPS[group][: extent.compared_rest]
    ]
    yield from (Planned(OTHERS, *place, method, TOLD) for method in others for place in places)


def _own() -> Iterator[Planned]:
    clip = Piece(OWN_CLIP, OWN_FRAMES, 0, "walks and turns left")
    his = [one.name for one in recorded.clips(only=(clip.subject,)) if one.name != clip.name]
    for name, train in ((OWN_TRAIN, [OWN_TRAIN]), ("library and his others", [clip.library, *his])):
        yield from (Planned(OWN, name, clip, view, "", {"train": train}) for view in SIDES[:3])


def _completed(track: Planned, method: str, evaluations: int) -> Planned:
    """Return a track with all that its cell says."""
    clip = track.clip
    spec = {
        "method": track.method or method,
        "motion": clip.name,
        "train": [clip.library],
        "view_degrees": track.views,
        "frames": clip.frames,
        "instance": clip.instance,
        "evaluations": evaluations,
        **track.spec,
    }
    return track._replace(method=spec["method"], spec=spec)
