"""Where must a posed body stand to fill the silhouette's bounding box? Reading S4, `aligned`."""

from collections.abc import Sequence

import numpy as np

from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.rotation import Array
from posefit.silhouette.mask import Silhouette

ROUNDS = 3  # which joint is outermost depends a little on where the body stands
_DAMPING = 1e-9  # keeps the 3 x 3 system solvable where a silhouette has too few borders


def align(
    body: Body, cameras: Sequence[Camera], silhouettes: Sequence[Silhouette], poses: Array, anchors: Array
) -> Array:
    """Return the translations (n, 3) that bring poses (n, 66) to the bounding boxes of the silhouettes.

    Each border of a box says where the outermost disc of the body must touch, and that is linear in the translation:
    `focal (x + t_x) +- focal radius = (border - centre) (z + t_z)`. All borders of all views are solved for together,
    by least squares, starting from anchors (n, 3). A border at the image's edge says nothing and is left out.
    """
    radii = body.joint_radii()
    joints = body.skeleton.joints(poses)
    translations = anchors.copy()
    for _ in range(ROUNDS):
        normal = np.tile(_DAMPING * np.eye(3), (len(poses), 1, 1))
        right = _DAMPING * translations
        for camera, silhouette in zip(cameras, silhouettes, strict=True):
            own = joints @ camera.rotation.T
            moved = own + (translations @ camera.rotation.T + camera.translation)[:, None]
            depth = np.maximum(moved[..., 2], 1e-3)
            scale = np.sqrt(camera.focal.prod())
            for side, border in enumerate(silhouette.extent):
                if np.isnan(border):
                    continue
                axis, sign = side % 2, -1.0 if side < 2 else 1.0
                reach = sign * (camera.focal[axis] * moved[..., axis] + sign * scale * radii) / depth
                outermost = reach.argmax(axis=1)
                a, b = camera.focal[axis], border - camera.centre[axis]
                at = own[np.arange(len(poses)), outermost]
                row = (a * camera.rotation[axis] - b * camera.rotation[2]) / scale
                offset = a * camera.translation[axis] - b * camera.translation[2]
                gap = b * at[:, 2] - a * at[:, axis] - sign * scale * radii[outermost] - offset
                normal += np.outer(row, row)
                right = right + (gap / scale)[:, None] * row
        translations = np.linalg.solve(normal, right[..., None])[..., 0].astype(np.float64)
    return translations
