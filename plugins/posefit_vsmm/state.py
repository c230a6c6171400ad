"""The state of the motion models, its quaternions, and the 17 points of the body.

A state is (43,): the root's translation in metres, then ten quaternions w, x, y, z, of
the whole body and of nine bones relative to their parents. Its error is (33,): metres,
then one rotation vector per quaternion, applied on its right (Interpretation V4).
Joints that the state does not contain, such as the back's, follow the others: see
`DependentJoints`. The 17 points are Interpretation V2.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from posefit.arrays import Array
from posefit.geometry import rotation
from posefit.geometry.skeleton import ANGLES, INNER, JOINTS, Skeleton, angles_of

# hips, knees, shoulders, elbows, neck
BONES = (
    "lfemur",
    "ltibia",
    "rfemur",
    "rtibia",
    "lhumerus",
    "lradius",
    "rhumerus",
    "rradius",
    "lowerneck",
)
TURNS = 1 + len(BONES)  # quaternions of a state: one for the whole body, one per bone
STATE = 3 + 4 * TURNS
ERROR = 3 + 3 * TURNS
# where the bones' part of an error starts: after the translation and the whole body's
# rotation vector
FIRST_BONE = 6
HELD = tuple(JOINTS.index(bone) for bone in BONES)  # the joints at the bones' ends
HELD_ANGLES = angles_of(BONES)
OTHER_ANGLES = angles_of([JOINTS[joint] for joint in INNER if joint not in HELD])
# metres and radians: the half step of the central differences
DIFFERENCE = 1e-4

_W, _X, _Y, _Z = np.eye(4)
# row a holds the products (4, 4) of the a-th unit of 1, i, j, k with all four units
_PRODUCTS = np.array(
    [_W, _X, _Y, _Z, _X, -_W, _Z, -_Y, _Y, -_Z, -_W, _X, _Z, _Y, -_X, -_W]
).reshape(4, 16)
# indices of the quaternions (10, 4, 1) in a state, and of the rotation vectors
# (10, 1, 3) in an error
_NUMBERS = np.arange(3, STATE).reshape(TURNS, 4, 1)
_VECTORS = np.arange(3, ERROR).reshape(TURNS, 1, 3)


def free_errors(skeleton: Skeleton) -> Array:
    """Return 1 for each error (33,) that the joints allow, 0 for the others.

    For example, a knee is a hinge and allows one of its three.
    """
    return np.concatenate(
        [np.ones(FIRST_BONE), skeleton.free[HELD_ANGLES].astype(np.float64)]
    )


def joined_state(translations: Array, turns: Array) -> Array:
    """Return states (..., 43) of translations (..., 3), quaternions (..., 10, 4)."""
    return np.concatenate([translations, turns.reshape(*turns.shape[:-2], -1)], axis=-1)


def quaternions_of(states: Array) -> Array:
    """Return the quaternions (..., 10, 4) of states (..., 43)."""
    return states[..., 3:].reshape(*states.shape[:-1], TURNS, 4)


def lengths(vectors: Array) -> Array:
    """Return the lengths (..., 1) of vectors (..., n)."""
    return np.asarray(np.sqrt(np.einsum("...i,...i->...", vectors, vectors))[..., None])


def unit(states: Array) -> Array:
    """Return states (..., 43) with their quaternions scaled to length 1."""
    turns = quaternions_of(states)
    return joined_state(states[..., :3], turns / lengths(turns))


def product(first: Array, second: Array) -> Array:
    """Return the products (..., 4) of quaternions (..., 4)."""
    matrices = (first @ _PRODUCTS).reshape(*first.shape, 4)  # (..., 4, 4)
    return np.asarray((second[..., None, :] @ matrices)[..., 0, :])


def rotation_matrices(turns: Array) -> Array:
    """Return the rotations (..., 3, 3) of unit quaternions (..., 4)."""
    w, x, y, z = np.moveaxis(turns, -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))


def rotation_vectors(turns: Array) -> Array:
    """Return rotation vectors (..., 3), at most pi long, of quaternions (..., 4)."""
    turns = np.where(turns[..., :1] < 0.0, -turns, turns)
    sines = lengths(turns[..., 1:])
    angles = 2.0 * np.arctan2(sines, turns[..., :1])
    # for small angles the ratio tends to 2
    scales = np.where(sines < 1e-8, 2.0, angles / np.maximum(sines, 1e-8))
    return np.asarray(turns[..., 1:] * scales)


def plus(states: Array, errors: Array) -> Array:
    """Return states (..., 43) moved by errors (..., 33)."""
    vectors = errors[..., 3:].reshape(*errors.shape[:-1], TURNS, 3)
    halves = 0.5 * lengths(vectors)
    turns = np.concatenate(
        [np.cos(halves), 0.5 * np.sinc(halves / np.pi) * vectors], axis=-1
    )
    translations = states[..., :3] + errors[..., :3]
    return unit(joined_state(translations, product(quaternions_of(states), turns)))


def minus(first: Array, second: Array) -> Array:
    """Return the errors (..., 33) that move states `second` to `first`, both (..., 43).

    Of the two rotations between quaternions it is the shorter one.
    """
    inverses = quaternions_of(second) * [1.0, -1.0, -1.0, -1.0]
    return joined_state(
        first[..., :3] - second[..., :3],
        rotation_vectors(product(inverses, quaternions_of(first))),
    )


def differentiate(
    function: Callable[[Array], Array], states: Array
) -> tuple[Array, Array]:
    """Return a function's values at states, and its derivatives by their errors.

    Args:
        function: Takes states (r, n, 43) and returns values (r, n, ...).
        states: (r, 43).

    Returns:
        The values (r, ...) and the derivatives (r, ..., 33).
    """
    errors = DIFFERENCE * np.concatenate(
        [np.zeros((1, ERROR)), np.eye(ERROR), -np.eye(ERROR)]
    )
    values = function(plus(states[:, None], errors))
    differences = values[:, 1 : 1 + ERROR] - values[:, 1 + ERROR :]
    derivatives = differences / (2.0 * DIFFERENCE)
    return values[:, 0], np.moveaxis(derivatives, 1, -1)


def tangents(states: Array) -> Array:
    """Return the derivatives (r, 43, 33) of states (r, 43) by their errors."""
    matrices = np.tile(np.eye(STATE, ERROR), (len(states), 1, 1))
    matrices[:, 3:, 3:] = 0.0
    # (r, 10, 3, 4)
    changes = product(quaternions_of(states)[:, :, None], 0.5 * np.eye(4)[1:])
    matrices[:, _NUMBERS, _VECTORS] = changes.swapaxes(2, 3)
    return matrices


def inverse_tangents(states: Array) -> Array:
    """Return the derivatives (r, 33, 43) of the errors by the states (r, 43)."""
    # the columns of a quaternion's tangents are orthogonal and of length 1/2
    scales = np.repeat([1.0, 4.0], [3, STATE - 3])
    return np.asarray(tangents(states).swapaxes(1, 2) * scales)


class DependentJoints(NamedTuple):
    """How the joints that a state does not contain follow it.

    Their angles are `matrix` @ (the nine rotation vectors) + `offset`.
    """

    matrix: Array  # (36, 27)
    offset: Array  # (36,) radians


def encode(poses: Array, translations: Array) -> Array:
    """Return the states (n, 43) of poses (n, 66) and translations (n, 3).

    The quaternions' signs change as little as possible from one pose to the next.
    """
    root = rotation.rotation_from_root_angles(poses[:, :3])
    held = rotation.rotation_from_joint_angles(
        poses[:, HELD_ANGLES].reshape(len(poses), -1, 3)
    )
    rotations = np.concatenate([root[:, None], held], axis=1)
    series = [rotation.quaternions(rotations[:, k]) for k in range(TURNS)]
    turns = np.stack(series, axis=1)[..., [3, 0, 1, 2]]  # x, y, z, w to w, x, y, z
    return joined_state(translations, np.where(turns[:1, :, :1] < 0.0, -turns, turns))


def decode(states: Array, dependent: DependentJoints) -> tuple[Array, Array]:
    """Return the poses (..., 66) and the translations (..., 3) of states (..., 43)."""
    turns = quaternions_of(states)
    lead = states.shape[:-1]
    rotations = rotation_matrices(turns)
    vectors = rotation_vectors(turns[..., 1:, :])
    poses = np.zeros((*lead, ANGLES))
    poses[..., :3] = rotation.root_angles_from_rotation(rotations[..., 0, :, :])
    poses[..., HELD_ANGLES] = rotation.joint_angles_from_rotation(
        rotations[..., 1:, :, :]
    ).reshape(*lead, -1)
    poses[..., OTHER_ANGLES] = (
        vectors.reshape(*lead, -1) @ dependent.matrix.T + dependent.offset
    )
    return poses, states[..., :3].copy()


# Each of the 17 points is a joint, or the middle between two joints.
_MIDDLE = {"head": ("upperneck", "head"), "root": ("root",), "torso": ("upperback",)}
_SIDES = {
    "clavicle": ("thorax", "?clavicle"),
    "shoulder": ("?clavicle",),
    "elbow": ("?humerus",),
    "hand": ("?wrist",),
}
# ? is l or r
_SIDES |= {"hip": ("?hipjoint",), "knee": ("?femur",), "foot": ("?foot",)}
_BETWEEN = dict(_MIDDLE)
for _name, _joints in _SIDES.items():
    for _side in ("left", "right"):
        # joint names begin with l or r, in place of the "?" above
        _BETWEEN[f"{_side} {_name}"] = tuple(
            joint.replace("?", _side[0]) for joint in _joints
        )
POINTS = tuple(_BETWEEN)
AT = {name: k for k, name in enumerate(POINTS)}
# (17, 2) the two joints of each point; the same one twice if the point is a joint
ENDS = np.empty((len(POINTS), 2), dtype=np.int64)
for _row, _joints in enumerate(_BETWEEN.values()):
    ENDS[_row] = JOINTS.index(_joints[0]), JOINTS.index(_joints[-1])
