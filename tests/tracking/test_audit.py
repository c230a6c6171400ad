"""The poses that trackers draw are counted, their costs computed, and differences from their reports are warned of."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.fitting.driving import UNCOUNTED_POSES, Audit, drive
from posefit.fitting.validation import BrokenRuleError
from posefit.progress import Progress
from posefit.testing.tracker_rules import scene
from tests.cases import each
from tests.testing import planted

QUICK: dict[str, Any] = {"frames": (0, 3), "size": (120, 90), "evaluations": 2440}


def audited(kind: Any, observations: Any = None) -> tuple[list[Any], list[str]]:
    """Return the frames of a tracker of a plugin, and what they are warned of."""
    audit, (task, _, all_of_them) = (
        Audit("tracker 'bad' of posefit-bad 1.0", 0.5),
        scene(),
    )
    frames = list(
        drive(
            kind,
            audit,
            task,
            observations or all_of_them,
            np.random.default_rng(0),
        )
    )
    return frames, audit.warnings


def reporting(**change: Any) -> Any:
    class Odd(planted.Holds):
        def frame(self, observation: Any) -> Any:
            return replace(super().frame(observation), **change)

    return Odd


# which the kernel reads: where no pixel is known, nothing costs anything
class ChangesTheBits(planted.Holds):
    def frame(self, observation: Any) -> Any:
        for bits in observation.silhouettes[0].bits:
            bits[:] = 0
        return super().frame(observation)


def test_an_honest_tracker_is_not_changed() -> None:
    task, _, observations = scene()
    plain = list(planted.Holds(task).track(observations, np.random.default_rng(0)))
    frames, warnings = audited(planted.Holds)
    assert warnings == []
    for frame, other in zip(plain, frames, strict=True):
        assert (
            (frame.cost, frame.evaluations)
            == (other.cost, 1)
            == (other.cost, other.evaluations)
        )
        np.testing.assert_array_equal(frame.areas, other.areas)


@each(
    ("kind", "warning"),
    [
        (
            planted.SpendsAndSaysSo,
            "frame 0 must use at most 800 evaluations, got 20,000 (12 such frames)",
        ),
        (
            planted.SpendsInSecret,
            "frame 0 must count all poses it rasterised, 20,001, got 100 (12 such frames)",
        ),
        (reporting(cost=0.0, trace=np.zeros((1, 2))), ", got 0 (12 such frames)"),
        (
            reporting(areas=np.array([[0, 0, 100]])),
            ", got [[0, 0, 100]] (12 such frames)",
        ),
        (ChangesTheBits, "(12 such frames)"),
    ],
)
def test_wrong_reports_of_a_tracker_are_corrected_with_a_warning(
    kind: Any, warning: str
) -> None:
    fresh = [
        replace(one, silhouettes=[replace(mask) for mask in one.silhouettes])
        for one in scene()[2]
    ]
    frames, warnings = audited(kind, fresh)
    assert warnings[0].startswith("tracker 'bad' of posefit-bad 1.0: frame 0 must ")
    assert warnings[0].endswith(warning)
    for frame, other in zip(frames, audited(planted.Holds)[0], strict=True):
        assert frame.cost == other.cost
        np.testing.assert_array_equal(frame.areas, other.areas)
        if kind is planted.SpendsInSecret:
            assert frame.evaluations == 20_001


@each("extra", [UNCOUNTED_POSES, UNCOUNTED_POSES + 1])
def test_a_few_poses_a_frame_need_not_be_counted(extra: int) -> None:
    too_many = extra > UNCOUNTED_POSES

    class DrawsItsResultAgain(planted.Holds):
        def frame(self, observation: Any) -> Any:
            self.draw(observation, extra)
            return super().frame(observation)

    frames, warnings = audited(DrawsItsResultAgain)
    assert frames[0].evaluations == (1 + extra if too_many else 1)
    assert len(warnings) == too_many


def test_a_track_has_the_warnings_and_the_corrected_figures() -> None:
    log: list[str] = []
    result = posefit.track(
        "walk", method=planted.SpendsInSecret, progress=Progress(log.append), **QUICK
    )
    uncounted, beyond = result.summary["warnings"]
    assert (
        "frame 0 must count all poses it rasterised, 20,001, got 100 (3 such frames)"
        in uncounted
    )
    assert (
        "frame 0 must use at most 2,440 evaluations, got 20,001 (3 such frames)"
        in beyond
    )
    assert result.summary["evaluations"] == 3 * 20_001
    assert [line for line in log if line.startswith("warning")] == [
        f"warning: {uncounted}",
        f"warning: {beyond}",
    ]


@each(
    ("kind", "rule"),
    [
        (
            planted.GivesFramesTwice,
            "track must yield a frame for each observation, got 2 for 1$",
        ),
        (
            planted.DropsFrames,
            "track must yield a frame for each observation, got 6 and then no more$",
        ),
        (
            planted.ChangesTheMask,
            "track must not fail, got ValueError: assignment destination is read-only",
        ),
        (
            reporting(evaluations=1.5),
            ".*evaluations must be a whole number, 0 or more, got 1.5",
        ),
        (
            reporting(trace=np.zeros(3)),
            r".*a trace must be \(n, 2\), evaluations and costs, got shape \(3,\)",
        ),
    ],
)
def test_a_tracker_that_breaks_a_rule_is_named(kind: Any, rule: str) -> None:
    with pytest.raises(
        BrokenRuleError, match=f"^tracker 'bad' of posefit-bad 1.0: {rule}"
    ):
        audited(kind)


def test_an_unreadable_frame_is_not_blamed_on_the_tracker() -> None:
    def broken() -> Any:
        yield scene()[2][0]
        raise ValueError("frame 1 of the video is damaged")

    with pytest.raises(ValueError, match="^frame 1 of the video is damaged$"):
        audited(planted.Holds, broken())
