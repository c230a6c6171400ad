"""The files of a track: a format is a line of `write_files`, beside the pictures, which are made frame by frame."""

import csv
import json
from collections.abc import Iterable
from itertools import repeat
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from posefit.files import opencv_name
from posefit.fitting.tracker import Observation
from posefit.footage.scene import Scene
from posefit.footage.video import VideoWriter
from posefit.geometry.skeleton import JOINTS
from posefit.measuring.c3d import write_c3d
from posefit.measuring.centres import PLACES
from posefit.measuring.tables import write_angles, write_gait, write_trc
from posefit.motion.amc import write_amc
from posefit.motion.asf import write_asf
from posefit.motion.bvh import write_bvh
from posefit.motion.gltf import write_glb
from posefit.motion.opensim import write_mot, write_osim
from posefit.output.content import Content
from posefit.output.page import track_document
from posefit.output.page.content import track_data
from posefit.output.page.stills import Stills
from posefit.output.picture import Painter
from posefit.output.text import undetermined
from posefit.silhouette.foreground import Image


def _write_npz(path: Path, content: Content) -> None:
    np.savez_compressed(
        path,
        poses=content.motion.poses,
        translations=content.motion.translations,
        fps=np.array(content.motion.fps),
        frames=content.motion.first + np.arange(len(content.motion)),
        joints=np.array(JOINTS),
        places=np.array(PLACES),
        costs=content.table["cost"],
        radii=content.scene.body.radii,
        **dict[str, Any](content.intervals),
    )


def _write_table(path: Path, content: Content) -> None:
    names = [f"{place}_{axis}" for place in PLACES for axis in "xyz"]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*content.table, "activity", *names])
        for k, (frame, points) in enumerate(
            zip(content.frames, content.motion.joints, strict=True)
        ):
            number = content.scene.first + k
            values = [column[k].item() for column in content.table.values()]
            cells = ["" if np.isnan(value) else value for value in values]
            places = (
                "" if number in content.blank else f"{value:.6f}"
                for value in points.reshape(-1)
            )
            writer.writerow([*cells, frame.activity, *places])


FILES = (
    "poses.npz", "skeleton.asf", "track.amc", "track.bvh", "track.glb", "track.trc", "track.c3d", "track.mot",
    "model.osim", "frames.csv", "angles.csv", "gait.csv", "camera.json", "summary.json",
    "overlay.mp4", "summary.png", "track.html",
)  # fmt: skip


def write_files(folder: Path, content: Content) -> None:
    """Write all `FILES` of a track to a folder."""
    scene = content.scene
    table = content.table
    motion = content.motion
    blank = content.blank
    _write_npz(folder / "poses.npz", content)
    write_asf(folder / "skeleton.asf", motion.skeleton)
    write_amc(folder / "track.amc", motion)
    write_bvh(folder / "track.bvh", motion)
    write_glb(folder / "track.glb", motion, scene.body.radii)
    write_trc(folder / "track.trc", motion, blank)
    write_c3d(folder / "track.c3d", motion, blank, content.gait)
    write_mot(folder / "track.mot", motion)
    write_osim(folder / "model.osim", scene.body, PLACES)
    _write_table(folder / "frames.csv", content)
    write_angles(folder / "angles.csv", motion, blank)
    write_gait(folder / "gait.csv", content.gait)
    (folder / "camera.json").write_text(scene.cameras[0].to_json(), encoding="utf-8")
    (folder / "summary.json").write_text(
        json.dumps(content.summary, indent=1) + "\n", encoding="utf-8"
    )
    stills = Stills(scene)
    painter = Painter(scene, table["usable"] == 1.0)
    writer: VideoWriter | None = None
    radii = content.intervals.get("joint_radii", repeat(None))
    filmed = zip(content.frames, *_filmed(scene), radii, strict=False)
    for k, (frame, observation, picture, spread) in enumerate(filmed):
        stills.add(frame, observation, picture)
        row = {name: float(values[k]) for name, values in table.items()}
        image = painter.add(frame, observation, row, picture, spread)
        if writer is None:
            writer = VideoWriter(
                folder / "overlay.mp4", scene.fps, (image.shape[1], image.shape[0])
            )
        writer.write(image)
    assert writer is not None
    writer.close()
    notes = (
        "" if content.trust is None else content.trust.sentence,
        undetermined(content),
    )
    if not cv2.imwrite(
        opencv_name(folder / "summary.png"),
        painter.summary(table, [*filter(None, notes)]),
    ):
        raise OSError("no room for summary.png")
    page = track_document(track_data(content, stills))
    (folder / "track.html").write_text(page, encoding="utf-8", newline="\n")


def page_of(content: Content) -> str:
    """Return the page of a track, `track.html`."""
    stills = Stills(content.scene)
    for frame, observation, picture in zip(
        content.frames, *_filmed(content.scene), strict=False
    ):
        stills.add(frame, observation, picture)
    return track_document(track_data(content, stills))


def _filmed(scene: Scene) -> tuple[Iterable[Observation], Iterable[Image | None]]:
    return scene.observations, repeat(
        None
    ) if scene.pictures is None else scene.pictures()
