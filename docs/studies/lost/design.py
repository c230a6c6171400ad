"""Which tracks there are: every clip of `people`, and people who gesture and who stand, with clean and real masks.

All views with all conditions and clips would be thousands of tracks. Here both go round, each at its own pace. Every
clip is followed once under one of the conditions of `people` and once with silhouettes as a camera's masks are, where
nobody tells where the person is, how he faces or how he is built; walks, gestures and standing people, of which most
footage is, once more with such silhouettes.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from people.clips import GROUPS, WALKS, Piece
from people.design import CHANGES, PAIRS, SIDES, TOLD, Views

CLEAN, MASKS = "as they are", "as masks are"
CONDITIONS: Mapping[str, Mapping[str, Any]] = {CLEAN: {}, **CHANGES}
WORN = CHANGES["all of these"]["corruption"]
UNTOLD = {name: value for name, value in CHANGES["all of these"].items() if value is not WORN}
VIEWS: tuple[Views, ...] = (*SIDES, *PAIRS)
FRAMES = 48  # of a clip at most
QUICK_CLIPS = 2  # of a group, in a quick look, which are two people's
ON_THE_SPOT: dict[str, tuple[Piece, ...]] = {
    "gestures": (
        Piece("29_05", FRAMES, 1, "moves his arms"),
        Piece("14_24", FRAMES, 2, "moves his arms"),
        Piece("02_10", FRAMES, 4, "washes himself"),
        Piece("29_20", FRAMES, 0, "moves his arms and turns"),
        Piece("14_10", FRAMES, 1, "does something with his hands"),
        Piece("135_02", FRAMES, 2, "a form of a martial art, on the spot"),
        Piece("02_07", FRAMES, 4, "swings something"),
        Piece("49_20", FRAMES, 1, "lifts his arms"),
    ),
    "stands": (
        Piece("49_15", 41, 1, "stands"),
        Piece("29_02", FRAMES, 3, "stands"),
        Piece("14_05", FRAMES, 2, "stands"),
        Piece("05_12", FRAMES, 2, "stands"),
        Piece("135_06", FRAMES, 0, "stands"),
        Piece("29_24", FRAMES, 4, "stands"),
    ),
}
EVERY = {**GROUPS, **ON_THE_SPOT}
USUAL = (WALKS, *ON_THE_SPOT)  # what most footage is of


class Turn(NamedTuple):
    """One track: what of, and under which condition."""

    group: str
    clip: Piece
    views: Views
    condition: str

    def spec(self, method: str, evaluations: int) -> dict[str, Any]:
        """Return the cell of the track, followed by a method; that masks are a camera's is not in it."""
        return {
            "method": method,
            "motion": self.clip.name,
            "train": [self.clip.library],
            "view_degrees": self.views,
            "frames": min(self.clip.frames, FRAMES),
            "instance": self.clip.instance,
            "evaluations": evaluations,
            **TOLD,
            **(UNTOLD if self.condition == MASKS else CONDITIONS[self.condition]),
        }


def turns(quick: bool) -> list[Turn]:
    """Return the tracks, those of one person together, since they learn from one library."""
    clips = [(group, clip) for group, found in EVERY.items() for clip in found[: QUICK_CLIPS if quick else None]]
    conditions, tracks = list(CONDITIONS), []
    for k, (group, clip) in enumerate(clips):
        tracks.append(Turn(group, clip, VIEWS[k % len(VIEWS)], conditions[(3 * k + k // len(VIEWS)) % len(conditions)]))
        tracks.append(Turn(group, clip, VIEWS[(k + 2) % len(VIEWS)], MASKS))
        if group in USUAL and not quick:
            tracks.append(Turn(group, clip, SIDES[(k + 4) % len(SIDES)], MASKS))
    return sorted(set(tracks), key=lambda track: (track.clip.subject, track))
