"""When a track is begun again: several hypotheses, a person who comes back the other way, and bodies that spin."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.arrays import Array
from posefit.fitting.tracker import Frame, Observation, Task
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.geometry.symmetry import mirrored_poses
from posefit.motion import built_in
from posefit.motion.motion import Motion
from posefit.output.folder import Recorder
from posefit.progress import Progress
from posefit.silhouette.cost import project
from posefit.silhouette.drawn import PoseCount
from posefit.silhouette.mask import Silhouette
from posefit.tracking.options import TrackOptions
from posefit.tracking.pipeline import _cheapest_pass, track_hypotheses
from posefit.tracking.restarts import (
    GUESSES,
    SEARCHED_AGAIN,
    initial_guess,
    relocalised,
    tracked_again,
)
from posefit.tracking.smoothing.smooth import smooth
from posefit.tracking.spins import MAX_TURN_RATE, facing_consensus, retrack_spins
from posefit.tracking.trajectory import (
    MIN_TYPICAL_SPEED,
    WALKING_SPEED,
    Tracked,
    TrajectoryCost,
    trajectory_cost,
    typical_speed,
)
from posefit.uncertainty.modes import Posterior
from tests.cases import each
from tests.tracking.scenes import exact_frames, rows_of, stopping, walk

WALK = built_in.motion("walk", frames=30)
SKELETON = WALK.skeleton
QUICK: dict[str, Any] = {"frames": (0, 3), "size": (120, 90), "evaluations": 400}


def frames_of(poses: Array, costs: Sequence[float]) -> list[Frame]:
    nothing = np.zeros((1, 3), dtype=np.int64)
    return [
        Frame(
            pose,
            np.zeros(3),
            cost,
            nothing,
            10,
            np.array([[10, cost]]),
            seconds=0.5,
            cpu_seconds=0.25,
        )
        for pose, cost in zip(poses, costs, strict=True)
    ]


def cost_of(
    poses: Array,
    costs: Sequence[float],
    speed: float | None = None,
    usable: Any = True,
    fps: float = 30.0,
) -> TrajectoryCost:
    speed = typical_speed([WALK]) if speed is None else speed
    shown = np.broadcast_to(usable, len(poses)).tolist()
    return trajectory_cost(frames_of(poses, costs), shown, SKELETON, fps, speed)


def test_the_right_trajectory_costs_less_than_one_that_jumps_or_one_that_fits_worse() -> (
    None
):
    mirrored = mirrored_poses(SKELETON, WALK.poses)  # which is as smooth
    jumping = WALK.poses.copy()
    jumping[10:20] = mirrored[10:20]  # the legs trade places, and trade back
    assert (
        cost_of(WALK.poses, [2.0] * 30).total
        < cost_of(jumping, [2.0] * 30).total - 0.05
    )
    assert cost_of(WALK.poses, [2.05] * 30).total < cost_of(mirrored, [3.35] * 30).total
    assert cost_of(mirrored, [2.05] * 30).total == pytest.approx(
        cost_of(WALK.poses, [2.05] * 30).total, abs=0.01
    )


def test_a_trajectory_cost_by_hand() -> None:
    # a straight body turns to and fro on the spot, each joint as far back as it came
    poses = np.zeros((4, 66))
    poses[:, 0] = [0.0, 0.1, 0.0, 0.1]
    joints = SKELETON.joints(poses)
    squares = ((30.0 * (joints[1] - joints[0])) ** 2).sum(axis=1).mean()
    cost = cost_of(poses, [1.0, 2.0, 3.0, 6.0], 0.8)
    assert cost.cost == 3.0
    assert cost.motion == pytest.approx(0.5 * 4.0 * squares / (2.0 * 0.8) ** 2)
    assert cost.total == cost.cost + cost.motion
    # to turn around at the typical speed costs a half
    assert cost_of(
        poses[:3], [0.0] * 3, float(np.sqrt(squares))
    ).motion == pytest.approx(0.5)
    assert cost_of(np.zeros((5, 66)), [1.0] * 5).total == 1.0
    # two frames have no change of velocity
    assert cost_of(WALK.poses[:2], [1.0, 2.0]).total == 1.5
    assert cost_of(WALK.poses[:1], [1.0]).total == 1.0


def test_a_jump_costs_the_same_however_far() -> None:
    def jump(yaw: float) -> float:
        poses = np.zeros((9, 66))
        poses[4, 0] = yaw
        return cost_of(poses, [0.0] * 9, 1.0).motion

    assert jump(0.1) < jump(2.0) == jump(3.0)
    # of three changes among seven
    assert jump(2.0) == pytest.approx(3 * 0.5 * (5.0 / 2.0) ** 2 / 7)


def test_held_frames_count_for_nothing() -> None:
    poses = WALK.poses.copy()
    costs = np.full(30, 2.0)
    poses[12], costs[12] = 0.0, 90.0
    cost = cost_of(poses, costs.tolist(), 1.0, np.arange(30) != 12)
    assert cost.cost == 2.0
    assert cost.motion < 0.1
    assert cost_of(poses, costs.tolist(), 1.0, False).cost == costs.mean()


def test_jitter_costs_the_same_at_any_rate() -> None:
    def jitter(fps: float) -> float:
        motion = built_in.motion("walk", frames=round(8 * fps), fps=fps)
        noise = np.random.default_rng(0).normal(0.0, 0.02, (len(motion), 63))
        return cost_of(
            motion.poses + np.pad(noise, ((0, 0), (3, 0))),
            [0.0] * len(motion),
            1.0,
            fps=fps,
        ).motion

    assert [jitter(60.0), jitter(120.0)] == pytest.approx([jitter(30.0)] * 2, rel=0.15)


def test_the_typical_speed_is_that_of_the_training_motions() -> None:
    joints = SKELETON.joints(WALK.poses)
    steps = 30.0 * np.diff(joints - joints[:, :1], axis=0)
    assert typical_speed([WALK]) == pytest.approx(
        np.sqrt((steps**2).sum(axis=2).mean())
    )
    fast = built_in.motion("walk", frames=120, fps=120.0)
    assert typical_speed([fast]) == pytest.approx(typical_speed([WALK]), rel=0.1)
    still = Motion("still", SKELETON, np.zeros((9, 66)), np.zeros((9, 3)), 30.0)
    assert typical_speed([still]) == MIN_TYPICAL_SPEED
    assert typical_speed([still.frames(0, 1)]) == typical_speed([]) == WALKING_SPEED


def guesses(
    count: int, view_degrees: float, yaw: float | None = None, pose_known: bool = False
) -> tuple[Task, list[tuple[str, Task]]]:
    """Return a task, and the guesses of `count` hypotheses after the first."""
    scene = walk(30, [view_degrees], (120, 90))
    task = Task(scene.body, scene.cameras, 400, scene.yaw, scene.anchor)
    first = replace(
        frames_of(WALK.poses[:1], [1.0])[0], translation=WALK.translations[0]
    )
    return task, [
        initial_guess(number, task, yaw, pose_known, first)
        for number in range(1, count + 1)
    ]


def test_hypotheses_begin_with_symmetric_poses_and_new_searches() -> None:
    task, named = guesses(8, 90.0)
    assert [name for name, _ in named[:3]] == ["mirrored", "reflected", SEARCHED_AGAIN]
    assert {name for name, _ in named} == {*GUESSES}
    mirror = mirrored_poses(SKELETON, WALK.poses[:1])[0]
    guess = named[0][1]
    assert guess.yaw == mirror[0]
    np.testing.assert_array_equal(guess.first_pose, mirror[3:])
    np.testing.assert_array_equal(guess.anchor, WALK.translations[0])
    assert [guess is task for _, guess in named] == [
        name == SEARCHED_AGAIN for name, _ in named
    ]


def test_guesses_do_not_contradict_what_is_known() -> None:
    yaw = float(WALK.poses[0, 0])
    from_front = {name for name, _ in guesses(12, 0.0, yaw)[1]}
    assert from_front == {
        "mirrored",
        "legs exchanged",
        "arms exchanged",
        SEARCHED_AGAIN,
    }
    # a person who faces across stays so
    assert "reflected" in [name for name, _ in guesses(12, 90.0, yaw)[1]]
    task, given = guesses(5, 90.0, yaw, True)
    assert given == [(SEARCHED_AGAIN, task)] * 5


@each(
    "method",
    [
        {},
        {"method": "vsmm"},
        {"method": "exemplars", "evaluations": 800},
        {"method": "annealed"},
    ],
)
def test_the_evaluations_of_all_hypotheses_are_counted(method: dict[str, Any]) -> None:
    drawn = PoseCount()
    options = {**QUICK, **method}
    with drawn.counting():
        track = posefit.track("walk", hypotheses=3, view_degrees=90.0, **options)
    single = posefit.track("walk", view_degrees=90.0, **options)
    summary = track.summary
    hypotheses = track.summary["hypotheses"]
    assert summary["warnings"] == []
    assert summary["evaluations"] == track.table["evaluations"].sum()
    # small pictures count by their share of the pixels: each frame is rounded
    rounded = 3 * len(track)
    assert summary["evaluations"] == pytest.approx(drawn.poses, abs=rounded)
    assert summary["evaluations"] > 2 * single.summary["evaluations"]
    assert summary["evaluations_per_frame"] == options["evaluations"]
    totals = [hypothesis["cost"] + hypothesis["motion"] for hypothesis in hypotheses]
    assert [hypothesis["kept"] for hypothesis in hypotheses] == [
        k == np.argmin(totals) for k in range(3)
    ]
    assert hypotheses[int(np.argmin(totals))]["cost"] == pytest.approx(summary["cost"])
    # the first is the track without others
    assert hypotheses[0]["cost"] == pytest.approx(single.summary["cost"])
    assert single.summary["hypotheses"] == []


def test_interrupted_hypotheses_continue_at_the_last_frame(tmp_path: Path) -> None:
    options: dict[str, Any] = {
        "hypotheses": 3,
        "seed": 1,
        "view_degrees": 90.0,
        **QUICK,
    }
    whole = posefit.track("walk", **options)
    names = ("searched", "mirrored", "reflected")
    for after in [1, 3, 4, 7]:
        written: dict[str, Any] = {**options, "out": tmp_path / f"walk-{after}"}
        with pytest.raises(KeyboardInterrupt):
            posefit.track("walk", progress=stopping(after), **written)
        with pytest.raises(
            ValueError, match="hypotheses must be 3, as before, to resume, got 2"
        ):
            posefit.track("walk", resume=True, **{**written, "hypotheses": 2})
        log: list[str] = []
        resumed = posefit.track(
            "walk", resume=True, progress=Progress(log.append), **written
        )
        done, frames = divmod(after, 3)
        new = [f"track {k + 1} of 3: {names[k]}" for k in range(-(-after // 3), 3)]
        assert [line for line in log if line.startswith("track ")] == new
        going_on = (
            [
                f"continuing from frame {frames} of 3 of track {done + 1} of 3, {names[done]}"
            ]
            if frames
            else []
        )
        assert [line for line in log if line.startswith("continuing")] == going_on
        costs = [
            [row["cost"] for row in track.summary["hypotheses"]]
            for track in (whole, resumed)
        ]
        assert len(costs[1]) == 3
        assert costs[0][:done] == costs[1][:done]
        assert resumed.summary["evaluations"] == whole.summary["evaluations"]


# frames
WALKS = len(WALK)
GAP = 12
AFTER = slice(WALKS + GAP, None)
MIDDLE = WALK.translations.mean(axis=0) * [1.0, 0.0, 1.0]
SIDE = Camera.around(
    MIDDLE + [0.0, WALK.translations[0, 1], 0.0], np.pi / 2.0, 5.0, (160, 120)
)


@cache
def footage(comes: str) -> tuple[Array, Array]:
    """Return masks and true yaws of a walk, a gap, and the same walk again: `on`, or `back` the other way."""
    body = Body.of(WALK.skeleton)
    poses = WALK.poses
    places = WALK.translations
    turned = poses.copy()
    there = places.copy()
    if comes == "back":
        turned[:, 0] += np.pi
        there = 2.0 * MIDDLE + places * [-1.0, 1.0, -1.0]
    walks = [(poses, places), (turned, there)]
    first, second = (
        np.array([project(body, SIDE, *pose) for pose in zip(*walk, strict=True)])
        for walk in walks
    )
    yaws = np.concatenate([poses[:, 0], np.full(GAP, np.nan), turned[:, 0]])
    return np.concatenate(
        [first, np.zeros((GAP, *first.shape[1:]), dtype=bool), second]
    ), yaws


def tracked(folder: Path, comes: str, **options: Any) -> tuple[posefit.Track, Array]:
    """Return a track of the footage, and in which frames it faces as the walker does."""
    masks, yaws = footage(comes)
    np.savez(folder / "masks.npz", masks=masks)
    stature = Body.of(WALK.skeleton).stature
    defaults = {
        "camera": SIDE,
        "method": "@loose",
        "body_frames": 0,
        "evaluations": 840,
        "height": stature,
    }
    track = posefit.track(folder / "masks.npz", **{**defaults, **options})
    return track, np.cos(track.motion.poses[:, 0] - yaws) > 0.0


@each("optimiser", ["sapso", "annealed"])
def test_a_relocalised_frame_has_the_effort_of_all_restarts(
    tmp_path: Path, optimiser: str
) -> None:
    track, right = tracked(tmp_path, "back", method=optimiser)
    assert right[:WALKS].all()
    assert right[AFTER].mean() > 0.95
    assert track.summary["relocalised"] == [WALKS + GAP]
    assert track.summary["backwards_share"] == 0.0
    evaluations = [frame.evaluations for frame in track.frames]
    # one to eight modes and the track as it was, ten frames each, and the frame itself
    assert 20 * 840 < evaluations.pop(WALKS + GAP) <= 91 * 840
    assert max(evaluations) <= 840


def test_without_relocalisation_the_person_is_tracked_backwards_with_a_warning(
    tmp_path: Path,
) -> None:
    track, right = tracked(tmp_path, "back", settings={"tracker.relocalise_gap": 0})
    assert not right[AFTER].any()
    assert track.summary["relocalised"] == []
    assert track.summary["backwards_share"] > 0.1
    (warning,) = [
        warning for warning in track.summary["warnings"] if "backwards" in warning
    ]
    assert warning.startswith("the person seems to walk backwards in 14 of 72 frames")


GAP_TASK = Task(Body.of(WALK.skeleton), [SIDE], 10, 0.0, MIDDLE, fps=10.0)
VISIBLE = Observation([Silhouette.of(footage("on")[0][0])])
GONE = Observation([Silhouette.of(footage("on")[0][WALKS])], usable=False)


class PlannedCosts:
    """Follows at planned costs: of the track as it is, and of a restart."""

    def __init__(self, costs: Sequence[float], restart: float) -> None:
        self._costs = iter(costs)
        self._restart = restart
        self.tasks: list[Task] = []

    def __call__(
        self, task: Task, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        self.tasks.append(task)
        for observation in observations:
            trial = task.yaw is None or task.fps != GAP_TASK.fps
            cost = (
                (self._restart if task.yaw is None else 10.0)
                if trial
                else next(self._costs)
            )
            pose = np.full(66, rng.random())
            evaluations = int(observation.usable)
            yield Frame(pose, MIDDLE, cost, np.zeros((1, 3), np.int64), evaluations)


def restarts_of(
    follow: PlannedCosts, observations: Sequence[Observation], task: Task = GAP_TASK
) -> list[tuple[int, bool]]:
    """Return in which frames a tracker made restarts, and whether one of them was better."""
    frames = list(relocalised(task, follow, observations, np.random.default_rng(0), 5))
    assert len(frames) == len(observations)
    return [
        (k, frame.details["relocalised"])
        for k, frame in enumerate(frames)
        if frame.details
    ]


@each(
    ("before", "gap", "expected"),
    [(3, 4, []), (3, 5, [(8, True)]), (3, 9, [(12, True)]), (0, 9, [])],
)
def test_a_gap_is_five_frames_after_one_with_the_person(
    before: int, gap: int, expected: list[Any]
) -> None:
    assert (
        restarts_of(
            PlannedCosts([1.0] * 30, 5.0),
            [VISIBLE] * before + [GONE] * gap + [VISIBLE] * 10,
        )
        == expected
    )


def test_restarts_that_are_not_better_change_nothing() -> None:
    clip = [VISIBLE] * 3 + [GONE] * 5 + [VISIBLE] * 10
    follow = PlannedCosts([1.0] * 30, 20.0)
    assert restarts_of(follow, clip) == [(8, False)]
    assert len(follow.tasks) == 1 + 8 + 1  # the track itself is not begun again
    plain = list(
        PlannedCosts([1.0] * 30, 20.0)(GAP_TASK, clip, np.random.default_rng(0))
    )
    again = relocalised(
        GAP_TASK, PlannedCosts([1.0] * 30, 20.0), clip, np.random.default_rng(0), 5
    )
    np.testing.assert_array_equal(
        [frame.pose for frame in again], [frame.pose for frame in plain]
    )


TYPICAL = [2.0] * 10
HIGH = [3.1] * 5
LOWER = [2.9] * 5


@each(
    ("costs", "expected"),
    [
        ([*TYPICAL, *HIGH, *TYPICAL], [(15, True)]),
        ([*TYPICAL, *HIGH[:4], *TYPICAL], []),
        ([*TYPICAL, *LOWER, *TYPICAL], []),
        ([*TYPICAL[:9], *HIGH, *TYPICAL], []),  # one second has to show what is typical
        ([*TYPICAL, *HIGH, *HIGH, *HIGH, *HIGH], [(15, True)]),  # which is then typical
    ],
)
def test_costs_high_for_half_a_second_lead_to_restarts(
    costs: list[float], expected: list[tuple[int, bool]]
) -> None:
    assert restarts_of(PlannedCosts(costs, 5.0), [VISIBLE] * len(costs)) == expected


@each(("earlier", "expected"), [(8, [(0, True)]), (7, [])])
def test_a_resumed_track_remembers_its_gap(
    earlier: int, expected: list[tuple[int, bool]]
) -> None:
    clip = ([VISIBLE] * 3 + [GONE] * 5)[:earlier]
    before = tuple(
        PlannedCosts([1.0] * 9, 5.0)(GAP_TASK, clip, np.random.default_rng(0))
    )
    assert (
        restarts_of(
            PlannedCosts([1.0] * 9, 5.0),
            [VISIBLE] * 4,
            replace(GAP_TASK, before=before),
        )
        == expected
    )


FPS = 30.0
# at z = 6 on the z axis: a person of yaw 0 faces it, and yaw t and 180 - t are reflections of each other
CAMERA = Camera.around(np.array([0.0, 1.0, 0.0]), 0.0, 6.0, (16, 12))
PLACE = np.array([0.0, 1.0, 0.0])
SPIN_TASK = Task(
    Body.of(WALK.skeleton), [CAMERA], 100, None, PLACE, "aligned", FPS, [WALK]
)
OBSERVATIONS = [
    Observation([Silhouette.of(np.ones((12, 16), dtype=bool))]) for _ in range(28)
]
SPINNING = [150.0] * 8 + [30.0] * 20  # degrees of yaw


def frame(degrees: float, cost: float = 1.0, cameras: int = 1, **more: Any) -> Frame:
    pose = WALK.poses[0].copy()
    pose[0] = np.radians(degrees)
    areas = np.array([[5, 5, 5]] * cameras + [[0, 0, 0]] * (2 - cameras))
    return Frame(pose, PLACE, cost, areas, 10, **more)


def frames_facing(degrees: Sequence[float], cameras: int = 1) -> list[Frame]:
    return [frame(yaw, cameras=cameras) for yaw in degrees]


def consensus(frames: Sequence[Frame], visible: bool = True) -> list[bool]:
    return facing_consensus(
        frames, [CAMERA, CAMERA], np.full(len(frames), visible), FPS
    ).tolist()


@each(
    ("frames", "agrees"),
    [
        # frames of the spin itself have no vote
        (frames_facing(SPINNING), [False] * 11 + [True] * 17),
        (
            frames_facing([30.0] * 10 + [150.0] * 8 + [30.0] * 10),
            [True] * 7 + [False] * 14 + [True] * 7,
        ),
        # a real turn
        (
            frames_facing([0.0] * 5 + [*np.linspace(0.0, 180.0, 30)] + [180.0] * 5),
            [True] * 40,
        ),
    ],
)
def test_most_frames_decide_which_way_the_person_faces(
    frames: list[Frame], agrees: list[bool]
) -> None:
    assert consensus(frames) == agrees


def test_a_frame_has_a_vote_for_each_camera_that_sees_the_person() -> None:
    agrees = consensus(
        [*frames_facing([150.0] * 12, cameras=2), *frames_facing([30.0] * 18)]
    )
    assert all(agrees[:9])
    assert not any(agrees[9:])
    assert consensus(frames_facing([0.0] * 4), visible=False) == [False] * 4


def posterior(offset: float) -> Posterior:
    poses = np.repeat(WALK.poses[:1], 2, axis=0)
    poses[:, 10] += [offset, -offset]
    return Posterior(
        poses,
        np.array([[offset, 0.0, 0.0], [-offset, 0.0, 0.0]]),
        np.ones(2),
        coherent=True,
    )


def test_a_track_that_spins_is_tracked_again_outside_its_longest_run_without_spins() -> (
    None
):
    degrees = [150.0] * 5 + [30.0] * 18 + [150.0] * 5
    frames = [frame(yaw, posterior=posterior(0.2)) for yaw in degrees]
    calls = list[tuple[Task, list[int]]]()

    def follow(
        task: Task, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        rows = rows_of(observations, OBSERVATIONS)
        calls.append((task, rows))
        for row in rows:
            yield frame(
                30.0 + 0.1 * row, posterior=posterior(0.2 if rows[-1] else -0.2)
            )

    retracked, _, kept_run = retrack_spins(
        SPIN_TASK, OBSERVATIONS, Tracked(frames, []), follow, 0
    )
    assert kept_run == (8, 19)  # frames of a spin have no vote
    new = [30.0 if 8 <= k <= 19 else 30.0 + 0.1 * k for k in range(28)]
    assert [np.degrees(f.pose[0]) for f in retracked] == pytest.approx(new)
    (onward, ahead), (back, behind) = calls
    assert (ahead, behind) == (list(range(19, 28)), list(range(8, -1, -1)))
    assert onward.fastest_turn == back.fastest_turn == MAX_TURN_RATE
    assert np.degrees(onward.yaw or 0.0) == pytest.approx(30.0)
    np.testing.assert_array_equal(back.training[0].poses, WALK.poses[::-1])
    assert [f.evaluations for f in retracked] == [
        10 if 8 <= k <= 19 else 20 for k in range(28)
    ]
    # a trajectory goes on as the nearest one on either side: the first of these is the other's second
    places = [
        f.posterior.translations[0, 0] for f in retracked if f.posterior is not None
    ]
    np.testing.assert_allclose(places, 0.2)


@each(
    ("degrees", "again", "cost", "tried"),
    [
        (SPINNING, SPINNING, 1.0, True),  # it spins as often
        (SPINNING, [30.0] * 28, 2.6, True),  # it costs too much
        ([30.0] * 28, None, 1.0, False),  # there is no spin
    ],
)
def test_a_track_that_gets_no_better_stays(
    degrees: list[float], again: list[float], cost: float, tried: bool
) -> None:
    calls = list[list[int]]()

    def follow(
        task: Task, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        calls.append(rows_of(observations, OBSERVATIONS))
        for row in calls[-1]:
            yield frame(again[row], cost)

    frames = frames_facing(degrees)
    kept, _, kept_run = retrack_spins(
        SPIN_TASK, OBSERVATIONS, Tracked(frames, []), follow, 0
    )
    assert kept_run is None
    assert [f.pose[0] for f in kept] == [f.pose[0] for f in frames]
    # nothing comes after what stays
    assert calls == ([list(range(11, -1, -1))] if tried else [])
    assert [f.evaluations for f in kept] == [
        20 if tried and k < 11 else 10 for k in range(28)
    ]


@each(("number", "backwards"), [(1, True), (2, False)])
def test_a_track_is_repeated_backwards_and_then_forwards_from_the_earlier_pass(
    number: int, backwards: bool
) -> None:
    frames = frames_facing(np.arange(28.0).tolist())

    def follow(
        task: Task, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        assert task.backwards == backwards
        assert task.yaw == frames[27 if backwards else 0].pose[0]
        for observation in observations:
            assert observation.estimate is not None
            yield frame(np.degrees(observation.estimate[0][0]) + 0.5)

    again = tracked_again(SPIN_TASK, OBSERVATIONS, frames, follow, number, 0)
    assert [np.degrees(f.pose[0]) for f in again] == pytest.approx(
        np.arange(28.0) + 0.5
    )


@each("begins_right", [True, False])
def test_the_cheapest_pass_is_kept_with_the_effort_of_all(begins_right: bool) -> None:
    known = walk(6, (0.0, 90.0), (120, 90))
    scene = replace(known, truth=None)
    right = exact_frames(known)
    wrong = [
        replace(each, pose=each.pose + np.radians(20.0) * SKELETON.free)
        for each in right
    ]
    first, other = (right, wrong) if begins_right else (wrong, right)

    def follow(
        task: Task, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        assert [each.estimate is None for each in observations] == [False] * 6
        yield from other[::-1]  # back in time

    method: Any = SimpleNamespace(follow=follow, audit=SimpleNamespace(beta=0.5))
    began, best = (smooth(scene, frames, None, 0.5) for frames in (first, right))
    tracked, (_, frames, _) = _cheapest_pass(
        SPIN_TASK, method, Tracked(first, []), began, PoseCount(), 2, 0, Progress()
    )
    assert list(tracked.frames) == right
    np.testing.assert_array_equal(
        [each.pose for each in frames], [each.pose for each in best[1]]
    )
    assert [each.evaluations for each in frames] == [2] * 6


def test_footage_is_tracked_from_the_first_frame_that_shows_the_whole_person_first_back_and_then_on() -> (
    None
):
    calls = list[tuple[Task, list[int]]]()
    whole = np.zeros((12, 16), dtype=bool)
    whole[3:9, 6:9] = True
    # a full picture is cut
    shown = [
        *OBSERVATIONS[:5],
        *(Observation([Silhouette.of(whole)]) for _ in range(5)),
    ]
    scene = replace(walk(10), truth=None, observations=shown, count=10)

    def follow(
        task: Task, observations: Iterable[Observation], rng: np.random.Generator
    ) -> Iterator[Frame]:
        rows = rows_of(observations, shown)
        calls.append((task, rows))
        yield from (frame(float(row), posterior=posterior(0.1)) for row in rows)

    method: Any = SimpleNamespace(looks_ahead=True, relocalise_gap=0, follow=follow)
    frames = track_hypotheses(
        scene, SPIN_TASK, method, TrackOptions(hypotheses=2), Recorder(), Progress()
    )[0].frames
    (back, behind), (onward, ahead), (again, _), _ = calls
    assert (behind, ahead) == ([5, 4, 3, 2, 1, 0], [5, 6, 7, 8, 9])
    assert back.backwards
    np.testing.assert_array_equal(back.training[0].poses, WALK.poses[::-1])
    # it goes on from where the track back began
    assert np.degrees(onward.yaw or 0.0) == pytest.approx(5.0)
    assert [np.degrees(f.pose[0]) for f in frames] == pytest.approx(range(10))
    # the frame in the middle is searched twice
    assert [f.evaluations for f in frames] == [10] * 5 + [20] + [10] * 4
    # a guess is of the frame it is for
    assert again.yaw == initial_guess(1, SPIN_TASK, None, False, frames[5])[1].yaw
    calls.clear()
    track_hypotheses(
        scene,
        replace(SPIN_TASK, yaw=0.5),
        method,
        TrackOptions(),
        Recorder(),
        Progress(),
    )
    # what is known of the first frame is kept
    assert [rows for _, rows in calls] == [list(range(10))]
