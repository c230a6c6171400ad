"""What a cell's method knows of the person: where they face at first, and their body."""

from typing import Any

import numpy as np
import pytest

from posefit.sweep.cell import TrackCell, cell_scene
from posefit.sweep.check import cell_of
from tests.cases import each

SPEC = {"method": "sapso@pca", "motion": "walk", "frames": 2, "size": [160, 120]}


def cell(**fields: Any) -> TrackCell:
    return cell_of({**SPEC, **fields})


def yaw_off(**fields: Any) -> float:
    """Return by how many radians the yaw that a method knows is off."""
    off, true = (
        cell_scene(cell(yaw_off_degrees=degrees, **fields)).yaw
        for degrees in (25.0, 0.0)
    )
    return off - true


def test_the_first_yaw_is_off_by_no_more_than_the_limit_and_unknown_at_180() -> None:
    offs = np.degrees([yaw_off(instance=instance) for instance in range(8)])
    assert 10.0 < np.abs(offs).max() <= 25.0
    assert offs.min() < 0.0 < offs.max()
    assert cell_scene(cell(yaw_off_degrees=180.0)).yaw is None


def test_the_body_is_off_and_neither_the_truth_nor_the_observations() -> None:
    exact = cell_scene(cell())
    off = cell_scene(cell(body_off_percent=10.0))
    shares = off.body.skeleton.lengths / exact.body.skeleton.lengths
    assert 1e-3 < np.abs(shares - 1.0).max() <= 0.1
    assert np.array_equal(off.truth.skeleton.offsets, exact.truth.skeleton.offsets)
    for one, other in zip(exact.observations, off.observations, strict=True):
        assert np.array_equal(one.silhouettes[0].mask, other.silhouettes[0].mask)


def test_the_yaw_is_off_by_the_same_for_every_method_and_seed_and_by_another_for_another_motion() -> (
    None
):
    assert (
        yaw_off()
        == yaw_off(seed=3)
        == yaw_off(method="random@full")
        == yaw_off(body_off_percent=5.0)
    )
    assert yaw_off() != yaw_off(motion="run")


@each(
    ("field", "value", "message"),
    [
        ("yaw_off_degrees", 181, "yaw_off_degrees must lie in 0 to 180, got 181"),
        ("yaw_off_degrees", -1, "yaw_off_degrees must lie in 0 to 180, got -1"),
        (
            "yaw_off_degrees",
            "unknown",
            "yaw_off_degrees must be a finite number, got 'unknown'",
        ),
        ("body_off_percent", 51, "body_off_percent must lie in 0 to 50, got 51"),
    ],
)
def test_a_value_that_makes_no_sense_is_named(
    field: str, value: object, message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        cell(**{field: value})
