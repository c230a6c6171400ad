"""The recorded clips that are followed, three or four of each of the ten people of the library, and from where.

Every clip is seen from three sides by one camera, with its translation known; and once more, by two cameras or with its
translation aligned, in turn. Groups and clips are those of `people`, with more of whoever has few of them there.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from people.clips import GROUPS, Piece
from people.design import PAIRS, SIDES, TOLD, Views

FRAMES, QUICK_FRAMES = 50, 12
METHOD, EVALUATIONS = "exemplars", 2440
TEMPERATURES = (4.0, 8.0, 16.0, 32.0)  # of the posterior, one of which is chosen
OTHERS: Mapping[str, Mapping[str, Any]] = {
    "annealed@pca": {"tracker.modes": 1},  # its own particles
    "sapso@pca": {"tracker.modes": 4, "tracker.modes_share": 2.0},  # searches of a frame, each begun elsewhere
}
OTHER_FRAMES = 20  # of each clip that other methods follow
DANCES, EVERYDAY = "dances", "everyday"
# a person's clips, by group; those that other measurements have no use for
MORE = {
    EVERYDAY: (
        Piece("14_13", 120, 4, "sweeps the floor"),
        Piece("17_10", 120, 0, "boxes"),
        Piece("17_10", 120, 3, "boxes"),
    ),
    "turns": (Piece("29_01", 100, 3, "walks and turns"),),
    DANCES: (
        Piece("135_07", 120, 3, "kicks of a martial art"),
        Piece("135_03", 120, 1, "a form of a martial art"),
    ),
}
LEFT_OUT = 4  # of one person's clips, no more than so many are followed


class OneTrack(NamedTuple):
    """One track: a clip, from where, and how."""

    group: str
    clip: Piece
    views: Views
    translation: str
    frames: int
    method: str = METHOD
    temperature: float = TEMPERATURES[0]

    @property
    def spec(self) -> dict[str, Any]:
        """What its cell says."""
        own = {"exemplars.posterior_temperature": self.temperature}
        return {
            "method": self.method,
            "motion": self.clip.name,
            "train": [self.clip.library],
            "view_degrees": self.views,
            "frames": min(self.frames, self.clip.frames),
            "instance": self.clip.instance,
            "evaluations": EVALUATIONS,
            "translation": self.translation,
            "settings": own if self.method == METHOD else dict(OTHERS[self.method]),
            **TOLD,
        }


def pieces() -> list[tuple[str, Piece]]:
    """Return the clips with their groups, at most four of each person, of as many groups as he has."""
    found: list[tuple[str, Piece]] = []
    each = {group: (*clips, *MORE.get(group, ())) for group, clips in GROUPS.items()}
    for place in range(max(map(len, each.values()))):
        for group, clips in each.items():
            if place < len(clips):
                mine = [one for one in found if one[1].subject == clips[place].subject]
                if len(mine) < LEFT_OUT:
                    found.append((group, clips[place]))
    return sorted(found, key=lambda one: one[1].subject)  # whose library is made once


def planned_tracks(temperature: float, quick: bool) -> tuple[list[OneTrack], list[OneTrack]]:
    """Return the tracks at a temperature, and those with which temperatures and methods are compared."""
    base: list[OneTrack] = []
    others: list[OneTrack] = []
    for k, (group, clip) in enumerate(pieces()):
        sides = [SIDES[(2 * k + turn) % len(SIDES)] for turn in ((0,) if quick else (0, 1, 3))]
        frames = QUICK_FRAMES if quick else FRAMES
        tracks = [OneTrack(group, clip, side, "known", frames, METHOD, temperature) for side in sides]
        if not quick:
            last = (PAIRS[k // 2 % len(PAIRS)], "known") if k % 2 else (sides[0], "aligned")
            tracks.append(OneTrack(group, clip, *last, frames, METHOD, temperature))
        base += tracks
        if not quick:
            others += [tracks[0]._replace(temperature=other) for other in TEMPERATURES if other != temperature]
        few = min(frames, OTHER_FRAMES)
        others += [tracks[0]._replace(method=method, frames=few, temperature=0.0) for method in OTHERS]
    return base, others
