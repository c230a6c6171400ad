"""A bone at a time, as plain Python and as compiled, against frames multiplied by hand."""

import numpy as np

from posefit.arrays import jit
from posefit.geometry.kernels import empty_frames
from posefit.geometry.lanes import place_bone
from posefit.geometry.rotation import rotation_from_joint_angles
from posefit.geometry.skeleton import ANGLES, BONES
from posefit.motion.built_in import average_skeleton
from tests.cases import each


@jit
def compiled_bone(chain, b, sines, cosines, frames):  # type: ignore[no-untyped-def]
    place_bone(chain, b, sines, cosines, frames)


@each("placing", [place_bone, compiled_bone])
@each("bone", range(len(BONES)))
def test_a_bone_carries_its_parents_frame_to_its_end(placing, bone: int) -> None:  # type: ignore[no-untyped-def]
    chain = average_skeleton().chain
    rng = np.random.default_rng(bone)
    pose, frames = rng.uniform(-3.0, 3.0, ANGLES), empty_frames(len(BONES) + 1)
    frames[:, :, :3] = rng.normal(size=(len(frames), 4, 3))
    before, parent, first = frames.copy(), chain.parents[bone], chain.angles[bone]
    placing(chain, bone, np.sin(pose), np.cos(pose), frames)
    turn = rotation_from_joint_angles(pose[first : first + 3]) if first >= 0 else np.eye(3)
    expected = before[parent, :3, :3].T @ chain.turns[bone] @ turn  # axes are columns of a matrix, rows of a frame
    np.testing.assert_allclose(frames[bone + 1, :3, :3].T, expected, atol=1e-12)
    np.testing.assert_allclose(
        frames[bone + 1, 3, :3], before[parent, 3, :3] + expected @ chain.offsets[bone], atol=1e-12
    )
    others = np.arange(len(frames)) != bone + 1
    np.testing.assert_array_equal(frames[others], before[others])
