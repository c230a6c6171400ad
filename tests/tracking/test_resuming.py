"""A track that was interrupted and goes on has the bits of one that was not, whatever its method."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.output.folder import OutputFolder
from posefit.registry import registry
from tests.cases import each

FRAMES = 6
HOW: dict[str, Any] = {"size": (120, 90), "evaluations": 200}
OFFERS = registry().offers
# which learn more than a test has the time for
TRACKERS = [
    name
    for name, offer in OFFERS["tracker"].items()
    if not offer.missing and name not in ("exemplars", "regression")
]
FILTERS = [
    name
    for name, offer in OFFERS["optimiser"].items()
    if offer.next_frame == "carry" and not offer.missing
]
OTHERS = [
    name
    for name, offer in OFFERS["optimiser"].items()
    if offer.next_frame != "carry" and not offer.missing
]


def stopped_after(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Have a track end once so many frames are recorded."""
    record = OutputFolder.record

    def counted(self: OutputFolder, frame: Any, state: Any) -> None:
        if self._recorded == count:
            raise KeyboardInterrupt
        record(self, frame, state)

    monkeypatch.setattr(OutputFolder, "record", counted)


def resumed(
    method: str, counts: tuple[int, ...], folder: Path, **how: Any
) -> posefit.Track:
    """Return a track that was interrupted after each of some counts of frames."""
    how = {"frames": (0, FRAMES), "method": method, **HOW, **how, "out": folder}
    for k, count in enumerate(counts):
        with pytest.MonkeyPatch.context() as patch:
            stopped_after(count, patch)
            with pytest.raises(KeyboardInterrupt):
                posefit.track("walk", resume=k > 0, **how)
    return posefit.track("walk", resume=bool(counts), **how)


def check_same(method: str, counts: tuple[int, ...], folder: Path, **how: Any) -> None:
    whole = resumed(method, (), folder / "whole", **how)
    parts = resumed(method, counts, folder / "parts", **how)
    names = [
        sorted(path.name for path in (folder / each).iterdir())
        for each in ("whole", "parts")
    ]
    assert names[0] == names[1]
    assert not [
        name for name in names[0] if name.startswith(("carried", "frames.jsonl"))
    ]
    for one, other in zip(whole.frames, parts.frames, strict=True):
        np.testing.assert_array_equal(one.pose, other.pose, method)
        assert one.cost == other.cost
        assert one.evaluations == other.evaluations


@each("method", FILTERS)
def test_a_filter_goes_on_with_its_particles(method: str, tmp_path: Path) -> None:
    check_same(method, (1, 2, 4), tmp_path)


@each("method", ["sapso", "cma", *(name for name in TRACKERS)])
def test_a_method_goes_on_as_if_nothing_had_been(method: str, tmp_path: Path) -> None:
    check_same(method, (2, 3), tmp_path)


@pytest.mark.slow
@each("method", OTHERS)
def test_every_other_method_does(method: str, tmp_path: Path) -> None:
    check_same(method, (3,), tmp_path)
