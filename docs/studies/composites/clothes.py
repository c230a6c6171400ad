"""What people wear: garments with a weave that is fixed to the body, some of them as bright as what is behind."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from posefit.arrays import Array
from posefit.geometry.skeleton import BONES, kind
from posefit.silhouette.foreground import Image

TILE = 256  # texels to a side of a weave, which are a turn around a limb and `LENGTH` metres along it
LENGTH = 0.6
ROUGH = (4, 12, 40, 128)  # waves of a weave to a side, the coarse ones first
GARMENTS: Mapping[str, str] = {
    "hipjoint": "trousers",
    "femur": "trousers",
    "tibia": "trousers",
    "foot": "shoes",
    "toes": "shoes",
    "lowerneck": "skin",
    "upperneck": "skin",
    "head": "skin",
    "wrist": "skin",
    "hand": "skin",
    "radius": "skin",
}  # all others are the shirt
SKIN = ((140, 165, 205), (95, 120, 165), (60, 80, 115))  # blue, green, red
SHIRTS = ((60, 60, 170), (150, 90, 50), (215, 215, 220), None)  # None is the colour of what is behind
TROUSERS = ((110, 70, 40), None, (45, 45, 50), (95, 140, 165))
SHOES = ((40, 40, 45), (220, 220, 220))
STRENGTH = {"shirt": 0.22, "trousers": 0.14, "skin": 0.05, "shoes": 0.1}  # of a weave, a share of the colour


@dataclass(frozen=True, eq=False)
class Outfit:
    """The colour of each bone (26, 3), its weave (TILE, TILE), and how strong that is (26,)."""

    colours: Array = field(repr=False)
    strengths: Array = field(repr=False)
    weave: NDArray[np.float32] = field(repr=False)


def outfit(number: int, behind: Image) -> Outfit:
    """Return clothes by their number, seen before a picture: what has its colour is as what is about its middle."""
    rng = np.random.default_rng([number, 3])
    height, width = behind.shape[:2]
    about = behind[height // 3 : 4 * height // 5, width // 4 : 3 * width // 4].reshape(-1, 3)
    near = np.median(about, axis=0) * rng.uniform(0.9, 1.1)
    colours = {
        "shirt": SHIRTS[number % len(SHIRTS)],
        "trousers": TROUSERS[number % len(TROUSERS)],
        "skin": SKIN[number % len(SKIN)],
        "shoes": SHOES[number % len(SHOES)],
    }
    worn = [GARMENTS.get(kind(bone), "shirt") for bone in BONES]
    each = [near if colours[garment] is None else colours[garment] for garment in worn]
    return Outfit(np.array(each, dtype=np.float64), np.array([STRENGTH[garment] for garment in worn]), _weave(rng))


def _weave(rng: np.random.Generator) -> NDArray[np.float32]:
    """Return a pattern of mean 0 and deviation 1 that goes on where it ends."""
    whole = np.zeros((TILE, TILE), dtype=np.float32)
    for waves in ROUGH:
        small = np.pad(rng.normal(size=(waves, waves)).astype(np.float32), 2, mode="wrap")
        edge = round(2 * TILE / waves)
        large = cv2.resize(small, (TILE + 2 * edge, TILE + 2 * edge), interpolation=cv2.INTER_CUBIC)
        whole += large[edge : edge + TILE, edge : edge + TILE]
    return np.asarray((whole - whole.mean()) / whole.std())
