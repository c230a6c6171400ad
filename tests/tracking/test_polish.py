"""One picture by itself: where its poses are looked up, and what is said of a pose that its prior does not know."""

from dataclasses import replace
from typing import Any

import numpy as np

from posefit import Motion
from posefit.motion import built_in
from posefit.tracking import polish
from posefit.tracking.initialise import task_of
from posefit.tracking.options import TrackOptions
from posefit.tracking.polish import beyond_prior
from posefit.uncertainty.modes import Posterior
from posefit_priors.pca import PCA
from tests.cases import each
from tests.tracking.scenes import walk

WALKS = [built_in.motion(name) for name in built_in.other_styles("walk")]
OTHER = replace(WALKS[0], name="a dance")


@each(
    "training, looked_up_in",
    [(WALKS, ["a dance"]), ([*WALKS[:1], OTHER], [])],
)
def test_a_picture_is_looked_up_in_the_library_unless_other_motions_are_named(
    monkeypatch: Any, training: list[Motion], looked_up_in: list[str]
) -> None:
    monkeypatch.setattr(polish, "_library", lambda _fps: [OTHER])
    scene = walk(1, (45.0,), (80, 60))
    options = TrackOptions(evaluations=400, translation="aligned")
    pose = scene.truth.poses[:1]
    known = Posterior(pose, scene.truth.translations[:1], np.ones(1))
    learned_from: list[str] = []

    class Start:
        def __init__(self, task: Any) -> None:
            learned_from.extend(motion.name for motion in task.training)

        def posterior(self, observation: Any) -> Posterior:
            return known

    task = replace(task_of(scene, options, training), yaw=None, start=Start)
    task = replace(task, first_pose=None, modes=[(1.0, known)])
    modes, used = polish.looked_up(task, scene.observations[0])
    assert learned_from == looked_up_in
    assert [mode.poses.tolist() for mode in modes] == [pose.tolist()]
    assert used == 0


def test_a_pose_outside_the_prior_is_reported() -> None:
    prior = PCA().fit(np.concatenate([motion.poses[:, 3:] for motion in WALKS]))
    skeleton = WALKS[0].skeleton
    pose = WALKS[0].poses[5]
    assert beyond_prior(prior, skeleton, pose) == ""
    raised = built_in.motion("arms-out").poses[0].copy()
    raised[3:][skeleton.free[3:]] += 0.7
    assert beyond_prior(prior, skeleton, raised).startswith(
        "the prior cannot represent this pose: the nearest that it can represent is "
    )
