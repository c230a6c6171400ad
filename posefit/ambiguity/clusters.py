"""What cannot be told apart, put into groups: how likely each is, how wide, and how far from the likeliest."""

from dataclasses import dataclass, field

import numpy as np

from posefit.ambiguity.library import Rows
from posefit.ambiguity.search import Moment, States
from posefit.arrays import Array
from posefit.geometry.alike import facing, mirrored_poses, reflected_poses, turned_poses
from posefit.geometry.skeleton import Skeleton
from posefit.uncertainty.modes import Posterior, modes_of

COMPARED = 1500  # poses that are compared with each other; of more, so many that are drawn stand for all
NEARER = 0.5  # of the way to the first mode: as near as this to an image of it, a mode is that image


@dataclass(frozen=True, eq=False)
class AlikePoses:
    """Poses that are alike. `best` is the one that fits best, which stands for the others."""

    weight: float
    members: Rows = field(repr=False)  # rows of the states
    best: int  # row of the states
    spread_mm: float  # of the joints about their mean
    away_mm: float  # mean distance of the best one's joints from those of the first cluster's best one
    image: str  # of the first cluster: mirrored, turned or reflected, see posefit.geometry.alike; or ""


def clusters_of(moment: Moment, states: States, weights: Array) -> list[AlikePoses]:
    """Return states with weights (n,), put into groups by their joints: the heaviest first.

    Joints are compared with both roots at one point, facing as they face.
    """
    skeleton = moment.body.skeleton
    some = np.sort(np.random.default_rng(0).permutation(len(states))[:COMPARED])  # every so many'th may all be alike
    modes = modes_of(skeleton, Posterior(states.poses[some], states.translations[some], weights[some]))
    joints, middles = (_rooted(skeleton, poses) for poses in (states.poses, np.array([mode.pose for mode in modes])))
    away = np.array([_distances(joints, middle) for middle in middles])
    nearest = away.argmin(axis=0)
    groups = [rows for k in range(len(modes)) if len(rows := np.flatnonzero(nearest == k))]
    groups.sort(key=lambda rows: -weights[rows].sum())
    best = [int(rows[states.costs[rows].argmin()]) for rows in groups]
    first = joints[best[0]]
    images = _images(moment, states.poses[best[0]])
    return [
        AlikePoses(
            float(weights[rows].sum()),
            rows,
            one,
            total(spread_mm(joints[rows], weights[rows])),
            float(_distances(joints[one][None], first)[0]),
            _image(joints[one], first, images),
        )
        for rows, one in zip(groups, best, strict=True)
    ]


def spread_mm(joints: Array, weights: Array) -> Array:
    """Return the spread (27,) of joints (n, 27, 3): their root mean square distance from their mean, by weights (n,).

    Metres become millimetres; weights need not sum to 1.
    """
    weights = weights / weights.sum()
    mean = np.einsum("n,njk->jk", weights, joints)
    squares = ((joints - mean) ** 2).sum(axis=2)
    return np.asarray(1e3 * np.sqrt(weights @ squares))


def floor_mm(moment: Moment, states: States, weights: Array) -> Array:
    """Return the spread (27,) in millimetres of what cannot be told apart, all roots at one point."""
    return spread_mm(_rooted(moment.body.skeleton, states.poses), weights)


def distance_mm(skeleton: Skeleton, pose: Array, other: Array) -> float:
    """Return the mean distance in millimetres of the joints of two poses (66,), both roots at one point."""
    joints = _rooted(skeleton, np.stack([pose, other]))
    return float(_distances(joints[:1], joints[1])[0])


def total(spreads_mm: Array) -> float:
    """Return the spread of a body, of those (27,) of its joints: their root mean square."""
    return float(np.sqrt((spreads_mm**2).mean()))


def _images(moment: Moment, pose: Array) -> dict[str, Array]:
    """Return the joints of what looks like a pose, by name."""
    skeleton, poses = moment.body.skeleton, pose[None]
    towards = facing(moment.cameras[0], moment.anchor)
    found = {
        "mirrored": mirrored_poses(skeleton, poses),
        "turned": turned_poses(poses),
        "reflected": reflected_poses(skeleton, poses, towards),
    }
    return {name: _rooted(skeleton, image)[0] for name, image in found.items()}


def _image(joints: Array, first: Array, images: dict[str, Array]) -> str:
    """Return which image of the first pose some joints (27, 3) are, or "" where they are none."""
    # to a millimetre, as from its very side a mirrored pose is the reflected one as well
    away = {name: round(float(_distances(joints[None], image)[0])) for name, image in images.items()}
    name = min(away, key=away.__getitem__)
    return name if away[name] < NEARER * float(_distances(joints[None], first)[0]) else ""


def _rooted(skeleton: Skeleton, poses: Array) -> Array:
    """Return the joints (n, 27, 3) of poses (n, 66), their roots at one point."""
    joints = skeleton.joints(poses)
    return np.asarray(joints - joints[:, :1])


def _distances(joints: Array, other: Array) -> Array:
    """Return the mean distances (n,) in millimetres of joints (n, 27, 3) from others (27, 3)."""
    return np.asarray(1e3 * np.linalg.norm(joints - other, axis=2).mean(axis=1))
