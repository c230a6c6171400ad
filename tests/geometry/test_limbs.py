"""Bones and angles of limbs."""

from itertools import pairwise

import numpy as np

from posefit.geometry.body import Body
from posefit.geometry.limbs import LIMBS, turns_of
from posefit.geometry.skeleton import BONES, JOINTS, PARENTS
from posefit.motion.built_in import average_skeleton
from tests.cases import each


def test_the_limbs_and_the_torso_are_all_bones_once() -> None:
    torso = {"lowerback", "upperback", "thorax"}
    assert sorted([*torso, *(bone for bones in LIMBS.values() for bone in bones)]) == sorted(BONES)
    # a limb is one chain: each bone but the first hangs from the one before it
    for bones in LIMBS.values():
        assert all(JOINTS[PARENTS[JOINTS.index(b)]] == a for a, b in pairwise(bones))


@each("name", LIMBS)
def test_a_limbs_angles_move_all_of_its_bones_and_no_other(name: str) -> None:
    skeleton = Body.of(average_skeleton()).skeleton
    pose = np.zeros(66)
    pose[turns_of(LIMBS[name])] = 0.3
    moved = np.abs(skeleton.joints(pose) - skeleton.joints(np.zeros(66))).max(axis=1) > 1e-9
    assert set(np.flatnonzero(moved[1:])) == {BONES.index(bone) for bone in LIMBS[name]}
