"""Law: whatever was filmed, every file is written, with the numbers and times of the footage.

`TIMES` has a line for each file that states times: how a plain reader finds the times of the frames of which something
is known. A new writer joins by a line.
"""

import csv
import errno
import json
import struct
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import posefit
from posefit.arrays import Array
from posefit.errors import InputError
from posefit.evaluation.errors import evaluated, unseen
from posefit.evaluation.measures import Effort
from posefit.fitting.tracker import Frame, Observation
from posefit.footage import writing
from posefit.footage.extract import extract
from posefit.footage.extraction import Extraction
from posefit.footage.scene import Scene
from posefit.footage.writing import VideoWriter, video_rate
from posefit.geometry.body import Body
from posefit.geometry.camera import Camera
from posefit.limits import RATES
from posefit.measuring.centres import PLACES
from posefit.measuring.gait import gait_of
from posefit.motion import built_in
from posefit.output import files, pictures
from posefit.output.content import Setup, TrackingLog
from posefit.output.files import FILES, WRITERS, chosen_kinds
from posefit.output.folder import OutputFolder
from posefit.output.picture import Painter
from posefit.progress import QUIET
from posefit.silhouette.cost import BETA, areas, project
from posefit.silhouette.mask import Silhouette
from posefit.tracking.result import Track
from tests.cases import each
from tests.files import arrays
from tests.footage.conftest import encoded, truth

MAX_TICKS = 65_535  # of a second, in MPEG-4
MAX_SIDE = 8_191  # pixels of its frames
TELEPHOTO = 100.0  # times the larger side: the longest lens
DRAWN = 600  # rates
WHOLE = 12  # outputs
ODD = [(across, down) for across in (0, 1) for down in (0, 1)]
FAILURES = (InputError("no such codec"), cv2.error("no such codec"), ValueError("no"))


@dataclass(frozen=True)
class Case:
    """What was filmed."""

    fps: float = 30.0
    count: int = 2
    first: int = 0
    held: Collection[int] = ()
    cameras: int = 1
    size: tuple[int, int] = (64, 48)

    @property
    def known(self) -> Array:
        """The numbers of the frames that were not held, as filmed."""
        known = [k for k in range(self.count) if k not in self.held]
        return self.first + np.array(known, dtype=np.int64)


def track_of(case: Case) -> Track:
    """Return a track of footage by hand: the poses of a walk, and nothing searched."""
    motion = built_in.motion("walk", frames=case.count)
    motion = replace(motion, fps=case.fps, first=case.first)
    body = Body.of(motion.skeleton)
    cameras = [
        Camera.around(motion.translations[0], azimuth, 4.0, case.size)
        for azimuth in 2.0 * np.pi * np.arange(case.cameras) / case.cameras
    ]
    observations = []
    frames = []
    for k, (pose, place) in enumerate(
        zip(motion.poses, motion.translations, strict=True)
    ):
        masks = [
            Silhouette.of(project(body, camera, pose, place)) for camera in cameras
        ]
        observations.append(Observation(masks, usable=k not in case.held))
        counts = [
            areas(body, camera, mask, pose[None], place[None])[0]
            for camera, mask in zip(cameras, masks, strict=True)
        ]
        frames.append(Frame(pose, place, 0.0, np.array(counts), 1))
    scene = Scene(
        name="by hand",
        body=body,
        cameras=cameras,
        fps=case.fps,
        count=case.count,
        yaw=None,
        anchor=motion.translations[0],
        truth=None,
        observations=observations,
        placing="given",
        first=case.first,
    )
    table, measures = evaluated(scene, frames, None, None, BETA, Effort(1.0, 1.0))
    setup = Setup(
        motion=scene.name,
        method="by hand",
        settings={},
        seed=0,
        train=[],
        evaluations_per_frame=1,
        dimensions=None,
        translation="searched",
        first_pose="searched",
        smooth=False,
        views=case.cameras,
        camera=scene.placing,
        size_pixels=case.size,
        fps=case.fps,
        frames=case.count,
    )
    log = TrackingLog(
        hypotheses=[],
        build=None,
        trace=None,
        modes=None,
        none_of_modes=None,
        unknown_sides=None,
        lost_frames=None,
        relocalised=[],
        retracked_outside=None,
        backwards_share=0.0,
        warnings=[],
        guesses=[],
    )
    gait = gait_of(motion, unseen(table))
    return Track(motion, frames, table, measures, None, gait, setup, log, [], scene)


def written(case: Case, folder: Path, write: str | Sequence[str] = ()) -> Track:
    """Return a track whose files, all by default, were written to a folder."""
    track = track_of(case)
    messages: list[str] = []
    kinds = chosen_kinds(write)
    with OutputFolder(folder, False, False, {}, messages.append, kinds) as output:
        output.begin(track.scene)
        output.finish(track.content)
    assert messages == []
    expected = {WRITERS[kind][0] for kind in kinds} if write else set(FILES)
    assert {path.name for path in folder.iterdir()} == expected
    return track


# ---- plain readers, as strict as the programs that the files are for


def read_trc(path: Path) -> tuple[dict[str, str], Array, Array, Array]:
    """Return a .trc file's head, and of its rows the numbers, the times, and the points (T, 27, 3); NaN for blank ones.

    It counts as OpenSim does: headings are separated by any number of tabs, a row has a cell after each tab but for a
    last one that is empty, and the first row is not waited for after the end of the file.
    """
    lines = path.read_text(encoding="utf-8").split("\n")
    assert lines[0].split("\t")[:3] == ["PathFileType", "4", "(X/Y/Z)"]
    assert lines[-1] == ""
    names = [word for word in lines[1].split("\t") if word]
    values = [word for word in lines[2].split("\t") if word]
    head = dict(zip(names, values, strict=True))
    markers = int(head["NumMarkers"])
    assert [word for word in lines[3].split("\t") if word] == [
        "Frame#",
        "Time",
        *PLACES,
    ]
    # X1 Y1 Z1 X2 ...
    assert lines[4].split("\t") == [
        *("", ""),
        *(f"{axis}{k + 1}" for k in range(markers) for axis in "XYZ"),
    ]
    assert lines[5] == ""
    rows = []
    for line in lines[6:-1]:
        cells = line.split("\t")
        if cells[-1] == "":
            cells.pop()
        assert len(cells) == 2 + 3 * markers
        rows.append([float(cell) if cell else np.nan for cell in cells])
    assert int(head["NumFrames"]) == len(rows) >= 1
    table = np.array(rows)
    return head, table[:, 0], table[:, 1], table[:, 2:].reshape(-1, markers, 3)


def trc_times(path: Path, _: Case) -> Array:
    _, _, times, points = read_trc(path)
    return times[np.isfinite(points).all(axis=(1, 2))]


def c3d_times(path: Path, _: Case) -> Array:
    """Points of 27 markers, by the header alone: frames are counted from 1."""
    content = path.read_bytes()
    first, last = struct.unpack_from("<HH", content, 6)
    (start,) = struct.unpack_from("<H", content, 16)
    (rate,) = struct.unpack_from("<f", content, 20)
    count = last - first + 1
    data = np.frombuffer(content, "<f4", count * 27 * 4, 512 * (start - 1))
    residuals = data.reshape(count, 27, 4)[:, :, 3]
    numbers = first - 1 + np.flatnonzero((residuals >= 0.0).all(axis=1))
    return numbers / np.float64(rate)


def csv_times(path: Path, _: Case) -> Array:
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file))
    filled = [row for row in rows if list(row.values())[-1] != ""]
    return np.array([float(row["seconds"]) for row in filled])


def npz_times(path: Path, case: Case) -> Array:
    stored = arrays(path)
    return stored["frames"][~held_rows(case)] / stored["fps"]


def mot_times(path: Path, case: Case) -> Array:
    head, _, rows = path.read_text().partition("endheader\n")
    table = np.loadtxt(rows.splitlines()[1:], delimiter="\t", ndmin=2)
    assert f"nRows={case.count}\n" in head
    assert f"nColumns={table.shape[1]}\n" in head
    return table[~held_rows(case), 0]


def bvh_times(path: Path, case: Case) -> Array:
    """A .bvh file states how long a frame lasts, and not when the first one was."""
    lines = path.read_text().splitlines()
    start = lines.index("MOTION")
    assert lines[start + 1] == f"Frames: {case.count}"
    assert len(lines) == start + 3 + case.count
    seconds = float(lines[start + 2].removeprefix("Frame Time: "))
    return case.known * seconds


def amc_times(path: Path, case: Case) -> Array:
    """An .amc file states the numbers of its frames, from 1, and not their rate."""
    numbers = [int(line) for line in path.read_text().splitlines() if line.isdecimal()]
    return (np.array(numbers)[~held_rows(case)] - 1) / case.fps


def glb_times(path: Path, case: Case) -> Array:
    content = path.read_bytes()
    (length,) = struct.unpack_from("<I", content, 12)
    head = json.loads(content[20 : 20 + length])
    accessor = head["accessors"][head["animations"][0]["samplers"][0]["input"]]
    view = head["bufferViews"][accessor["bufferView"]]
    start = 28 + length + view["byteOffset"]
    times = np.frombuffer(content, "<f4", accessor["count"], start).astype(float)
    assert (np.diff(times) > 0.0).all()
    assert (accessor["min"], accessor["max"]) == ([times[0]], [times[-1]])
    return times[~held_rows(case)]


def held_rows(case: Case) -> Any:
    return np.isin(np.arange(case.count), [*case.held])


TIMES: dict[str, Callable[[Path, Case], Array]] = {
    "poses.npz": npz_times,
    "track.amc": amc_times,
    "track.bvh": bvh_times,
    "track.glb": glb_times,
    "track.trc": trc_times,
    "track.c3d": c3d_times,
    "track.mot": mot_times,
    "frames.csv": csv_times,
    "angles.csv": csv_times,
}
# that have no row a frame
TIMELESS = {
    "skeleton.asf",
    "model.osim",
    "gait.csv",
    "camera.json",
    "summary.json",
    "overlay.mp4",
    "summary.png",
    "track.html",
}


def check(case: Case, folder: Path) -> None:
    """Assert that every file of a case is written, and has the numbers and times of the footage."""
    track = written(case, folder)
    for name, times_of in TIMES.items():
        times = times_of(folder / name, case)
        # tables have microseconds, and others numbers of 32 bits
        np.testing.assert_allclose(
            times, case.known / case.fps, rtol=2e-7, atol=6e-7, err_msg=name
        )
    capture = cv2.VideoCapture(str(folder / "overlay.mp4"))
    assert capture.get(cv2.CAP_PROP_FRAME_COUNT) == case.count
    size = [
        capture.get(key)
        for key in (cv2.CAP_PROP_FRAME_WIDTH, cv2.CAP_PROP_FRAME_HEIGHT)
    ]
    capture.release()
    assert tuple(size) == Painter(track.scene).size
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["fps"], summary["frames"]) == (case.fps, case.count)


def cases() -> Iterator[Case]:
    """Yield what was filmed, at random: rates, cameras, sizes, numbers of frames, and frames that are held."""
    rng = np.random.default_rng(20261128)
    while True:
        count = int(rng.integers(1, 4))
        yield Case(
            fps=round(float(10.0 ** rng.uniform(0.0, 3.0)), int(rng.integers(0, 6))),
            count=count,
            first=int(rng.integers(0, 1000)),
            held=[k for k in range(count) if rng.random() < 0.3],
            cameras=int(rng.integers(1, 33)),
            size=(int(rng.integers(36, 90)), int(rng.integers(36, 90))),
        )


def test_every_file_with_times_is_tested_here() -> None:
    assert {*TIMES} | TIMELESS == set(FILES)
    assert not {*TIMES} & TIMELESS


@each(
    "case",
    [
        Case(count=1),
        Case(fps=119.8765, first=9, count=3, held=(1,)),
        Case(fps=239.8367, count=3, held=(0, 2)),
        Case(count=2, held=(0, 1)),
        Case(fps=RATES[0]),
        Case(fps=RATES[1]),
        *(Case(cameras=cameras, count=1) for cameras in (13, 32)),
        Case(size=(37, 41), cameras=3),
        Case(size=(16_384, 36), count=1),
        Case(size=(36, 16_384), count=1),
    ],
)
def test_every_file_is_written_at_the_corners(case: Case, tmp_path: Path) -> None:
    check(case, tmp_path / "out")


@each("case", islice(cases(), WHOLE))
def test_every_file_is_written_of_whatever_was_filmed(
    case: Case, tmp_path: Path
) -> None:
    check(case, tmp_path / "out")


def test_a_video_has_the_nearest_rate_that_mpeg_4_counts(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    drawn = 10.0 ** rng.uniform(0.0, 3.0, DRAWN)
    image = np.zeros((48, 64, 3), np.uint8)
    for fps in (119.8765, 239.8367, 65.5355, 655.355, 999.999, *RATES, *drawn):
        with VideoWriter(tmp_path / "a.mp4", float(fps), (64, 48)) as writer:
            writer.write(image)
        capture = cv2.VideoCapture(str(tmp_path / "a.mp4"))
        rate = capture.get(cv2.CAP_PROP_FPS)
        capture.release()
        low, high = writing.WRITTEN_RATES
        bounded = min(max(fps, low), high)
        # a decimal fraction of at most three places, which OpenCV takes to a thousandth
        finest = max(n for n in (1, 10, 100, 1000) if n * bounded <= MAX_TICKS)
        assert abs(rate - bounded) <= 0.5 / finest + 1.001e-3
    assert video_rate(119.8765) == 119.88
    assert video_rate(29.97) == 29.97
    assert video_rate(240) == 240


@each("size", [(37, 41), (37, 40), (36, 41), (1281, 721)])
def test_a_video_may_have_an_odd_size(size: tuple[int, int], tmp_path: Path) -> None:
    width, height = size
    with VideoWriter(tmp_path / "a.mp4", 30.0, size) as writer:
        for _ in range(3):
            writer.write(np.full((height, width, 3), 200, np.uint8))
    capture = cv2.VideoCapture(str(tmp_path / "a.mp4"))
    read, image = capture.read()
    capture.release()
    assert read
    # colours have half the resolution, so that the last odd row or column may go
    assert (width - image.shape[1], height - image.shape[0]) in ODD
    assert np.abs(image.astype(float) - 200.0).max() < 10.0


def test_pictures_of_the_longest_lens_are_painted(tmp_path: Path) -> None:
    track = track_of(Case(count=1, size=(37, 41)))
    far = replace(track.scene.cameras[0], focal=np.full(2, TELEPHOTO * 41))
    longest = replace(track, scene=replace(track.scene, cameras=[far]))
    assert files.write_files(tmp_path, longest.content) == []


@each("failure", [None, *FAILURES[:2]])
def test_masks_are_extracted_with_or_without_a_preview(
    failure: Exception | None, tmp_path: Path
) -> None:
    def fail(*_: object) -> None:
        raise failure  # type: ignore[misc]

    masks = 255 * np.array(truth()[10:16], np.uint8)
    images = np.repeat(masks[..., None], 3, axis=3)
    film = encoded(tmp_path / "masks.avi", images, "FFV1")
    with pytest.MonkeyPatch.context() as patch:
        if failure is not None:
            patch.setattr(VideoWriter, "__init__", fail)
        summary = extract(film, tmp_path / "out", Extraction("masks"))
    missing = set() if failure is None else {"preview.mp4"}
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {"masks.npz", "preview.mp4", "quality.csv"} - missing
    if failure is not None:
        assert f"preview.mp4 is missing: {failure}" in summary["warnings"]


@each("failure", FAILURES)
def test_a_video_that_cannot_be_written_is_reported_before_the_work(
    failure: Exception, tmp_path: Path
) -> None:
    def fail(*_: object) -> None:
        raise failure

    track = track_of(Case())
    messages: list[str] = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(VideoWriter, "__init__", fail)
        with OutputFolder(
            tmp_path / "out", False, False, {}, messages.append
        ) as output:
            output.begin(track.scene)
            assert len(messages) == 1
            output.finish(track.content)
    assert messages == [f"warning: overlay.mp4 is missing: {failure}"] * 2
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {*FILES} - {"overlay.mp4"}


@each(
    ("owner", "name", "missing"),
    [
        (Painter, "add", {"overlay.mp4", "summary.png"}),
        (Painter, "summary", {"summary.png"}),
        (VideoWriter, "write", {"overlay.mp4"}),
        (pictures.Stills, "add", {"track.html"}),
        (pictures, "track_data", {"track.html"}),
    ],
)
def test_a_picture_that_fails_costs_only_itself(
    owner: Any, name: str, missing: set[str], tmp_path: Path
) -> None:
    def fail(*_: object) -> None:
        raise ValueError("an unknown\nreason")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(owner, name, fail)
        warnings = files.write_files(tmp_path, track_of(Case()).content)
    assert {path.name for path in tmp_path.iterdir()} == {*FILES} - missing
    assert {warning.split()[0] for warning in warnings} == missing


def test_footage_deleted_during_the_work_loses_only_pictures(tmp_path: Path) -> None:
    def pictures() -> Iterator[Any]:
        yield np.full((48, 64, 3), 200, np.uint8)
        raise InputError("film.mp4: no such file")

    track = track_of(Case(count=3))
    scene = replace(track.scene, pictures=pictures)
    warnings = files.write_files(tmp_path, replace(track, scene=scene).content)
    assert {path.name for path in tmp_path.iterdir()} == set(FILES)
    assert warnings == ["the footage could not be read again: film.mp4: no such file"]
    capture = cv2.VideoCapture(str(tmp_path / "overlay.mp4"))
    assert capture.get(cv2.CAP_PROP_FRAME_COUNT) == 3
    capture.release()


def test_each_file_is_written_alone_as_it_is_among_all(tmp_path: Path) -> None:
    case = Case(count=2, first=7, cameras=2, held=(1,))
    written(case, tmp_path / "all")
    for kind, (name, _) in WRITERS.items():
        written(case, tmp_path / kind, kind)
        alone = tmp_path / kind / name
        together = tmp_path / "all" / name
        if kind in ("npz", "glb", "html"):  # archives and pages of many parts
            assert alone.stat().st_size == pytest.approx(
                together.stat().st_size, rel=0.01
            )
        else:
            assert alone.read_bytes() == together.read_bytes(), name


@each(
    ("write", "kinds"),
    [
        ((), tuple(WRITERS)),
        ("", tuple(WRITERS)),
        ("trc,bvh", ("bvh", "trc", "summary")),
        ("trc, track.bvh,", ("bvh", "trc", "summary")),
        (["trc", "bvh"], ("bvh", "trc", "summary")),
        (("frames.csv",), ("frames", "summary")),
        ("summary", ("summary",)),
        ("amc", ("asf", "amc", "summary")),
    ],
)
def test_files_are_chosen_by_their_kinds_or_names(write: Any, kinds: Any) -> None:
    assert chosen_kinds(write) == kinds


@each(
    ("write", "message"),
    [
        ("bvh,fbx", "write must be some of npz, asf, .*, html, got 'fbx'"),
        (["tracks.bvh"], "got 'tracks.bvh'; did you mean 'track.bvh'"),
        ([3], "write must be names of files, got"),
        (" , ", "write must name a file such as bvh, got ' , '"),
        ("bvh", "write needs out, the folder of the track, got none"),
    ],
)
def test_a_file_that_is_not_known_is_named_before_the_work(
    write: Any, message: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("posefit.tracking.front.scene_of", None)
    out = {} if "needs out" in message else {"out": tmp_path / "out"}
    with pytest.raises(InputError, match=message):
        posefit.track("walk", write=write, progress=QUIET, **out)
    assert not (tmp_path / "out").exists()


def test_a_chosen_file_costs_no_look_at_the_footage(tmp_path: Path) -> None:
    def pictures() -> Iterator[Any]:
        raise AssertionError("decoded")
        yield

    track = track_of(Case())
    scene = replace(track.scene, pictures=pictures)
    kinds = chosen_kinds("bvh")
    content = replace(track, scene=scene).content
    assert files.write_files(tmp_path, content, kinds) == []


@each(
    ("owner", "name"),
    [(VideoWriter, "close"), (VideoWriter, "write"), (pictures, "_write_png")],
)
def test_a_disk_without_room_for_a_picture_costs_no_poses(
    owner: Any, name: str, tmp_path: Path
) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    messages: list[str] = []
    track = track_of(Case())
    with (
        OutputFolder(tmp_path / "out", False, False, {}, messages.append) as output,
        pytest.MonkeyPatch.context() as patch,
    ):
        patch.setattr(owner, name, full)
        output.finish(track.content)
    missing = "overlay.mp4" if owner is VideoWriter else "summary.png"
    assert messages == [f"warning: {missing} is missing: No space left on device"]
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert names == {*FILES} - {missing}


def test_a_disk_without_room_for_the_poses_keeps_the_frames_and_resuming_writes_all(
    tmp_path: Path,
) -> None:
    options: dict[str, Any] = {
        "method": "random@loose",
        "evaluations": 40,
        "frames": (0, 2),
        "size": (64, 48),
        "fps": 119.8765,
        "progress": QUIET,
    }
    out = tmp_path / "out"

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(np, "savez_compressed", full)
        with pytest.raises(InputError, match="2 finished frames are kept"):
            posefit.track("walk", out=out, **options)
    assert not out.exists()
    track = posefit.track("walk", out=out, resume=True, **options)
    assert {path.name for path in out.iterdir()} == set(FILES)
    assert len(track) == 2


@each(
    ("error", "message"),
    [
        (OSError(errno.ENOSPC, "No space left"), "out: cannot write there"),
        (OSError(errno.EIO, "Input/output error", "film.mp4"), "film.mp4"),
    ],
)
def test_only_a_full_disk_is_called_one(
    error: OSError, message: str, tmp_path: Path
) -> None:
    with (
        pytest.raises((InputError, OSError), match=message),
        OutputFolder(tmp_path / "out", False, False, {}, print),
    ):
        raise error


def test_a_file_that_cannot_be_written_is_no_full_disk(tmp_path: Path) -> None:
    with (
        pytest.raises(InputError, match="out: cannot write there: Denied"),
        OutputFolder(tmp_path / "out", False, False, {}, print) as output,
    ):
        raise PermissionError(errno.EACCES, "Denied", str(output.building / "a.npz"))


def test_a_resumed_track_that_fails_before_its_first_frame_keeps_the_earlier_ones(
    tmp_path: Path,
) -> None:
    track = track_of(Case(count=3))
    out = tmp_path / "out"

    messages: list[str] = []

    def failing(resume: bool, recorded: int, error: BaseException) -> None:
        """Begin a track, or go on with one, that records some frames and fails."""
        messages.clear()
        with OutputFolder(out, False, resume, {}, messages.append) as output:
            for frame in track.frames[:recorded]:
                output.record(frame, np.random.default_rng(0).bit_generator.state)
            raise error

    kept = "2 finished frames are kept"
    # the second one while the masks are read, before the frames are asked for
    for resume, recorded in ((False, 2), (True, 0)):
        with pytest.raises(KeyboardInterrupt):
            failing(resume, recorded, KeyboardInterrupt())
        assert kept in messages[0]
    with pytest.raises(InputError, match=kept):
        failing(True, 0, InputError("masks.npz: expected a file"))
    with OutputFolder(out, False, True, {}, print) as output:
        frames, _ = output.earlier()
        output.finish(track.content)
    assert [frame.translation.tolist() for frame in frames] == [
        frame.translation.tolist() for frame in track.frames[:2]
    ]


def test_a_picture_has_room_for_any_number_of_cameras() -> None:
    track = track_of(Case(count=1, cameras=32, size=(37, 41)))
    (observation,) = track.scene.observations
    (frame,) = track.frames
    row = {name: float(values[0]) for name, values in track.table.items()}
    for count in range(1, 33):
        scene = replace(track.scene, cameras=track.scene.cameras[:count])
        seen = replace(observation, silhouettes=observation.silhouettes[:count])
        painter = Painter(scene)
        width, height = painter.size
        assert painter.add(frame, seen, row).shape == (height, width, 3)
        assert width % 2 == height % 2 == 0
        assert width <= MAX_SIDE


@each(
    "case",
    [
        Case(fps=119.88, count=5, first=10, held=(0, 2, 4)),
        Case(count=2, held=(0, 1)),
        Case(),
    ],
)
def test_the_table_in_python_is_that_of_the_files(case: Case, tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    table = written(case, tmp_path / "out").to_pandas()
    for name in ("frames.csv", "angles.csv"):
        stored = pandas.read_csv(tmp_path / "out" / name)
        assert set(stored) <= set(table)
        for column in stored:
            np.testing.assert_allclose(
                table[column].to_numpy(dtype=float),
                stored[column].to_numpy(dtype=float),
                rtol=1e-12,
                atol=6e-4 if name == "angles.csv" else 6e-7,
                err_msg=column,
            )
    held = np.isin(table["frame"], case.first + np.array([*case.held]))
    np.testing.assert_array_equal(table["left_knee_x"].isna(), held)
    np.testing.assert_array_equal(table["left_knee_flexion"].isna(), held)


def test_a_trc_leaves_out_unknown_frames(tmp_path: Path) -> None:
    case = Case(fps=119.88, count=6, first=10, held=(0, 2, 5))
    track = written(case, tmp_path / "out")
    head, numbers, _, points = read_trc(tmp_path / "out" / "track.trc")
    assert numbers.tolist() == [12, 14, 15]  # from 1
    np.testing.assert_allclose(points, track.joints[[1, 3, 4]], atol=6e-7)
    assert head == {
        "DataRate": "119.88",
        "CameraRate": "119.88",
        "NumFrames": "3",
        "NumMarkers": "27",
        "Units": "m",
        "OrigDataRate": "119.88",
        "OrigDataStartFrame": "11",
        "OrigNumFrames": "6",
    }


def test_a_trc_of_unknown_frames_only_has_blank_rows(tmp_path: Path) -> None:
    written(Case(count=3, held=(0, 1, 2)), tmp_path / "out")
    _, numbers, times, points = read_trc(tmp_path / "out" / "track.trc")
    assert numbers.tolist() == [1, 2, 3]
    np.testing.assert_allclose(times, [0.0, 1 / 30, 2 / 30], atol=6e-7)
    assert np.isnan(points).all()
