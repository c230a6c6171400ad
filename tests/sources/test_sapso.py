"""One test for each equation and step of the paper, sections 2 to 5, with numbers worked by hand or by a slow twin."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import ks_2samp

from posefit import (
    Body,
    Camera,
    Problem,
    SearchSpace,
    Silhouette,
    Start,
    areas,
    minimise,
    mismatch,
    project,
)
from posefit.fitting import metrics
from posefit.fitting.prior import Components
from posefit.fitting.synthesis import Prediction, Predictor, SynthesisTracker
from posefit.geometry.rotation import rotation_from_root_angles, yaw_first
from posefit.geometry.skeleton import ANGLES, ENDS, INNER, JOINTS
from posefit.motion import built_in
from posefit.plugin import Array, draw_population
from posefit.settings import settings_of
from posefit.testing.problem import pose_problem
from posefit.testing.toy import Toy
from posefit.testing.tracker_rules import scene
from posefit_priors.pca import PCA
from posefit_reproduce.sapso.letter import LetterSAPSO, velocity_limits
from posefit_swarm.sapso import SAPSO, Rows, fly, inertia_at, limited, redrawn


class Line(Components):
    """A prior of one latent, the first joint angle; feasible unless it lies in a gap."""

    def __init__(self, gap: tuple[float, float] = (np.inf, -np.inf)) -> None:
        super().__init__(np.zeros(63), np.eye(1, 63), np.array([-1.0]), np.array([1.0]))
        self.gap = gap

    def feasible(self, latents: Array) -> Any:
        return (latents[:, 0] <= self.gap[0]) | (latents[:, 0] >= self.gap[1])


def line_space(
    gap: tuple[float, float] = (np.inf, -np.inf), start: Start | None = None
) -> SearchSpace:
    return SearchSpace(Line(gap), np.zeros(3), np.ones(3), np.zeros(3), start=start)


class Fixed(np.random.Generator):
    """A generator whose rand() is always the same numbers, in the shape asked for; its other draws are as usual."""

    def __init__(self, *values: float) -> None:
        super().__init__(np.random.PCG64(0))
        self.values = np.array(values)

    def random(self, size: Any = None, *_: Any, **__: Any) -> Any:
        return np.resize(self.values, size)


@pytest.fixture(scope="module")
def walk() -> Array:
    return np.concatenate(
        [
            built_in.motion(style).poses[:, 3:]
            for style in ("walk-a", "walk-b", "walk-c")
        ]
    )


def test_the_skeleton_has_27_joints_and_66_angles() -> None:
    assert (len(JOINTS), len(INNER), len(ENDS)) == (27, 21, 5)
    assert 3 + 21 * 3 == ANGLES == 66
    assert {JOINTS[end] for end in ENDS} == {"head", "lhand", "rhand", "ltoes", "rtoes"}


def test_the_prior_is_blind_to_the_root(walk: Array) -> None:
    prior = PCA().fit(walk)
    # m = 6 everywhere; 63 = 66 less the root's 3
    assert prior.components.shape == (6, 63)


def test_2_1_1_the_centre_is_the_mean() -> None:  # SAPSO 2.1.1
    angles = np.zeros((6, 63))
    angles[:, 0] = [0.0, 1.0, 2.0, 3.0, 4.0, 8.0]
    assert PCA(components=1, clusters=1).fit(angles).mean[0] == pytest.approx(3.0)


# SAPSO 2.1.2
def test_2_1_2_the_directions_are_those_of_the_covariance(walk: Array) -> None:
    prior = PCA().fit(walk)
    values, vectors = np.linalg.eigh(np.cov(walk.T))
    ours = np.abs(prior.components @ vectors[:, ::-1][:, :6])
    np.testing.assert_allclose(ours, np.eye(6), atol=1e-6)
    # seven decimals
    np.testing.assert_allclose(
        prior.explained, (values[::-1] / values.sum())[:6], atol=1e-7
    )


def test_2_1_a_share_of_the_variance_chooses_the_components(walk: Array) -> None:
    prior = PCA(components=0.95).fit(walk)
    assert prior.explained.sum() >= 0.95
    assert prior.explained[:-1].sum() < 0.95


def test_2_1_3_projection_and_recovery_by_hand() -> None:  # SAPSO 2.1.3 projection
    prior = PCA(components=1, clusters=1)
    prior.mean, prior.components = np.zeros(63), np.zeros((1, 63))
    prior.mean[:2], prior.components[0, :2] = [1.0, 2.0], [0.6, 0.8]
    x = np.zeros((1, 63))
    x[0, :2] = [2.0, 4.0]
    assert prior.transform(x)[0, 0] == pytest.approx(0.6 * 1.0 + 0.8 * 2.0)  # 2.2
    np.testing.assert_allclose(
        prior.inverse_transform(np.array([[2.2]]))[0, :2], [1.0 + 1.32, 2.0 + 1.76]
    )


def test_2_1_3_projection_undoes_recovery(walk: Array) -> None:  # SAPSO 2.1.3 recovery
    prior = PCA().fit(walk)
    latents = np.random.default_rng(0).normal(size=(20, 6))
    np.testing.assert_allclose(
        prior.transform(prior.inverse_transform(latents)), latents, atol=1e-12
    )


# SAPSO 2.2 constraint 1
def test_2_2_constraint_1_is_the_range_of_the_training_latents(walk: Array) -> None:
    prior = PCA().fit(walk)
    latents = (walk - walk.mean(axis=0)) @ prior.components.T
    # a sum of 63 numbers of seven decimals
    np.testing.assert_allclose(prior.low, latents.min(axis=0), atol=1e-6)
    np.testing.assert_allclose(prior.high, latents.max(axis=0), atol=1e-6)
    space = SearchSpace(prior, np.zeros(3), np.ones(3), np.zeros(3))
    np.testing.assert_allclose(
        space.proposals(np.concatenate([np.zeros(3), prior.high]))[3:], 1.0
    )


def test_2_2_constraint_2_by_hand() -> None:  # SAPSO 2.2 constraint 2
    prior = PCA(components=2, clusters=2)
    prior.centres, prior.reach = np.array([[0.0, 0.0], [4.0, 0.0]]), np.array(1.0)
    # D: (0.5 + 1) / 2 = 0.75; (2 + 0) / 2 = 1, from either centre, is not below chi; (1 + 0.5) / 2 from the second
    latents = np.array([[0.5, 1.0], [2.0, 0.0], [5.0, 0.5], [4.0, 3.0]])
    assert prior.feasible(latents).tolist() == [True, False, True, False]


def test_2_2_chi_is_the_99th_percentile_of_the_training_distances(walk: Array) -> None:
    prior = PCA().fit(walk)
    distances = (
        np.abs(prior.centres[None] - prior.transform(walk)[:, None])
        .mean(axis=2)
        .min(axis=1)
    )
    assert prior.centres.shape == (5, 6)  # K = 5
    assert float(prior.reach) == pytest.approx(np.quantile(distances, 0.99))


# SAPSO 2.2 velocity
def test_2_2_velocities_keep_within_alpha_of_the_half_range() -> None:
    np.testing.assert_allclose(
        limited(np.array([[-0.3, -0.1, 0.2]]), 0.15), [[-0.15, -0.1, 0.15]]
    )


# Interpretation S9
def test_2_2_literal_velocity_limits_are_alpha_times_the_ranges_ends() -> None:
    prior = Line()
    # half-range 2: alpha 2 / 2 and alpha 6 / 2
    prior.low, prior.high = np.array([2.0]), np.array([6.0])
    space = SearchSpace(prior, np.zeros(3), np.ones(3), np.zeros(3))
    limits = np.array(velocity_limits(space))
    np.testing.assert_allclose(limits[:, 3], [0.15, 0.45])
    assert np.isinf(limits[:, :3]).all()  # they are those of x_s, and not of the root


def moved(
    *,
    r1: float = 0.25,
    r2: float = 0.5,
    omega: float = 0.5,
    x: float = 0.1,
    v: float = 0.2,
    **changed: Any,
) -> tuple[float, float]:
    """Return velocity and position of one coordinate after a move, with the personal best 0.3 and the swarm's -0.1."""
    how = {"pbest": 0.3, "gbest": -0.1, "alpha": 0.9, "wrapping": 0} | changed
    space = Toy(1, wrapping=how["wrapping"])
    swarm = SAPSO(
        space,
        np.random.default_rng(0),
        population_size=2,
        inertia=omega,
        alpha=how["alpha"],
    )
    swarm.x[:], swarm.v[:] = x, v
    swarm.pbest[:, 0], swarm.pbest_cost[:], swarm.rng = (
        [how["pbest"], how["gbest"]],
        [2.0, 1.0],
        Fixed(r1, r2),
    )
    velocity, position = swarm.step(np.array([0]))
    return float(velocity[0, 0]), float(position[0, 0])


def test_eq_1_by_hand() -> None:  # SAPSO (1)
    # 0.5 * 0.2 + 2 * 0.25 * (0.3 - 0.1) + 2 * 0.5 * (-0.1 - 0.1) = 0.1 + 0.1 - 0.2
    assert moved()[0] == pytest.approx(0.0)
    assert moved(omega=1.0)[0] == pytest.approx(0.1)
    assert moved(omega=1.0, alpha=0.05)[0] == 0.05


def test_eq_2_by_hand() -> None:  # SAPSO (2)
    assert moved(omega=1.0)[1] == pytest.approx(0.1 + 0.1)


def test_a_periodic_coordinate_moves_the_short_way_round() -> None:
    # from 0.9 to -0.9 it is 0.2 ahead, over the seam
    velocity, position = moved(v=0.0, r1=0.0, r2=0.5, x=0.9, gbest=-0.9, wrapping=1)
    assert velocity == pytest.approx(0.2)
    assert position == pytest.approx(-0.9)


def test_c1_and_c2_are_2_and_section_5_sets_the_rest() -> None:
    defaults = {setting.name: setting.default for setting in settings_of(SAPSO)}
    paper = {
        "population_size": 40,
        "iterations": 60,
        "temperature": 1.0,
        "cooling": 0.95,
    }
    assert defaults == paper | {"acceleration": 2.0, "alpha": 0.15} | {
        "stop_temperature": 0.0,
        "inertia": 0.9,
    }


def test_inertia_falls_from_a_to_a_tenth() -> None:  # SAPSO inertia
    assert inertia_at(0, 60, 0.9) == pytest.approx(0.9)
    assert inertia_at(60, 60, 0.9) == pytest.approx(0.1)
    # c = ln(9) / 2 half-way: 0.9 / 3
    assert inertia_at(30, 60, 0.9) == pytest.approx(0.3)


@pytest.mark.pure
def test_eq_3_by_counting_pixels() -> None:  # SAPSO (3)
    body = Body.of(built_in.average_skeleton())
    camera = Camera.around(np.zeros(3), 0.3, 4.0, (50, 40))
    rng = np.random.default_rng(0)
    poses = rng.normal(0.0, 0.3, (3, ANGLES))
    translations = rng.uniform(-0.2, 0.2, (3, 3))
    observed = project(body, camera, poses[0], translations[0])
    counted = areas(body, camera, Silhouette.of(observed), poses, translations)
    for pose, translation, counts in zip(poses, translations, counted, strict=True):
        model = project(body, camera, pose, translation)
        r = (observed & ~model).sum()
        b = (model & ~observed).sum()
        y = (observed & model).sum()
        assert counts.tolist() == [r, b, y]


@pytest.mark.pure
def test_eq_4_by_hand() -> None:  # SAPSO (4)
    # R = 10, B = 20, Y = 30: 100 (0.5 * 20 / 50 + 0.5 * 10 / 40) = 20 + 12.5
    assert mismatch(np.array([[10, 20, 30]]))[0] == pytest.approx(32.5)
    # beta = 0.2: 100 (0.8 * 0.4 + 0.2 * 0.25)
    assert mismatch(np.array([[10, 20, 30]]), 0.2)[0] == pytest.approx(37.0)


def test_eq_4_is_zero_for_equal_masks_and_100_for_disjoint_ones() -> None:
    assert mismatch(np.array([[0, 0, 7], [5, 9, 0]])).tolist() == [0.0, 100.0]


def test_eq_4_counts_an_empty_denominator_as_1() -> None:  # Interpretation S2
    assert mismatch(np.array([[8, 0, 0], [0, 8, 0], [0, 0, 0]])).tolist() == [
        100.0,
        100.0,
        100.0,
    ]


def test_a1_1_the_first_particles_meet_both_constraints() -> None:  # SAPSO A1.1
    space = line_space(gap=(-0.8, 0.8))
    first = SAPSO(space, np.random.default_rng(0), population_size=200).ask()
    assert (np.abs(first) <= 1.0).all()
    assert (np.abs(first[:, 3]) >= 0.8).all()


def run(optimiser: SAPSO | LetterSAPSO, cost: Callable[[Array], Array]) -> list[Array]:
    populations = []
    while len(proposals := optimiser.ask()):
        populations.append(proposals)
        optimiser.tell(proposals, cost(proposals))
    return populations


def bowl(proposals: Array) -> Array:
    return np.asarray(100.0 * ((proposals - 0.3) ** 2).mean(axis=1))


# Interpretation S10
def test_a1_2_there_are_c_moves_and_n_times_c_plus_1_evaluations() -> None:
    # to the letter the last is not evaluated
    for factory, evaluations in ((SAPSO, 7 * (5 + 1)), (LetterSAPSO, 7 * 5)):
        populations = run(
            factory(
                line_space(), np.random.default_rng(0), population_size=7, iterations=5
            ),
            bowl,
        )
        assert sum(map(len, populations)) == evaluations


def test_s3_the_papers_root_angles_are_about_x_then_y_then_z() -> None:
    # a quarter turn about y, which is at the singularity: turns about x and about z are the same there
    space = replace(line_space(), root_order="xyz")
    side = np.array([np.pi / 2, 0.3, 0.0]), np.array([np.pi / 2, 0.0, 0.3])
    about_x, about_z = (rotation_from_root_angles(yaw_first(angles)) for angles in side)
    np.testing.assert_allclose(about_x, about_z, atol=1e-12)
    # with the yaw outermost they are two turns of 0.3 about axes at a right angle
    pitched, rolled = (rotation_from_root_angles(angles) for angles in side)
    assert np.trace(pitched.T @ rolled) == pytest.approx(
        (1.0 + np.cos(0.3)) ** 2 - 1.0, abs=1e-9
    )
    # x first: R = Rx(0.3) Ry(0.5) Rz(0)
    cos = np.cos(0.3)
    sin = np.sin(0.3)
    about = np.array(
        [[1, 0, 0], [0, cos, -sin], [0, sin, cos]]
    ) @ rotation_from_root_angles(np.array([0.5, 0.0, 0.0]))
    coordinates = np.concatenate([[0.5, 0.3, 0.0], space.centre[3:]])
    space = replace(space, root_range=np.full(3, 1.0))
    pose = space.decode(space.proposals(coordinates)[None])[0][0]
    np.testing.assert_allclose(rotation_from_root_angles(pose[:3]), about, atol=1e-12)


def test_the_papers_variant_of_the_tracker_is_the_letter_of_every_interpretation() -> (
    None
):
    task, _, observations = scene()
    space = Predictor(task, Line(), Prediction(variant="paper")).space(observations[0])
    assert (space.tilt, space.root_order) == (None, "xyz")  # Interpretations S16, S3


def test_a1_2_the_loop_ends_at_the_stop_temperature() -> None:  # SAPSO A1.2
    # 0.95^k <= 0.5 first at k = 14 moves: the first population and 14 more are evaluated
    optimiser = SAPSO(line_space(), np.random.default_rng(0), stop_temperature=0.5)
    assert len(run(optimiser, bowl)) == 1 + 14


def judged(
    cost: float, chance: float, temperature: float = 1.0
) -> tuple[bool, float, float]:
    """Return whether a move from 0.1, cost 2, to 0.7 is accepted, then position and personal best, which was 0.5."""
    swarm = SAPSO(Toy(1), Fixed(chance), population_size=1, temperature=temperature)
    swarm.x, swarm.cost, swarm.moved = (
        np.array([[0.1]]),
        np.array([2.0]),
        np.array([[0.7]]),
    )
    swarm.pbest, swarm.pbest_cost = np.array([[0.5]]), np.array([1.5])
    swarm.tell(swarm.ask(), np.array([cost]))
    return bool(swarm.x[0, 0] == 0.7), float(swarm.x[0, 0]), float(swarm.pbest[0, 0])


# SAPSO A1.2a
def test_a1_2a_every_particle_is_evaluated_once_in_each_iteration() -> None:
    sizes: list[int] = []

    def evaluate(proposals: Array) -> Array:
        sizes.append(len(proposals))
        return bowl(proposals)

    space = line_space()
    optimiser = SAPSO(space, np.random.default_rng(0), population_size=7, iterations=5)
    problem = Problem(evaluate, space, 7 * 6)
    minimise(problem, optimiser, budget_known=True)
    assert sizes == [7] * 6


def test_a1_3_the_output_is_the_swarms_best() -> None:  # SAPSO A1.3
    space = line_space()
    optimiser = SAPSO(space, np.random.default_rng(0), population_size=7, iterations=5)
    problem = minimise(Problem(bowl, space, 7 * 6), optimiser, budget_known=True)
    leader = optimiser.pbest_cost.argmin()
    assert problem.best_cost == optimiser.pbest_cost[leader]
    np.testing.assert_array_equal(problem.best, optimiser.pbest[leader])


def test_a1_2b_a_personal_best_changes_only_for_a_lower_cost() -> None:  # SAPSO A1.2b
    assert judged(1.0, 0.5)[2] == 0.7
    assert judged(1.8, 0.5)[2] == 0.5


# SAPSO A1.2d
def test_a1_2d_a_rise_is_accepted_with_chance_exp_minus_de_over_t() -> None:
    # dE = 1, T = 1: exp(-1) = 0.3679
    assert judged(3.0, 0.367)[:2] == (True, 0.7)
    assert judged(3.0, 0.368)[:2] == (False, 0.1)
    # T = 0.5: exp(-2) = 0.1353
    assert [judged(3.0, chance, 0.5)[0] for chance in (0.135, 0.136)] == [True, False]
    # dE <= 0 always
    assert [judged(cost, 0.9999)[0] for cost in (2.0, 1.0)] == [True, True]
    assert not judged(np.nan, 0.0)[0]


def test_a1_2c_a_particle_never_leaves_the_constraints() -> None:  # SAPSO A1.2c
    space = line_space(gap=(-0.5, 0.5))
    for factory in (SAPSO, LetterSAPSO):
        for proposals in run(
            factory(space, np.random.default_rng(1), population_size=30), bowl
        ):
            assert space.feasible(proposals).all()


# Interpretation S7
def test_a1_2c_to_the_letter_a_velocity_beyond_its_limits_is_redrawn_and_not_moved_to_them():
    # from 0, a pull of 2 rand() 0.2 towards the swarm's best: uniform on 0 to 0.4, of which the limit 0.15 leaves 3/8
    velocities = []
    for factory in (SAPSO, LetterSAPSO):
        swarm = factory(line_space(), np.random.default_rng(0), population_size=2000)
        swarm.x[:], swarm.pbest[:], swarm.v[:] = 0.0, 0.0, 0.0
        swarm.pbest[0, 3], swarm.pbest_cost[0] = 0.2, 0.0
        swarm.tell(swarm.ask(), np.full(2000, np.nan))  # which no particle accepts
        velocities.append(swarm.v[1:, 3])
    clamped, redrawn = velocities
    assert (clamped == 0.15).mean() == pytest.approx(5 / 8, abs=0.05)
    assert redrawn.max() < 0.15
    assert redrawn.mean() == pytest.approx(0.075, abs=0.005)


FEASIBLE = 0.3  # share of steps that are allowed


def stepped(
    count: int, redraws: int, feasible: float = FEASIBLE
) -> tuple[Array, Array]:
    """Return velocities and positions (n, 2) of particles at -1 whose first coordinate must be below `feasible`."""
    rng = np.random.default_rng(3)

    def step(rows: Rows) -> tuple[Array, Array]:
        moved = rng.random((len(rows), 2))
        return moved + 1.0, moved

    def allowed(_: Array, moved: Array) -> NDArray[np.bool_]:
        return np.asarray(moved[:, 0] < feasible)

    return redrawn(np.full((count, 2), -1.0), step, allowed, redraws)


# Interpretation S7
def test_redrawn_points_have_the_distribution_of_the_feasible_part() -> None:
    velocity, position = stepped(3000, 100)
    np.testing.assert_allclose(velocity, position + 1.0)  # both are of the same draw
    assert position[:, 0].max() < FEASIBLE
    uniform = np.random.default_rng(4).random((3000, 2)) * [FEASIBLE, 1.0]
    for k in range(2):
        assert ks_2samp(position[:, k], uniform[:, k]).pvalue > 0.01


# Interpretation S7
def test_a_particle_is_redrawn_as_often_as_asked_and_then_stays_at_rest() -> None:
    for redraws, failing in [(1, 0.49), (4, 0.16807), (10, 0.019773)]:
        velocity, position = stepped(4000, redraws)
        stays = position[:, 0] == -1.0
        deviation = np.sqrt(failing * (1.0 - failing) / 4000)
        # 0.7^(1 + redraws)
        assert stays.mean() == pytest.approx(failing, abs=3.5 * deviation)
        np.testing.assert_array_equal(velocity[stays], 0.0)
        np.testing.assert_array_equal(position[stays], -1.0)


# Interpretation S7
def test_a_wall_of_the_box_stops_a_coordinate_there_and_no_other() -> None:
    velocity, position = fly(
        Toy(3), np.array([[0.9, -0.9, 0.5]]), np.array([[0.2, -0.05, 0.1]])
    )
    np.testing.assert_allclose(velocity, [[0.0, -0.05, 0.1]])
    np.testing.assert_allclose(position, [[1.0, -0.95, 0.6]])


def test_a1_2e_cools_once_an_iteration_or_once_an_acceptance() -> None:  # SAPSO A1.2e
    for factory, expected in ((SAPSO, 0.95**3), (LetterSAPSO, 0.95 ** (3 * 4))):
        swarm = factory(
            line_space(), np.random.default_rng(0), population_size=4, iterations=9
        )
        for _ in range(4):  # a flat cost: every move is accepted
            swarm.tell(swarm.ask(), np.zeros(4))
        assert pytest.approx(expected) == swarm.T


# Interpretation S6
def test_a1_2e_read_literally_the_swarm_freezes_in_3_to_5_iterations() -> None:
    optimiser = LetterSAPSO(
        line_space(), np.random.default_rng(0), stop_temperature=0.01
    )
    assert 3 <= len(run(optimiser, bowl)) - 1 <= 5


def test_s8_a_scalar_rand_moves_all_coordinates_alike() -> None:
    for factory, alike in ((LetterSAPSO, True), (SAPSO, False)):
        swarm = factory(Toy(4), np.random.default_rng(0), population_size=1)
        swarm.x[:], swarm.pbest[:], swarm.v[:] = 0.0, 0.03, 0.0
        assert (np.ptp(swarm.step(np.array([0]))[1]) < 1e-12) == alike


def test_s11_a_refused_move_keeps_its_velocity() -> None:
    swarm = SAPSO(Toy(4), Fixed(1.0), population_size=1, iterations=2, acceleration=0.0)
    swarm.x[:] = swarm.moved[:] = 0.0
    swarm.tell(swarm.ask(), np.array([0.0]))
    before = swarm.v.copy()
    swarm.tell(swarm.ask(), np.array([50.0]))
    np.testing.assert_array_equal(swarm.x, 0.0)
    np.testing.assert_allclose(swarm.v, inertia_at(1, 2, 0.9) * before)


def test_eq_7_velocities_of_the_first_population_keep_within_the_limits() -> None:
    # v_pred of 3, -3 and 0.1: drawn from U(0, 3) no more than a twentieth lies below the limit 0.15; the rest is
    # clipped to it. U(0, 0.1) needs no clipping.
    start = Start(np.zeros(4), np.full(4, 0.1), np.array([3.0, -3.0, 0.1, 0.0]))
    velocity = SAPSO(
        line_space(start=start), np.random.default_rng(0), population_size=400
    ).v
    assert velocity.max(axis=0)[[0, 2]].tolist() == [
        0.15,
        pytest.approx(0.1, abs=0.005),
    ]
    assert velocity.min(axis=0)[1] == -0.15
    assert (np.abs(velocity) <= 0.15).all()
    assert 0.90 < (velocity[:, 0] == 0.15).mean() < 1.0
    # all between 0 and v_pred, whose sign may be either
    assert velocity.min(axis=0)[0] >= 0.0
    assert velocity.max(axis=0)[1] <= 0.0
    assert (velocity[:, 3] == 0.0).all()


def test_eq_5_the_search_returns_the_least_cost_it_saw() -> None:  # SAPSO (5)
    cost = pose_problem().cost
    seen = list[float]()

    def evaluate(proposals: Array) -> Array:
        costs = cost(proposals)
        seen.extend(costs)
        return costs

    problem = Problem(evaluate, cost.space, 2440)
    minimise(problem, SAPSO(problem.space, np.random.default_rng(0)))
    assert problem.evaluations == len(seen) == 40 * 61
    assert problem.best_cost == min(seen) == cost(problem.best[None])[0]
    # the mean pose seen from where it stands
    assert problem.best_cost < 0.6 * cost(np.zeros((1, 9)))[0]


# SAPSO (6)
def test_eq_6_the_first_population_is_normal_around_the_last_best() -> None:
    start = Start(
        np.array([0.1, -0.2, 0.0, 0.3]), np.array([0.05, 0.1, 0.02, 0.2]), np.zeros(4)
    )
    drawn = draw_population(line_space(start=start), np.random.default_rng(0), 4000)
    np.testing.assert_allclose(drawn.mean(axis=0), start.mean, atol=0.02)
    np.testing.assert_allclose(drawn.std(axis=0), start.spread, rtol=0.06)


# SAPSO (7)
def test_eq_7_first_velocities_are_uniform_from_zero_to_the_predicted_one() -> None:
    # Interpretation S12: a negative bound is sorted, not refused
    velocity = np.array([0.1, -0.1, 0.0, 0.05])
    start = Start(np.zeros(4), np.full(4, 0.01), velocity)
    drawn = SAPSO(
        line_space(start=start), np.random.default_rng(0), population_size=4000
    ).v
    np.testing.assert_allclose(drawn.min(axis=0), np.minimum(0.0, velocity), atol=2e-3)
    np.testing.assert_allclose(drawn.max(axis=0), np.maximum(0.0, velocity), atol=2e-3)
    np.testing.assert_allclose(drawn.mean(axis=0), velocity / 2.0, atol=2e-3)


class Scripted:
    """An optimiser that proposes one given point of the unit box a frame, and keeps the space it was given."""

    def __init__(self, space: SearchSpace, point: Array) -> None:
        self.space, self.left = space, [np.empty((0, len(point))), point[None]]

    def ask(self) -> Array:
        return self.left.pop()

    def tell(self, proposals: Array, costs: Array) -> None: ...


@pytest.mark.parametrize(
    ("variant", "steps"), [("default", [0.0, 0.2, -0.1]), ("paper", [0.0, 0.0, 0.2])]
)
# Interpretation S12
def test_v_pred_is_the_last_step_and_zero_on_the_second_frame(variant, steps):
    latents = [0.1, 0.3, 0.2, 0.2]
    made: list[Scripted] = []

    def make(space: SearchSpace, rng: object, evaluations: int) -> Scripted:
        made.append(Scripted(space, np.array([0.0, 0.0, 0.0, latents[len(made)]])))
        return made[-1]

    task, _, observations = scene()
    tracker = SynthesisTracker(
        task,
        Line(),
        make,
        prediction=Prediction(variant=variant, spread=2.0, floor=0.05),
    )
    list(tracker.track(observations[:4], np.random.default_rng(0)))
    first, *starts = [optimiser.space.start for optimiser in made]
    assert first is None  # frame 1 is an estimation
    for start, step, last in zip(starts, steps, latents, strict=False):
        assert start.velocity[3] == pytest.approx(step)
        assert start.mean[3] == pytest.approx(last)
        # Interpretation S5
        assert start.spread[3] == pytest.approx(max(2.0 * abs(step), 0.05))


def test_eq_8_is_the_mean_absolute_difference_of_66_angles() -> None:  # SAPSO (8)
    truth = np.zeros((1, 66))
    estimate = np.zeros((1, 66))
    estimate[0, 7] = np.radians(66.0)
    assert metrics.pose_error_degrees(truth, estimate)[0] == pytest.approx(1.0)


def test_eq_8_wraps_differences() -> None:  # Interpretation S13
    truth = np.full((1, 66), np.radians(179.0))
    estimate = np.full((1, 66), np.radians(-179.0))
    assert metrics.pose_error_degrees(truth, estimate)[0] == pytest.approx(2.0)


ERRORS = np.array([2.0, 4.0, 4.0, 4.0, 5.0, 5.0, 7.0, 9.0])


def test_eq_9_is_the_mean() -> None:  # SAPSO (9)
    assert metrics.mean_error(ERRORS) == 5.0


def test_eq_10_is_the_standard_deviation_with_divisor_t() -> None:  # SAPSO (10)
    assert metrics.error_spread(ERRORS) == 2.0  # a textbook example
