"""The poses that trackers draw are counted, their costs computed, and differences from their reports are warned of."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.fitting.validation import Audit, AuditedTracker, BrokenRuleError
from posefit.progress import Progress
from posefit.testing.tracker_rules import scene
from tests.cases import each
from tests.testing import planted

QUICK: dict[str, Any] = {"frames": (0, 3), "size": (120, 90), "evaluations": 2440}


def guarded(kind: Any, audit: Audit) -> AuditedTracker:
    task = scene()[0]
    return AuditedTracker(kind(task), task, "tracker 'bad' of posefit-bad 1.0", 0.5, audit)


def audited(kind: Any) -> tuple[list[Any], list[str]]:
    audit = Audit()
    frames = list(guarded(kind, audit).track(scene()[2], np.random.default_rng(0)))
    return frames, audit.warnings


def test_an_honest_tracker_is_left_as_it_is() -> None:
    task, _, observations = scene()
    plain = list(planted.Holds(task).track(observations, np.random.default_rng(0)))
    frames, warnings = audited(planted.Holds)
    assert warnings == []
    for frame, other in zip(plain, frames, strict=True):
        assert frame.cost == other.cost
        assert frame.evaluations == other.evaluations == 1
        np.testing.assert_array_equal(frame.areas, other.areas)


@each(
    ("kind", "warning"),
    [
        (planted.SpendsAndSaysSo, "frame 0 must use at most 400 evaluations, got 20,000 (12 such frames)"),
        (planted.SpendsInSecret, "frame 0 must say how many poses it drew, 20,001, got 100 (12 such frames)"),
        (planted.CostsNothing, ", got 0 (12 such frames)"),
        (planted.InventsAreas, ", got [[0, 0, 100]] (12 such frames)"),
    ],
)
def test_wrong_reports_of_a_tracker_are_corrected_with_a_warning(kind: Any, warning: str) -> None:
    frames, warnings = audited(kind)
    assert warnings[0].startswith("tracker 'bad' of posefit-bad 1.0: frame 0 must ")
    assert warnings[0].endswith(warning)
    honest = audited(planted.Holds)[0]
    for frame, other in zip(frames, honest, strict=True):
        assert frame.cost == other.cost
        np.testing.assert_array_equal(frame.areas, other.areas)
        if kind is planted.SpendsInSecret:
            assert frame.evaluations == 20_001


def test_a_tracker_cannot_change_what_it_is_compared_with() -> None:
    with pytest.raises(BrokenRuleError, match="it must not fail, got ValueError: assignment destination is read-only"):
        audited(planted.ChangesTheMask)

    class ChangesTheBits(planted.Holds):  # which the kernel reads: where no pixel is known, nothing costs anything
        def frame(self, observation: Any) -> Any:
            for bits in observation.silhouettes[0].bits:
                bits[:] = 0
            return super().frame(observation)

    audit, (task, _, observations) = Audit(), scene()
    fresh = [replace(one, silhouettes=[replace(mask) for mask in one.silhouettes]) for one in observations]
    tracker = AuditedTracker(ChangesTheBits(task), task, "tracker 'bad'", 0.5, audit)
    costs = [frame.cost for frame in tracker.track(fresh, np.random.default_rng(0))]
    assert costs == [frame.cost for frame in audited(planted.Holds)[0]]
    assert len(audit.warnings) == 2  # of areas and of costs


def test_a_track_has_the_warnings_and_the_corrected_figures() -> None:
    log: list[str] = []
    result = posefit.track("walk", method=planted.SpendsInSecret, progress=Progress(log.append), **QUICK)
    uncounted, beyond = result.summary["warnings"]
    assert "frame 0 must say how many poses it drew, 20,001, got 100 (3 such frames)" in uncounted
    assert "frame 0 must use at most 2,440 evaluations, got 20,001 (3 such frames)" in beyond
    assert result.summary["evaluations"] == 3 * 20_001
    assert [line for line in log if line.startswith("warning")] == [f"warning: {uncounted}", f"warning: {beyond}"]
    free = posefit.track("walk", method=planted.CostsNothing, **QUICK)
    assert free.summary["cost"] == posefit.track("walk", method=planted.Holds, **QUICK).summary["cost"] > 0.0
    assert len(free.summary["warnings"]) == 1


@each(
    ("kind", "rule"),
    [
        (planted.GivesFramesTwice, "track must yield a frame for each observation, got 2 for 1"),
        (planted.DropsFrames, "track must yield a frame for each observation, got 6 and then no more"),
    ],
)
def test_too_many_frames_and_too_few_are_named(kind: Any, rule: str) -> None:
    with pytest.raises(BrokenRuleError, match=f"^tracker 'bad' of posefit-bad 1.0: {rule}$"):
        audited(kind)


def test_what_cannot_be_read_is_not_the_trackers_fault() -> None:
    def broken() -> Any:
        yield scene()[2][0]
        raise ValueError("frame 1 of the video is damaged")

    frames = guarded(planted.Holds, Audit()).track(broken(), np.random.default_rng(0))
    next(frames)
    with pytest.raises(ValueError, match="^frame 1 of the video is damaged$"):
        next(frames)


@each(
    ("change", "rule"),
    [
        ({"evaluations": 1.5}, "evaluations must be a whole number, 0 or more, got 1.5"),
        ({"seconds": float("nan")}, "seconds must be a number, 0 or more, got nan"),
    ],
)
def test_figures_that_are_none_are_named(change: dict[str, Any], rule: str) -> None:
    class Odd(planted.Holds):
        def frame(self, observation: Any) -> Any:
            return replace(super().frame(observation), **change)

    with pytest.raises(BrokenRuleError, match=rule):
        audited(Odd)
