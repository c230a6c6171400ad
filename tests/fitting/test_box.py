"""Functions on a box of which only some is feasible: they always end, and what they return is feasible."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import kstest, truncnorm

from posefit import SearchSpace, Start
from posefit.arrays import Array
from posefit.errors import InputError
from posefit.fitting import box
from posefit.fitting.box import converted, draw_population, repair, sample_normal
from posefit.fitting.cma import CMAES
from posefit.motion import built_in
from posefit.testing.toy import Toy, anywhere, ball, shell
from posefit_priors.pca import PCA


def nowhere(proposals: Array) -> Array:
    return np.zeros(len(proposals), dtype=bool)


def corner(proposals: Array) -> Array:
    return np.asarray((proposals > 0.9).all(axis=1))


@given(st.floats(-50.0, 50.0))
def test_folding_mirrors_at_the_sides(x: float) -> None:
    folded = box.fold(Toy(1), np.array([[x]]))[0, 0]
    assert -1.0 <= folded <= 1.0
    # a triangle wave of period 4: the angle whose sine runs from -1 to 1 with it
    assert np.arcsin(np.sin(0.5 * np.pi * x)) == pytest.approx(
        0.5 * np.pi * folded, abs=1e-6
    )


def test_folding_keeps_inner_points_and_wraps_periodic_coordinates() -> None:
    space = Toy(2, wrapping=1)
    np.testing.assert_allclose(
        box.fold(space, np.array([[1.2, 1.2], [0.3, -0.4]])), [[-0.8, 0.8], [0.3, -0.4]]
    )


def test_a_scatter_is_normal_around_its_means() -> None:
    means = np.repeat([[0.2, -0.3], [-0.5, 0.4]], 20_000, axis=0)
    drawn = sample_normal(
        Toy(2), np.random.default_rng(0), means, np.array([0.05, 0.1])
    )
    for rows in (slice(0, 20_000), slice(20_000, None)):
        np.testing.assert_allclose(drawn[rows].mean(axis=0), means[rows][0], atol=3e-3)
        np.testing.assert_allclose(drawn[rows].std(axis=0), [0.05, 0.1], rtol=0.03)


def test_a_scatter_is_feasible_and_redraws_only_what_is_not() -> None:
    space = Toy(3, ball)
    means = draw_population(space, np.random.default_rng(0), 500)
    drawn = sample_normal(space, np.random.default_rng(1), means, np.full(3, 0.3))
    assert space.feasible(drawn).all()
    free = sample_normal(Toy(3), np.random.default_rng(1), means, np.full(3, 0.3))
    kept = space.feasible(free)
    assert 0.5 < kept.mean() < 1.0
    np.testing.assert_array_equal(drawn[kept], free[kept])


def test_a_scatter_where_nothing_is_feasible_stays_at_its_means() -> None:
    drawn = sample_normal(
        Toy(2, nowhere), np.random.default_rng(0), np.zeros((4, 2)), np.full(2, 0.1)
    )
    np.testing.assert_array_equal(drawn, np.zeros((4, 2)))


def test_a_repair_moves_to_the_farthest_feasible_point_of_the_line() -> None:
    space = Toy(1, lambda x: np.asarray(np.abs(x[:, 0]) < 0.5))
    home = np.zeros(1)
    mended = repair(space, np.array([[0.2], [0.9], [-3.0], [np.nan]]), home)
    # of 32 points on the way from 0 to 0.9 the 17th is the last below 0.5; from 0 to -1 the 15th
    np.testing.assert_allclose(mended[:, 0], [0.2, 0.9 * 17 / 32, -15 / 32, 0.0])
    # a home for each proposal
    each = repair(space, np.array([[0.2], [0.9]]), np.array([[0.1], [0.0]]))
    np.testing.assert_allclose(each[:, 0], [0.2, 0.9 * 17 / 32])


def test_a_repair_is_always_feasible() -> None:
    on_shell = [0.3 + np.sqrt(0.1), 0.3 - np.sqrt(0.1)]
    homes = (
        (anywhere, [0.0, 0.0]),
        (ball, [0.1, 0.1]),
        (shell, on_shell),
        (corner, [0.95, 0.95]),
    )
    proposals = np.random.default_rng(0).normal(0.0, 3.0, (300, 2))
    before = proposals.copy()
    for rule, home in homes:
        for wrapping in (0, 1):
            space = Toy(2, rule, wrapping=wrapping)
            assert space.feasible(repair(space, proposals, np.array(home))).all(), (
                rule,
                wrapping,
            )
            np.testing.assert_array_equal(proposals, before)


def test_a_draw_from_a_start_is_normal_within_the_box_and_redrawn_by_coordinates() -> (
    None
):
    start = Start(np.array([1.0, 0.9, 0.0]), np.array([0.1, 0.2, 0.1]), np.zeros(3))
    drawn = draw_population(Toy(3, start=start), np.random.default_rng(0), 5000)
    # normal distributions cut off at 1: 0, 0.5 and 10 deviations above their means
    for j, cut in enumerate((0.0, 0.5, 10.0)):
        away = (drawn[:, j] - start.mean[j]) / start.spread[j]
        assert kstest(away, truncnorm(-np.inf, cut).cdf).pvalue > 0.01
    # the standard error is 0.014
    assert np.abs(np.corrcoef(drawn.T)[np.triu_indices(3, 1)]).max() < 0.045


def test_a_draw_around_a_mean_far_out_of_the_box_is_folded_into_it() -> None:
    start = Start(np.array([5.2, 0.0]), np.array([0.01, 0.1]), np.zeros(2))
    drawn = draw_population(Toy(2, start=start), np.random.default_rng(0), 50)
    # a triangle wave of period 4: 5.2 is where 1.2 is, mirrored at 1
    np.testing.assert_allclose(drawn[:, 0], 0.8, atol=0.05)


def test_a_draw_where_nothing_is_feasible_is_an_error() -> None:
    with pytest.raises(ValueError, match="feasible latents in its range, got none"):
        draw_population(Toy(2, nowhere), np.random.default_rng(0), 3)


def test_moving_to_another_box_keeps_the_pose() -> None:
    motion = built_in.motion("walk-a")
    prior = PCA().fit(motion.poses[:, 3:])
    old, new = (
        SearchSpace(
            prior,
            np.array([yaw, 0.0, 0.0]),
            np.radians([most, 15.0, 15.0]),
            np.array([x, 1.0, 0.0]),
            "searched",
        )
        for yaw, most, x in ((0.0, 180.0, 0.0), (0.3, 45.0, 0.1))
    )
    proposals = draw_population(old, np.random.default_rng(0), 200) * np.array(
        [0.1] + [0.5] * 11
    )
    poses, places = old.decode(proposals)
    moved_poses, moved_places = new.decode(converted(new, proposals, old))
    np.testing.assert_allclose(moved_poses, poses, atol=1e-12)
    np.testing.assert_allclose(moved_places, places, atol=1e-12)


def test_a_population_has_a_whole_number_of_proposals() -> None:
    for count in (-1, 0, 2.5, True):
        with pytest.raises(InputError, match="^count must be .*at least 1, got "):
            draw_population(Toy(3), np.random.default_rng(0), count)


def test_if_no_draw_around_a_mean_is_feasible_a_feasible_draw_is_copied() -> None:
    # three deviations from what is feasible: one draw of 741 is, so that 100 redraws help one proposal of eight
    start = Start(np.array([0.6, 0.0]), np.array([0.1, 0.1]), np.zeros(2))
    space = Toy(2, lambda proposals: np.asarray(proposals[:, 0] > 0.9), start=start)
    assert not space.feasible(start.mean[None])[0]
    drawn = draw_population(space, np.random.default_rng(0), 200)
    assert space.feasible(drawn).all()
    assert 10 < len(np.unique(drawn, axis=0)) < 60
    assert space.feasible(CMAES(space, np.random.default_rng(0)).ask()).all()
