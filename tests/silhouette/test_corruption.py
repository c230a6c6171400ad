"""Damage to silhouettes: whatever its strength, it shows."""

import numpy as np

from posefit.silhouette.corruption import CORRUPTIONS, corrupted
from tests.cases import each


def standing(tall: int) -> np.ndarray:
    """Return the mask of an upright figure, so many pixels tall."""
    mask = np.zeros((2 * tall, 2 * tall), dtype=bool)
    mask[tall // 2 : tall // 2 + tall, tall - tall // 8 : tall + tall // 8] = True
    return mask


@each("name", CORRUPTIONS)
@each("strength", [0.001, 0.01, 0.04, 0.06, 0.1, 0.5, 1.0])
@each("tall", [16, 60, 200])
def test_damage_of_any_strength_changes_a_pixel(
    name: str, strength: float, tall: int
) -> None:
    mask = standing(tall)
    for seed in range(3):
        rng = np.random.default_rng(seed)
        assert (corrupted(mask, {name: strength}, rng) != mask).any()


def test_without_strength_nothing_changes() -> None:
    mask = standing(60)
    noise = dict.fromkeys(CORRUPTIONS, 0.0)
    assert (corrupted(mask, noise, np.random.default_rng(0)) == mask).all()
