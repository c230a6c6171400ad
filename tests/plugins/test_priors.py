"""The priors: components, looser limbs, all angles, and scikit-learn's transformers."""

import numpy as np
import pytest

from posefit.arrays import Array
from posefit.geometry.skeleton import Skeleton
from posefit.motion import built_in
from posefit_priors.full import Full
from posefit_priors.loose import Loose
from posefit_priors.pca import PCA, clusters_of
from posefit_priors.sklearn import Transformed


def angles(*names: str) -> Array:
    return np.concatenate([built_in.motion(name).poses[:, 3:] for name in names])


def test_the_full_space_has_the_limits_that_the_skeleton_states() -> None:
    skeleton = built_in.average_skeleton()
    prior = Full().fit(angles("walk-a"), skeleton)
    # .asf of CMU: the thigh's rx lies in -160 to 20 degrees, and lfemur is the third inner joint
    assert (
        np.degrees(skeleton.limits[3, 0]),
        np.degrees(skeleton.limits[3, 1]),
    ) == pytest.approx((-160.0, 20.0))
    assert np.degrees([prior.low[0], prior.high[0]]) == pytest.approx([-160.0, 20.0])
    assert len(prior.low) == np.count_nonzero(
        skeleton.limits[:, 1] > skeleton.limits[:, 0]
    )


def test_limits_widen_where_a_training_pose_passes_them_or_are_the_training_range() -> (
    None
):
    poses = angles("run-a")
    prior = Full().fit(poses, built_in.average_skeleton())
    latents = prior.transform(poses)
    assert ((latents >= prior.low) & (latents <= prior.high)).all()
    np.testing.assert_allclose(prior.inverse_transform(latents), poses, atol=1e-12)
    prior = Full(limits="training").fit(poses)
    moving = poses[:, np.ptp(poses, axis=0) > 0.0]
    np.testing.assert_array_equal(
        [prior.low, prior.high], [moving.min(axis=0), moving.max(axis=0)]
    )


def test_a_skeleton_without_limits_is_named() -> None:
    average = built_in.average_skeleton()
    bare = Skeleton("bare", average.offsets, average.axes, average.channels)
    rule = "limits must be training if the skeleton states no joint limits, got asf and"
    for skeleton, name in ((bare, "bare"), (None, "no skeleton")):
        with pytest.raises(ValueError, match=f"{rule} {name}"):
            Full().fit(angles("walk-a"), skeleton)
    with pytest.raises(ValueError, match="angles must differ between frames"):
        Full(limits="training").fit(np.zeros((5, 63)))


def test_last_digits_of_a_library_of_linear_algebra_change_nothing_of_a_prior() -> None:
    walk = angles("walk-a", "walk-b")
    noise = 1.0 + 1e-15 * np.random.default_rng(0).standard_normal(walk.shape)
    one = vars(PCA().fit(walk))
    other = vars(PCA().fit(walk * noise))
    for name, value in one.items():
        np.testing.assert_array_equal(value, other[name], err_msg=name)


def test_equal_poses_have_equal_clusters_and_few_poses_are_a_centre_each() -> None:
    poses = angles("walk-a")
    centres, _ = clusters_of(poses, 5, 0.99)
    assert centres.shape == (5, 63)
    np.testing.assert_array_equal(clusters_of(poses, 5, 0.99)[0], centres)
    centres, reach = clusters_of(
        np.repeat([[0.0, 0.0], [1.0, 0.0], [0.0, 2.0]], 4, axis=0), 5, 1.0
    )
    assert {tuple(centre) for centre in centres} == {(0.0, 0.0), (1.0, 0.0), (0.0, 2.0)}
    assert reach == 0.0


def test_a_loose_prior_reaches_poses_beyond_its_components() -> None:
    walks = angles("walk-a", "walk-b", "walk-c")
    run = angles("run-a")
    prior = Loose().fit(walks, built_in.average_skeleton())
    pca = PCA(components=12).fit(walks)
    # both shoulders and hips turn about three axes in CMU's skeletons, elbows and knees about one
    assert len(prior.loose) == 2 * (3 + 1 + 3 + 1)
    assert len(prior.low) == 12 + 16
    arms = [i for i in prior.loose if i >= 30]
    latents = prior.transform(angles("walk-a")[:1])
    assert prior.feasible(latents).all()
    latents[0, 12:] -= 3.0  # past a joint's limit
    assert not prior.feasible(latents).any()
    left = np.abs(pca.inverse_transform(pca.transform(run)) - run)[:, arms].mean()
    assert (
        np.abs(prior.inverse_transform(prior.transform(run)) - run)[:, arms].mean()
        < 1e-9
        < left
    )


def test_a_loose_angle_reaches_as_far_as_every_training_pose_may_still_go() -> None:
    # the thigh's rx may lie in -160 to 20 degrees (.asf of CMU); in training it goes from -20 to 10. All training poses
    # may go down by 140 at least, so the setting's 15 degrees bound that side, and up by no more than 20 - 10 = 10.
    poses = np.zeros((200, 63))
    thigh = 3
    poses[:, thigh] = np.radians(np.linspace(-20.0, 10.0, 200))
    prior = Loose(components=1, legs_degrees=15.0).fit(
        poses, built_in.average_skeleton()
    )
    assert prior.loose.tolist() == [thigh]
    assert np.degrees([prior.low[1], prior.high[1]]) == pytest.approx([-15.0, 10.0])


def test_no_freedom_at_all_is_the_space_of_pca() -> None:
    poses = angles("walk-a", "walk-b", "walk-c")
    prior = Loose(arms_degrees=0.0, legs_degrees=0.0, slack=1.0).fit(
        poses, built_in.average_skeleton()
    )
    latents = prior.transform(poses)
    pca = PCA(components=12).fit(poses)
    latents[:, 12:] = 0.0
    expected = pca.inverse_transform(pca.transform(poses))
    np.testing.assert_allclose(prior.inverse_transform(latents), expected, atol=1e-12)


def test_mistakes_in_settings_are_named() -> None:
    for kind, settings, message in (
        (PCA, {"components": 2.5}, "components must be a whole number or a share"),
        (PCA, {"clusters": 0}, "clusters must be at least 1, got 0"),
        (Transformed, {"variant": "TSNE"}, "variant must be one of .*, got 'TSNE'"),
        (
            Transformed,
            {"options": "gamma=1"},
            "options must be a JSON object, got 'gamma=1'",
        ),
        (
            Transformed,
            {"options": '{"gama": 1}'},
            "options of KernelPCA must be among alpha, .*, got gama",
        ),
    ):
        with pytest.raises(ValueError, match=message):
            kind(**settings)
    with pytest.raises(
        ValueError, match="angles must contain at least 7 frames, got 3"
    ):
        PCA().fit(np.zeros((3, 63)))


def test_a_linear_transformer_is_inverted_as_scikit_learn_does_it() -> None:
    from sklearn import decomposition

    poses = angles("walk-a", "walk-b")
    prior = Transformed(variant="PCA", components=5).fit(poses)
    theirs = decomposition.PCA(5, random_state=0).fit(poses)
    latents = prior.transform(poses)
    np.testing.assert_allclose(latents, theirs.transform(poses), atol=1e-12)
    np.testing.assert_allclose(
        prior.inverse_transform(latents), theirs.inverse_transform(latents), atol=1e-12
    )
