"""Legs of published shapes, and a painter of bodies that is not the tracker's.

bodies.py and knees.py import this module; it prints nothing.

The tracker's thigh and shank are one cone each, whose ends have a fixed ratio of radii.
Real legs are not like that. Here a leg is a chain of discs with measured girths: those
of ANSUR II (Gordon et al. 2014, NATICK/TR-15/007; ANSUR_II_MALE_Public.csv and
ANSUR_II_FEMALE_Public.csv, 4082 men and 1986 women, with equal weight of both sexes).
Nor does the flesh surround the line between two joints: most of it is behind.
"""

from itertools import pairwise
from typing import NamedTuple

import cv2
import numpy as np

from posefit.arrays import Array
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import BONES, JOINTS, PARENTS, kind
from posefit.silhouette.mask import Mask

# Girths over stature, of thigh (below the buttock), lower thigh (above the kneecap),
# calf (the largest) and ankle (the smallest): geometric means, standard deviations of
# the logarithms, and correlations.
GIRTHS = np.array([0.3657, 0.2388, 0.2258, 0.1313])
GIRTHS_SPREAD = np.array([0.094, 0.084, 0.075, 0.064])
GIRTHS_CORRELATION = np.array(
    [
        [1.00, 0.86, 0.77, 0.57],
        [0.86, 1.00, 0.83, 0.68],
        [0.77, 0.83, 1.00, 0.78],
        [0.57, 0.68, 0.78, 1.00],
    ]
)
# Geometric means of lengths over stature: trochanterion to lateral femoral epicondyle,
# and from there to the lateral malleolus.
LENGTHS = {"femur": 0.2327, "tibia": 0.2427}
# Where the girths are, as shares of the bone from its start. Of the thigh they follow
# from ANSUR II's mean heights: trochanterion 0.516, crotch 0.481, lateral epicondyle
# 0.283 and 0.290 above the kneecap, of stature. Those of the shank are ours.
SHARES = {"femur": (0.15, 0.97), "tibia": (0.33, 0.86)}
# How far the centre of mass is behind the line between the joints, as a share of the
# bone's length: means of both sexes of Dumas, Cheze and Verriest, Adjustments to
# McConville et al. and Young et al. body segment inertial parameters, 2007. Here the
# middle of a thigh is behind most at the hip, that of a shank at the calf, and neither
# at the knee or the ankle.
BEHIND = {"femur": 0.059, "tibia": 0.0485}
# metres that trousers stand off, and radius of their hem. Ours.
CLOTH = 0.01
HEM = 0.065
SUBPIXELS = 4  # bits of a pixel that OpenCV draws
CIRCLE = 24  # corners of a disc


class Station(NamedTuple):
    """A disc of a limb: where along the bone, its radius, and how far it is behind."""

    share: float
    radius: float  # metres
    behind: float = 0.0  # metres


Legs = dict[str, list[Station]]  # the discs of thighs and shanks, by kind of bone


def legs_of(number: int, stature: float) -> Legs:
    """Return the legs of a body by its number, for a stature in metres.

    Odd bodies wear straight trousers.
    """
    rng = np.random.default_rng([82, number])
    covariance = GIRTHS_CORRELATION * np.outer(GIRTHS_SPREAD, GIRTHS_SPREAD)
    girths = GIRTHS * np.exp(rng.multivariate_normal(np.zeros(4), covariance))
    thigh, lower, calf, ankle = stature * girths / (2.0 * np.pi)
    # the leg narrows steadily from above the kneecap to the calf
    knee = 0.5 * (lower + calf)
    thigh_share, lower_share = SHARES["femur"]
    calf_share, ankle_share = SHARES["tibia"]
    discs = {
        "femur": [(0.0, thigh), (thigh_share, thigh), (lower_share, lower)],
        "tibia": [(0.0, knee), (calf_share, calf), (ankle_share, ankle), (1.0, ankle)],
    }
    discs["femur"].append((1.0, knee))
    farthest = {"femur": 0.0, "tibia": calf_share}
    worn = number % 2
    legs: Legs = {}
    for name, bare in discs.items():
        shares, radii = np.array(bare).T
        length = stature * LENGTHS[name]
        behind = np.interp(shares, [farthest[name], 1.0], [1.0, 0.0])
        if name == "tibia":
            behind[0] = 0.0
        along = np.linspace(0.0, 1.0, 200)
        area = np.interp(along, shares, radii) ** 2
        mean = (area * np.interp(along, shares, behind)).sum() / area.sum()
        behind *= BEHIND[name] * length / mean
        if worn:
            radii = np.maximum(radii + CLOTH, 0.0 if name == "femur" else HEM)
        legs[name] = [
            Station(*each) for each in zip(shares, radii, behind, strict=True)
        ]
    return legs


def painted(body: Body, legs: Legs, camera: Camera, pose: Array, place: Array) -> Mask:
    """Return the mask of a body with other legs, drawn by OpenCV.

    Each bone is the hull of the discs along it, two by two.

    Args:
        body: The body, whose other bones are cones.
        legs: The discs of its thighs and shanks.
        camera: The camera.
        pose: The pose (66,).
        place: The position (3,) of the root, in metres.
    """
    skeleton = body.skeleton
    joints = skeleton.joints(pose[None], place[None])[0]
    mask = np.zeros((camera.height, camera.width), np.uint8)
    around = np.linspace(0.0, 2.0 * np.pi, CIRCLE, endpoint=False)
    circle = np.column_stack([np.cos(around), np.sin(around)])
    for bone, name in enumerate(BONES):
        first, last = body.radii[bone]
        discs = legs.get(kind(name)) or [Station(0.0, first), Station(1.0, last)]
        start = joints[PARENTS[bone + 1]]
        along = joints[bone + 1] - start
        # the foot points forwards
        behind = np.zeros(3)
        if kind(name) in legs:
            ankle = JOINTS.index(f"{name[0]}tibia")
            foot = joints[JOINTS.index(f"{name[0]}foot")] - joints[ankle]
            foot -= (foot @ along) / (along @ along) * along
            behind = -foot / np.linalg.norm(foot)
        drawn = []
        for disc in discs:
            centre = start + disc.share * along + disc.behind * behind
            pixels, depth = camera.project(centre[None])
            radius = disc.radius * np.sqrt(camera.focal.prod()) / depth[0]
            drawn.append(pixels[0] + radius * circle)
        for pair in pairwise(drawn):
            hull = cv2.convexHull(np.concatenate(pair).astype(np.float32))[:, 0]
            # OpenCV's pixel centres are whole numbers, ours halves
            fixed = np.rint((hull - 0.5) * 2**SUBPIXELS).astype(np.int32)
            cv2.fillConvexPoly(mask, fixed, 1, cv2.LINE_8, SUBPIXELS)
    return mask.astype(bool)
