"""Two people who cross: one is followed through, and the other is unknown, not background."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posefit
from posefit.footage.extraction import Extraction
from posefit.footage.people import People, _distance, person_indices, planes_of
from posefit.footage.segmentation import Segmentation
from posefit.footage.video import Video
from posefit.geometry.skeleton import JOINTS
from posefit.motion import built_in
from posefit.silhouette.cost import project
from posefit.silhouette.pieces import people_in
from tests.cases import each
from tests.footage.conftest import EMPTY, NOBODY, film, iou

SIZE = (160, 120)
FRAMES = 60
WALKS = ("walk", "walk-a", "walk-b", "walk-c")


def crossing(seed: int) -> Iterator[tuple[Any, list[Any], Any]]:
    """Yield of each frame a picture, and what shows of each of two people who cross, the first as the nearer one."""
    rng = np.random.default_rng(seed)
    camera = posefit.Camera.around(np.array([0.0, 1.0, 0.0]), np.pi / 2, 5.5, SIZE)
    colours = rng.uniform(10.0, 90.0, (2, 3))
    ways = [1.0, -1.0]
    motions = []
    for way, depth in zip(ways, (rng.uniform(0.3, 0.8), 0.0), strict=True):
        motion = built_in.motion(str(rng.choice(WALKS)), frames=FRAMES)
        places = motion.translations.copy()
        poses = motion.poses.copy()
        places[:, 0] = depth
        places[:, 2] = way * rng.uniform(0.8, 1.1) * np.linspace(
            -1.2, 1.2, FRAMES
        ) + rng.uniform(-0.2, 0.2)
        poses[:, 0] += 0.0 if way > 0.0 else np.pi
        motions.append(replace(motion, poses=poses, translations=places))
    bodies = [posefit.Body.of(motion.skeleton) for motion in motions]
    for k in range(FRAMES):
        near, far = (
            project(body, camera, motion.poses[k], motion.translations[k])
            for body, motion in zip(bodies, motions, strict=True)
        )
        image = np.full((*near.shape, 3), 160, dtype=np.uint8)
        image[far], image[near] = colours[1], colours[0]
        yield image, [near, far & ~near], near | far


@each("asked", [False, True])
def test_specks_are_not_a_person(asked: bool) -> None:
    mask = np.zeros((240, 320), dtype=bool)
    mask[60:180, 20:45] = True  # 3,000 pixels
    for k in range(28):  # 3,640 in all, each too small to be a part of a person
        mask[10 + 30 * (k // 4) : 20 + 30 * (k // 4), 120 + 40 * (k % 4) :][:, :13] = (
            True
        )
    (person,) = people_in(mask, np.ones_like(mask) if asked else None)
    assert person.mask.sum() == 3000


@each("seed", range(10))
def test_of_two_people_who_cross_one_is_followed_and_the_others_pixels_are_unknown(
    seed: int,
) -> None:
    people = People(30.0)
    true = []
    for image, shown, together in crossing(seed):
        blobs = people_in(together, np.ones_like(together))
        people.add([blob.mask for blob in blobs], image)
        true.append(shown)
    followed, other = people.persons()
    shares = []
    for k, shown in enumerate(true):
        mask, valid = planes_of(followed, other, k, np.ones(SIZE[::-1], dtype=bool))
        shares.append(
            [float((mask & part).sum()) / max(1, mask.sum()) for part in shown]
        )
        outside = ~(shown[0] | shown[1])
        assert valid[outside].all()
        assert not mask[outside].any()
    which = int(np.mean(shares, axis=0).argmax())
    wrong = [k for k, pair in enumerate(shares) if pair[1 - which] > pair[which]]
    assert len(wrong) <= 0.02 * FRAMES
    assert np.mean(shares, axis=0)[1 - which] < 0.05


@each("scale", [1.0, 2.0])
def test_a_place_chooses_who_is_nearest_across_and_down(scale: float) -> None:
    middles = {(40, 60): "left", (140, 50): "right", (140, 120): "below"}
    image = np.full((170, 180, 3), 160, dtype=np.uint8)
    masks = []
    for across, down in middles:
        mask = np.zeros(image.shape[:2], dtype=bool)
        mask[down - 20 : down + 20, across - 7 : across + 7] = True
        masks.append(mask)
    people = People(30.0)
    for _ in range(20):
        people.add(masks, image)
    for across, down in middles:
        near = scale * (across + 12.0), scale * (down - 12.0)
        parts, sentence = people.chosen(near, str, scale)
        shown = parts[0].first[1:]
        assert np.hypot(shown[0] - across, shown[1] - down) < 3.0
        assert f"{scale * shown[0]:.0f},{scale * shown[1]:.0f}" in sentence


@cache
def pairs() -> list[list[Any]]:
    """Return what is visible of each of two people in every frame of a film, which is empty first."""
    return [[NOBODY] * 2] * EMPTY + [pair for _, pair, _ in crossing(0)]


class GoesOver:
    """Shows the first of `pairs`, from a frame on the second, whatever is in the picture."""

    over = EMPTY + 20

    def __init__(self, footage: object) -> None:
        self.pairs, self.landmarks, self.facing = (
            enumerate(pairs()),
            np.ones((len(JOINTS), 3)),
            0.5,
        )

    def segment(self, image: Any) -> tuple[Any, Any]:
        k, pair = next(self.pairs)
        return pair[k >= self.over], NOBODY


class Prefers(GoesOver):
    """Shows who wears green, wherever they are in the picture, and else who wears red."""

    over = 0

    def segment(self, image: Any) -> tuple[Any, Any]:
        _, green, red = np.moveaxis(image.astype(int), -1, 0)
        dark = image.max(axis=2) < 140
        worn = [dark & (red > green + 40), dark & (green > red + 40)]
        return worn[int(worn[1].sum() > 50)], NOBODY


@each("factory", [GoesOver, Prefers])
@pytest.mark.parametrize(("person", "followed"), [(1, 0), (2, 1), (None, None)])
def test_a_segmenter_of_one_person_is_used_if_it_shows_the_chosen_person(
    tmp_path: Path,
    segmenter: Callable[..., None],
    factory: Any,
    person: int | None,
    followed: int | None,
) -> None:
    if followed is None:  # the first, unless the segmenter shows mostly the second
        followed = int(factory is GoesOver)
    video = Video.of(film(tmp_path / "two.avi", *zip(*pairs(), strict=True)))
    frames = np.arange(len(pairs()))
    segmenter("one", factory, still_background=False)
    alone = Extraction("one", person=person)
    among = Extraction(background=f"0:{EMPTY}", person=person)
    masks, *_ = Segmentation(video, alone, (None, None), among).read()
    shares = np.array(
        [
            [iou(masks.silhouette(k).mask, each) for each in pair]
            for k, pair in enumerate(pairs())
        ]
    )
    assert (
        shares[masks.usable, followed] < shares[masks.usable, 1 - followed]
    ).mean() <= 0.02
    assert masks.landmarks is not None
    given = masks.landmarks[:, 0, 2] > 0.0
    right = frames >= EMPTY
    if factory is GoesOver:
        right &= (frames >= GoesOver.over) == followed
    assert not given[~right].any()
    assert given[right].mean() > 0.6  # but for the meeting
    assert np.median(shares[given, followed]) > 0.8


def test_the_person_of_a_mask_is_the_one_it_covers_or_else_the_previous_one() -> None:
    people = People(30.0)
    sides = np.zeros((3, *SIZE[::-1]), dtype=bool)
    sides[0, 20:100, 20:50] = sides[1, 30:100, 115:145] = sides[2, 20:100, 70:90] = True
    left, right, beside = sides
    for k in range(12):
        people.add([right] if k in (0, 2) else [left] if k == 5 else [left, right])
    masks = [
        beside,
        left,
        beside,
        right,
        left | right,
        beside,
        np.zeros_like(left),
        right | beside,
        beside,
    ]
    # the last one shows somebody else: the one before is elsewhere
    assert person_indices(people.persons(), masks) == [
        0,
        0,
        0,
        1,
        None,
        1,
        None,
        1,
        None,
    ]
    assert person_indices(people.persons(), [beside] * 2) == [None] * 2
    # they are parts of one
    assert (
        person_indices(people.persons(), [left, left | right, left | right])
        == [None] * 3
    )


def test_parts_that_take_turns_are_no_time_apart() -> None:
    people = People(30.0)
    sides = np.zeros((2, *SIZE[::-1]), dtype=bool)
    sides[0, 20:100, 20:50] = sides[1, 20:100, 115:145] = True
    # the other part begins in frame 2, thirty frames before the first one ends
    for k in range(50):
        people.add([sides[int(k % 3 == 2 if k < 32 else k > 32)]])
    assert [len(person) for person in people.persons()] == [2]


def test_a_gap_counts_by_its_seconds_and_not_by_its_frames() -> None:
    before, after = np.zeros((2, *SIZE[::-1]), dtype=bool)
    before[20:100, 20:50] = after[20:100, 115:145] = True
    distances = list[float]()
    for fps in (10, 20):
        people = People(float(fps))
        for second in range(5):
            shown = {0: [before], 4: [after]}.get(second, [])
            for _ in range(fps):
                people.add(shown)
        first, second_part = people.tracklets
        distances.append(_distance(first, second_part, float(fps)))
    assert distances[0] == pytest.approx(distances[1], rel=0.02)


def test_memory_of_noise_is_given_back() -> None:
    people = People(10.0)
    rng = np.random.default_rng(0)
    for _ in range(60):
        mask = np.zeros((60, 80), dtype=bool)
        row = rng.integers(0, 50)
        column = rng.integers(0, 70)
        mask[row : row + 6, column : column + 4] = True
        people.add([mask])
    assert len(people.tracklets) > 20
    assert len(people.active) < 20
    assert sum(tracklet.latest.mask.size > 0 for tracklet in people.tracklets) == len(
        people.active
    )
    assert people.chosen(None, str)[1] == ""
