"""Poses whose silhouettes are about that of a given one, as proposals: what a search that has settled on one misses."""

import numpy as np

from posefit.arrays import Array
from posefit.fitting.problem import PoseProblem
from posefit.fitting.space import SearchSpace
from posefit.geometry.alike import facing, reflected_poses, turned_poses
from posefit.geometry.rotation import wrapped


def twins(problem: PoseProblem, proposal: Array) -> Array:
    """Return the proposals (k, d) of a pose that is reflected as a camera sees it, or turned.

    They are as near as the prior comes to those. Whoever would face out of the box is none of them, so k may be 0.
    """
    poses, translations = problem.decode(proposal[None])
    skeleton, place = problem.body.skeleton, translations[0]
    reflected = [reflected_poses(skeleton, poses, facing(camera, place)) for camera in problem.cameras]
    found = np.concatenate([*reflected, turned_poses(poses)])
    space = problem.space
    within = np.abs(wrapped(found[:, 0] - space.centre[0])) <= space.half[0]
    return proposals_of(space, found[within], np.repeat(translations, within.sum(), axis=0))


def proposals_of(space: SearchSpace, poses: Array, translations: Array) -> Array:
    """Return the proposals (n, d) of poses (n, 66), as near as the prior and the box come to them."""
    latents = np.asarray(space.prior.transform(poses[:, 3:]))
    root, tilt = poses[:, :3].copy(), space.tilt
    if tilt is not None:
        root[:, 1:] -= np.clip(tilt.base + latents @ tilt.slopes, tilt.least, tilt.most)
    parts = [root, translations, latents] if space.translation == "searched" else [root, latents]
    return space.proposals(np.concatenate(parts, axis=1))
