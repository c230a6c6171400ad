"""Where must a posed body stand to fill the silhouette's bounding box? Interpretation S4, `aligned`."""

from collections.abc import Sequence

import numpy as np

from posefit.arrays import Array, writeable
from posefit.fitting.kernels import move_to_borders
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.silhouette.mask import Silhouette


def align(
    body: Body, cameras: Sequence[Camera], silhouettes: Sequence[Silhouette], poses: Array, anchors: Array
) -> Array:
    """Return the translations (n, 3) that bring poses (n, 66) to the bounding boxes of the silhouettes.

    Each border of a box says where the outermost disc of the body must touch, and that is linear in the translation:
    `focal (x + t_x) +- focal radius = (border - centre) (z + t_z)`. All borders of all views are solved for together,
    by least squares, starting from anchors (n, 3). A border at the image's edge says nothing and is left out.
    """
    translations = writeable(anchors.copy())
    move_to_borders(
        writeable(body.skeleton.joints(poses)),
        body.joint_radii(),
        np.array([camera.rotation for camera in cameras]),
        np.array([camera.translation for camera in cameras]),
        np.array([camera.focal for camera in cameras]),
        np.array([camera.centre for camera in cameras]),
        np.array([silhouette.extent for silhouette in silhouettes]),
        translations,
    )
    return translations
