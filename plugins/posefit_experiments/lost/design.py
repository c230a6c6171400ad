"""Which tracks there are: every clip of `people` a few times, each time from other sides under another condition.

All views with all conditions and clips would be thousands of tracks. Here both go round, each at its own pace, so that
all pairs of a view and a condition come about alike often, in every group.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

from posefit_experiments.people.clips import GROUPS, Piece
from posefit_experiments.people.design import CHANGES, PAIRS, SIDES, TOLD, Views

CLEAN = "as they are"
CONDITIONS: Mapping[str, Mapping[str, Any]] = {CLEAN: {}, **CHANGES}
VIEWS: tuple[Views, ...] = (*SIDES, *PAIRS)
FRAMES = 60  # of a clip at most
TIMES = 2  # that each clip is followed
QUICK_CLIPS = 2  # of a group, in a quick look, which are two people's


class Turn(NamedTuple):
    """One track: what of, and under which condition."""

    group: str
    clip: Piece
    views: Views
    condition: str

    def spec(self, method: str, evaluations: int) -> dict[str, Any]:
        """Return the cell of the track, followed by a method."""
        return {
            "method": method,
            "motion": self.clip.name,
            "train": [self.clip.library],
            "view_degrees": self.views,
            "frames": min(self.clip.frames, FRAMES),
            "instance": self.clip.instance,
            "evaluations": evaluations,
            **TOLD,
            **CONDITIONS[self.condition],
        }


def turns(times: int, quick: bool) -> list[Turn]:
    """Return the tracks, those of one person together, since they learn from one library.

    What is followed once is among what is followed more times. Raises ValueError where `times` is less than 1.
    """
    if times < 1:
        raise ValueError(f"times must be at least 1, got {times}")
    clips = [(group, clip) for group, found in GROUPS.items() for clip in found[: QUICK_CLIPS if quick else None]]
    conditions, tracks = list(CONDITIONS), []
    for k, (group, clip) in enumerate(clips * times):
        turn = 3 * k + k // len(VIEWS)
        tracks.append(Turn(group, clip, VIEWS[k % len(VIEWS)], conditions[turn % len(conditions)]))
    return sorted(tracks, key=lambda track: track.clip.subject)
