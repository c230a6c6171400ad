"""`posefit track --live`: streams of images, the person in them, and their poses."""

import io
import json
import os
import subprocess
import sys
import threading
import time
from contextlib import suppress

import cv2
import numpy as np
import pytest
from click.testing import CliRunner

from posefit.cli import main
from posefit.errors import InputError
from posefit.fitting.synthesis import SynthesisTracker
from posefit.footage import live
from posefit.footage.extraction import Extraction
from posefit.footage.live import Stream, live_views, netpbm_images
from posefit.geometry.body import Body
from posefit.geometry.calibration import Calibration
from posefit.geometry.camera import Camera
from posefit.geometry.skeleton import JOINTS
from posefit.motion import built_in
from posefit.motion.bvh import write_bvh
from posefit.progress import Progress
from posefit.silhouette.cost import project
from posefit.tracking import live as tracking_live
from posefit.tracking.live import track_live, write_live
from tests.cases import each
from tests.files import arrays

QUICK = {"evaluations": 200, "restarts": 2, "view_degrees": 45.0}
PINHOLE = np.array([[165.0, 0.0, 79.5], [0.0, 165.0, 59.5], [0.0, 0.0, 1.0]])


def pgm(mask):
    return (
        b"P5\n# a comment\n%d %d\n255\n" % mask.shape[::-1]
        + (255 * mask.astype(np.uint8)).tobytes()
    )


@pytest.fixture(scope="module")
def walk():
    """Masks (40, 120, 160) of a walk."""
    motion = built_in.motion("walk")
    body = Body.of(motion.skeleton)
    place = motion.translations[0]
    camera = Camera.around(place, azimuth=0.8, distance=3.5, size=(160, 120))
    return [
        project(body, camera, motion.poses[k % len(motion)], place) for k in range(40)
    ]


@pytest.fixture
def every_frame(monkeypatch):
    """Make streams wait until the latest frame was taken, so that none is skipped."""
    taken = threading.Semaphore(1)
    iterate = Stream.__iter__
    read = Stream._read

    def iterating(self):
        for image in iterate(self):
            taken.release()
            yield image

    def paced(frames):
        for frame in frames:
            taken.acquire()
            yield frame

    monkeypatch.setattr(Stream, "__iter__", iterating)
    monkeypatch.setattr(Stream, "_read", lambda self, frames: read(self, paced(frames)))


def test_images_are_read_one_after_another():
    grey = np.arange(6, dtype=np.uint8).reshape(2, 3)
    colour = np.arange(18, dtype=np.uint8).reshape(2, 3, 3)
    content = (
        b"P5 3 2 255\n" + grey.tobytes() + b"P6\n#a\n3\n2\n255 " + colour.tobytes()
    )
    images = list(netpbm_images(io.BytesIO(content)))
    np.testing.assert_array_equal(images[0], grey)
    np.testing.assert_array_equal(images[1], colour[..., ::-1])


@each(
    "content, expected",
    [
        (b"GIF89a", "binary PGM or PPM"),
        (b"P5 3 2 65535\n" + bytes(12), "255 levels"),
        (b"P5 99999 99999 255\n", "million pixels"),
        (b"P5 3 2 255\n" + bytes(5), "the last image is incomplete"),
    ],
)
def test_damaged_images_are_refused(content, expected):
    with pytest.raises(InputError, match=expected):
        list(netpbm_images(io.BytesIO(content)))


def test_only_the_newest_frame_is_kept(walk):
    stream = Stream("-", io.BytesIO(b"".join(map(pgm, walk))))
    while stream.count < len(walk):
        time.sleep(0.001)
    images = list(stream)
    assert [image.number for image in images] == [39]
    assert stream.count == 40


def test_a_stalled_stream_ends_with_one_line(monkeypatch):
    monkeypatch.setattr(live, "STALL_SECONDS", 0.05)
    reading, writing = os.pipe()
    with (
        open(reading, "rb", buffering=0) as pipe,
        pytest.raises(InputError, match="-: no frame arrived"),
    ):
        next(iter(Stream("-", pipe)))
    os.close(writing)


@each("given", [False, True])
def test_the_background_is_that_of_the_first_frames_or_a_picture(
    given, every_frame, tmp_path
):
    empty = np.random.default_rng(0).integers(60, 90, (120, 160, 3), dtype=np.uint8)
    person = empty.copy()
    person[30:100, 70:95] = 220
    cv2.imwrite(str(tmp_path / "empty.png"), empty)
    before = 1 if given else 90
    ppm = [
        b"P6 160 120 255\n" + image.tobytes()
        for image in [*[empty] * before, *[person] * 3]
    ]
    extraction = Extraction(background=str(tmp_path / "empty.png")) if given else None
    masks = list(
        live_views(Stream("-", io.BytesIO(b"".join(ppm))), extraction, lambda _: None)
    )
    assert (
        [int(view.numbers[0]) for view in masks] == [0, 1, 2, 3]
        if given
        else [90, 91, 92]
    )
    mask = masks[-1].silhouette(0).mask
    true = (person != empty).any(axis=2)
    assert (mask & true).sum() > 0.95 * max(mask.sum(), true.sum())


class Marked:
    """Gives a landmark beside what is bright."""

    def __init__(self):
        self.landmarks = np.zeros((len(JOINTS), 3))

    def segment(self, image):
        self.landmarks[0] = [5.0, 7.0, 0.5]
        mask = image[..., 0] > 127
        return mask, np.zeros_like(mask)


def test_a_method_gets_the_landmarks_of_a_segmenter_also_through_a_lens(
    monkeypatch, every_frame, walk
):
    observed = []
    follow = SynthesisTracker.track

    def noted(observation):
        observed.append(observation.landmarks)
        return observation

    monkeypatch.setattr(Extraction, "segmenter", lambda _how, _film: Marked())
    monkeypatch.setattr(
        SynthesisTracker,
        "track",
        lambda self, frames, rng: follow(self, map(noted, frames), rng),
    )
    raised = np.roll(walk, -5, axis=1)  # off the picture's lower border
    ppm = b"".join(
        b"P6 160 120 255\n" + np.repeat(255 * mask.astype(np.uint8), 3).tobytes()
        for mask in raised
    )
    lens = Calibration(
        "lens", (160, 120), PINHOLE, np.array([-0.2, 0.0, 0.0, 0.0]), None, None
    )
    for camera in ((), (lens,)):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(ppm)))
        observed.clear()
        assert len(
            list(track_live(**QUICK, extraction=Extraction("mixture"), camera=camera))
        ) == len(walk)
        point = (
            [[5.0, 7.0, 0.5]]
            if not camera
            else lens.straightened(np.array([[5.0, 7.0, 0.5]]), (160, 120))
        )
        for landmarks in observed:
            np.testing.assert_allclose(landmarks[0, :1], point)
            assert not landmarks[0, 1:, 2].any()


@each("damaged", [0, 5])
def test_masks_in_a_pipe_become_poses_on_disk_also_if_it_breaks_off(
    damaged, monkeypatch, every_frame, walk, tmp_path
):
    content = b"".join(map(pgm, walk))
    count = 39 if damaged else 40
    monkeypatch.setattr(
        sys, "stdin", io.TextIOWrapper(io.BytesIO(content[: len(content) - damaged]))
    )
    out = tmp_path / "out"
    if damaged:
        with pytest.raises(
            InputError, match="the last image is incomplete, after 39 frames"
        ):
            write_live(track_live(**QUICK), out)
    else:
        summary = write_live(track_live(**QUICK), out)
        assert (summary["frames"], summary["skipped"]) == (40, 0)
    rows = [
        json.loads(line) for line in (out / "frames.jsonl").read_text().splitlines()
    ]
    assert [row["frame"] for row in rows] == list(range(count))
    assert np.median([row["cost"] for row in rows]) < 30.0
    stored = arrays(out / "poses.npz")
    assert (stored["poses"].shape, stored["translations"].shape) == (
        (count, 66),
        (count, 3),
    )


def test_a_stream_that_is_stopped_before_the_first_pose_has_no_latency_and_no_folder(
    monkeypatch, tmp_path
):
    def stopped(*_arguments, **_options):
        raise KeyboardInterrupt
        yield

    monkeypatch.setattr(tracking_live, "track_live", stopped)
    out = str(tmp_path / "out")
    result = CliRunner().invoke(main, ["track", "--live", "-", "--out", out])
    assert result.exit_code == 0
    assert "no frame was tracked" in result.output
    assert "nan" not in result.output
    assert list(tmp_path.iterdir()) == []


@each("error", [ValueError("a bad packet"), RuntimeError(), OSError("gone")])
def test_whatever_ends_a_stream_is_said(error):
    image = pgm(np.eye(40, dtype=bool))

    class Pipe(io.BytesIO):
        def read(self, size=-1):
            if self.tell() >= 2 * len(image):
                raise error
            return super().read(size)

    stream = Stream("-", Pipe(3 * image))
    cause = str(error) or type(error).__name__
    with pytest.raises(InputError, match=f"-: {cause}, after 2 frames"):
        list(stream)


def test_guesses_about_a_stream_are_logged_and_the_calibrations_unit_counts(
    monkeypatch, every_frame, walk, tmp_path
):
    write_bvh(
        tmp_path / "walk.bvh",
        built_in.motion("walk-b").turned(np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])),
    )
    stated = Calibration(
        "a",
        (160, 120),
        PINHOLE,
        np.zeros(4),
        np.diag([1.0, -1.0, -1.0]),
        np.array([0.0, 0.0, 30.0]),
    )
    assumed = "30 frames a second"
    person = "a person of 1.74 m"
    for options, guesses in (
        (
            {},
            [
                assumed,
                "a level camera, 40 degrees across: distances and sizes are only as good as this guess",
                person,
            ],
        ),
        (
            {
                "fps": 25.0,
                "height": 1.8,
                "camera": (stated,),
                "unit": "cm",
                "train": (tmp_path / "walk.bvh",),
            },
            ["+y is up in the cameras' world"],
        ),
    ):
        messages = []
        monkeypatch.setattr(
            sys, "stdin", io.TextIOWrapper(io.BytesIO(b"".join(map(pgm, walk[:12]))))
        )
        frames = list(
            track_live(**{**QUICK, **options}, progress=Progress(messages.append))
        )
        assert f"guessed: {'; '.join(guesses)}" in messages
        if options:
            (warning,) = (
                message for message in messages if message.startswith("warning: ")
            )
            # in what is learned from
            assert "z is taken to be up, because the person stands along it" in warning
            # from 30 cm beside the origin, along -z, the person is 165 pixels x 1.8 m / 109 pixels away
            assert -2.9 < frames[0].frame.translation[2] < -1.9


@each(
    "options, expected",
    [
        ({"hypotheses": 2}, "hypotheses must be left out with live, got 2"),
        ({"smooth": True}, "smooth must be left out with live, got True"),
        ({"person": 2}, "person must be left out with live, got 2"),
        (
            {"extraction": Extraction(person=2)},
            "person must be left out with live, got 2",
        ),
        (
            {"extraction": Extraction("median")},
            "extraction applies only to video, got .* for masks",
        ),
        (
            {"unit": "cm"},
            "unit applies only to calibrations and files of motions, got 'cm' for masks",
        ),
        (
            {"up": "z"},
            "up applies only to calibrations and files of motions, got 'z' for masks",
        ),
    ],
)
def test_options_that_do_not_suit_a_stream_of_masks_are_refused(
    options, expected, monkeypatch, every_frame, walk
):
    monkeypatch.setattr(
        sys, "stdin", io.TextIOWrapper(io.BytesIO(b"".join(map(pgm, walk[:8]))))
    )
    with pytest.raises(InputError, match=expected):
        next(track_live(**QUICK, **options))


def test_images_of_another_size_are_refused(every_frame, walk):
    masks = live_views(
        Stream("-", io.BytesIO(pgm(walk[0]) + pgm(walk[0][:60]))), None, lambda _: None
    )
    assert next(masks).numbers[0] == 0
    with pytest.raises(InputError, match="expected frames of 160x120, got 160x60"):
        next(masks)


IMPATIENT = """
import posefit.footage.live as footage, posefit.tracking.live as tracking
from posefit.cli import run
def impatient(frame, row=tracking.LiveFrame.row.fget):
    footage.STALL_SECONDS = 0.5
    return row(frame)
footage.STALL_SECONDS, tracking.LiveFrame.row = 600.0, property(impatient)
run()
"""  # which waits for as long as it has to until a frame is tracked, and not for long from then on


def test_a_pipe_that_pauses_ends_the_process_with_one_line_and_keeps_its_frames(
    walk, tmp_path
):
    out = tmp_path / "out"
    words = ["track", "--live", "-", "--out", out, "--evaluations", 80, "--restarts", 1]
    command = [
        sys.executable,
        "-c",
        IMPATIENT,
        *map(str, words),
        "--view-degrees",
        "45",
    ]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stderr=subprocess.PIPE, text=False
    ) as process:
        lines = out / "frames.jsonl"
        # a frame is tracked
        while process.poll() is None and not (lines.exists() and lines.stat().st_size):
            with suppress(BrokenPipeError):  # it may have ended meanwhile
                process.stdin.write(pgm(walk[0]))
                process.stdin.flush()
            time.sleep(0.02)  # and the pipe stays open
        errors = process.stderr.read().decode()
        status = process.wait()
    assert status == 2, errors
    assert errors.splitlines()[-1] == "posefit: -: no frame arrived for 0.5 s"
    assert "Traceback" not in errors
    rows = (out / "frames.jsonl").read_text().splitlines()
    assert len(arrays(out / "poses.npz")["poses"]) == len(rows) > 0


@each(
    ("content", "message"),
    [
        (b"", "expected frames, got none"),
        (b"GIF89a", "expected binary PGM or PPM images"),
        (pgm(np.zeros((120, 160), dtype=bool)) * 40, "expected a person in the first"),
    ],
)
def test_a_start_that_fails_leaves_no_folder(content, message, monkeypatch, tmp_path):
    out = tmp_path / "out"
    for _ in range(2):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(content)))
        with pytest.raises(InputError, match=message):
            write_live(track_live(**QUICK), out)
        assert list(tmp_path.iterdir()) == []
