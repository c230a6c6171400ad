"""A track that was interrupted and goes on has the bits of one that was not, whatever its method."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.output.folder import OutputFolder
from posefit.progress import Progress
from posefit.registry import registry
from posefit_filters.annealed import Annealed
from tests.cases import each

FRAMES = 6
HOW: dict[str, Any] = {"size": (120, 90), "evaluations": 200}
OFFERS = registry().offers
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
def test_a_filter_continues_with_its_particles(method: str, tmp_path: Path) -> None:
    check_same(method, (1, 2, 4), tmp_path)


@each("method", ["sapso", "cma", "random"])
def test_an_optimiser_continues_as_if_never_interrupted(
    method: str, tmp_path: Path
) -> None:
    check_same(method, (2, 3), tmp_path)


@pytest.mark.slow
@each("method", OTHERS)
def test_every_other_optimiser_does(method: str, tmp_path: Path) -> None:
    check_same(method, (3,), tmp_path)


class Holds:
    """A tracker that gives the mean pose, and counts its frames."""

    def __init__(self, task: Any) -> None:
        self.task = task
        self.pose = np.concatenate([np.zeros(3), task.angles.mean(axis=0)])

    def track(self, observations: Any, rng: Any) -> Any:
        for observation in observations:
            yield posefit.Frame(
                self.pose, observation.translation, 0.0, np.zeros((1, 3)), 0
            )


class Lists(Annealed):
    """A filter that holds something else than plain values."""

    def __init__(self, space: Any, rng: Any) -> None:
        super().__init__(space, rng, evaluations=HOW["evaluations"])
        self.held = {1, 2}


@each("method", [Holds, (Lists, "pca")])
def test_a_method_that_starts_over_says_so_when_it_resumes(
    method: Any, tmp_path: Path
) -> None:
    log: list[str] = []
    how = {"progress": Progress(log.append)}
    resumed(method, (2,), tmp_path / "out", **how)
    (line,) = [line for line in log if "starts over" in line]
    assert re.search("(Holds|Lists@pca) starts over at frame 2: the frames from", line)
