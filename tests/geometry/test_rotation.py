"""Rotations by law and by hand, and why the root's yaw comes first. Interpretation S3."""

from collections.abc import Callable
from itertools import product

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from posefit.arrays import Array
from posefit.geometry.rotation import (
    along_y,
    angles_about,
    geodesic,
    joint_angles_from_rotation,
    quaternions,
    root_angles_from_rotation,
    rotation_from_joint_angles,
    rotation_from_root_angles,
    shortest_turn,
    steady_angles,
    unwrapped,
    wrapped,
)
from tests.cases import each
from tests.geometry.turns import about

QUARTER = np.pi / 2.0
turns = st.floats(-np.pi, np.pi)
# the middle angle, away from its singularity at a quarter turn
tilts = st.floats(-1.5, 1.5)
triples = st.tuples(turns, turns, turns).map(np.array)


def papers_root(angles: Array) -> Array:
    """Return the rotation of root angles in the paper's order x, y, z; y is the yaw."""
    return about(0, angles[0]) @ about(1, angles[1]) @ about(2, angles[2])


def jacobian(rotation: Callable[[Array], Array], angles: Array) -> Array:
    """Return the derivatives (9, 3) of a rotation's elements by its angles."""
    step = 1e-6
    columns = [
        rotation(angles + step * axis) - rotation(angles - step * axis)
        for axis in np.eye(3)
    ]
    return np.array(columns).reshape(3, 9).T / (2.0 * step)


def least_singular_value(matrix: Array) -> float:
    return float(np.linalg.svd(matrix, compute_uv=False)[-1])


@each("yaw", [QUARTER, -QUARTER])
@each(("pitch", "roll"), [(0.0, 0.0), (0.2, -0.1), (-0.35, 0.35)])
# Interpretation S3
def test_a_side_view_is_not_degenerate(yaw: float, pitch: float, roll: float) -> None:
    angles = np.array([yaw, pitch, roll])
    # The axes that pitch and roll turn about stand at right angles; yaw's leans towards roll's by the pitch.
    by_hand = np.sqrt(2.0 * (1.0 - abs(np.sin(pitch))))
    assert least_singular_value(
        jacobian(rotation_from_root_angles, angles)
    ) == pytest.approx(by_hand, abs=1e-6)
    assert by_hand > 1.1
    again = root_angles_from_rotation(rotation_from_root_angles(angles))
    np.testing.assert_allclose(again, angles, rtol=0.0, atol=1e-9)
    # In the paper's order the yaw is the middle angle, and x and z turn about one and the same axis there.
    assert (
        least_singular_value(jacobian(papers_root, np.array([pitch, yaw, roll]))) < 1e-6
    )
    same = papers_root(np.array([pitch + 0.3, yaw, roll - np.sign(yaw) * 0.3]))
    np.testing.assert_allclose(
        same, papers_root(np.array([pitch, yaw, roll])), rtol=0.0, atol=1e-12
    )


@given(turns, tilts, turns)
def test_angles_come_back(first: float, middle: float, last: float) -> None:
    angles = np.array([first, middle, last])
    of_root = root_angles_from_rotation(rotation_from_root_angles(angles))
    of_joint = joint_angles_from_rotation(rotation_from_joint_angles(angles))
    np.testing.assert_allclose(
        wrapped(np.array([of_root, of_joint]) - angles), 0.0, rtol=0.0, atol=1e-9
    )


@each("roll", [0.0, 0.7, -2.0])
@each("pitch", [QUARTER, -QUARTER])
def test_on_the_singularity_the_rotation_still_comes_back(
    pitch: float, roll: float
) -> None:
    rotation = rotation_from_root_angles(np.array([0.4, pitch, roll]))
    again = rotation_from_root_angles(root_angles_from_rotation(rotation))
    np.testing.assert_allclose(again, rotation, rtol=0.0, atol=1e-7)


@given(turns, st.integers(0, 2), triples)
def test_the_geodesic_of_a_turn_about_one_axis_is_its_angle(
    angle: float, axis: int, start: Array
) -> None:
    first = rotation_from_joint_angles(start)
    assert float(geodesic(first, first @ about(axis, angle))) == pytest.approx(
        abs(angle), abs=1e-6
    )


def test_wrapping_by_hand() -> None:
    angles = np.degrees(
        wrapped(np.radians([0.0, 180.0, -180.0, 190.0, -190.0, 540.0, 725.0]))
    )
    np.testing.assert_allclose(
        angles, [0.0, -180.0, -180.0, -170.0, 170.0, -180.0, 5.0], atol=1e-9
    )


def test_quaternions_are_scipys_and_do_not_jump() -> None:
    # twice around, through half turns
    turns = np.linspace(0.0, 4.0 * np.pi, 33)[:, None] * [0.6, 0.0, -0.8]
    rotations = Rotation.from_rotvec(turns).as_matrix()
    found = quaternions(rotations)
    np.testing.assert_allclose(
        Rotation.from_quat(found).as_matrix(), rotations, atol=1e-12
    )
    assert np.linalg.norm(np.diff(found, axis=0), axis=1).max() < 0.2


def test_y_is_taken_to_any_direction() -> None:
    # every axis, every diagonal, no direction, and one that is none of these
    numbers = [-3.0, 0.0, 3.0]
    directions = np.array([*product(numbers, repeat=3), (1.0, -1.0, 0.5)])
    rotations = along_y(directions)
    np.testing.assert_allclose(np.linalg.det(rotations), 1.0)
    np.testing.assert_allclose(
        rotations @ np.swapaxes(rotations, -1, -2),
        np.tile(np.eye(3), (len(directions), 1, 1)),
        atol=1e-12,
    )
    lengths = np.linalg.norm(directions, axis=1)
    np.testing.assert_allclose(
        lengths[:, None] * rotations[..., 1], directions, atol=1e-12
    )


def test_the_shortest_turn_is_about_the_axis_perpendicular_to_both_directions() -> None:
    rng = np.random.default_rng(4)
    start, end = rng.normal(size=(2, 50, 3))
    start[0], end[0] = (1.0, 2.0, 3.0), (-2.0, -4.0, -6.0)  # half a turn
    start[1], end[1] = (0.0, 0.0, 2.0), (0.0, 0.0, 1.0)
    turns = shortest_turn(start, end)
    np.testing.assert_allclose(
        turns @ np.swapaxes(turns, -1, -2), np.tile(np.eye(3), (50, 1, 1)), atol=1e-12
    )
    unit = [each / np.linalg.norm(each, axis=1, keepdims=True) for each in (start, end)]
    np.testing.assert_allclose(
        np.einsum("nij,nj->ni", turns, unit[0]), unit[1], atol=1e-12
    )
    cosines = (unit[0] * unit[1]).sum(axis=1)
    # of the angle
    np.testing.assert_allclose(
        (np.trace(turns, axis1=1, axis2=2) - 1.0) / 2.0, cosines, atol=1e-12
    )
    np.testing.assert_array_equal(shortest_turn(np.zeros(3), end[0]), np.eye(3))


def test_steady_angles_are_the_same_rotations_without_jumps() -> None:
    times = np.linspace(0.0, 12.0, 400)
    # its middle angle passes 90 degrees
    spin = np.stack([3.0 * times, 2.0 * np.sin(times), 1.5 * times], axis=-1)
    rotations = rotation_from_joint_angles(spin[:, ::-1])
    angles = angles_about((2, 1, 0), rotations)
    assert np.abs(np.diff(angles, axis=0)).max() > 3.0
    steady = steady_angles(angles)
    assert np.abs(np.diff(steady, axis=0)).max() < 0.2
    np.testing.assert_allclose(
        rotation_from_joint_angles(steady[:, ::-1]), rotations, atol=1e-9
    )


def test_unwrapping_skips_unknown_values() -> None:
    series = np.array([3.0, np.nan, np.nan, -3.1, -3.0])
    np.testing.assert_allclose(
        unwrapped(series), [3.0, np.nan, np.nan, 2 * np.pi - 3.1, 2 * np.pi - 3.0]
    )
