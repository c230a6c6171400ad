"""Valid files of every kind that is read, small ones, made by the project's own writers where it has them."""

import io
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from PIL import Image

from posefit import Camera
from posefit.footage.writing import VideoWriter
from posefit.geometry.body import Body
from posefit.motion import built_in
from posefit.motion.amc import write_amc
from posefit.motion.asf import write_asf
from posefit.motion.bvh import write_bvh
from posefit.silhouette.cost import project
from tests.footage.matroska import write_matroska
from tests.fuzz.written import written
from tests.geometry.calibrations import EXTRI, KINDS, QUALISYS, TOML, opencv
from tests.geometry.programs import SAMPLES
from tests.geometry.turns import about
from tests.motion.rigs import STYLES, write_rig

PLAN = """[defaults]
frames = 3
settings = { sapso.cooling = 0.9 }
[product]
methods = ["sapso@pca", { method = "random@full", settings = { random.population_size = 20 } }]
motions = ["walk", { motion = "walk-a", train = ["walk-b"] }]
views = [45, [0, 90]]
corruptions = [{}, { holes = 0.3, dropped = 0.1 }]
instances = 2
seeds = [0, 1]
[[cells]]
method = "random@pca"
motion = "run"
"""


@dataclass(frozen=True)
class Seed:
    """A valid file: which reader it is for, its suffix, and what it holds."""

    reader: str
    suffix: str
    content: bytes


def corpus(folder: Path) -> list[Seed]:
    """Return valid files of every kind; `folder` is for what is written meanwhile."""
    motion = built_in.motion("walk", frames=3)
    write_asf(folder / "a.asf", motion.skeleton)
    write_amc(folder / "a.amc", motion)
    write_bvh(folder / "a.bvh", motion)
    seeds = [
        Seed(kind, f".{kind}", (folder / f"a.{kind}").read_bytes())
        for kind in ("asf", "amc", "bvh")
    ]
    rigs = (
        ("mixamo", "t", 100.0),
        ("lafan1", "along x", 39.37),
        ("biped", "cmu", 1.0),
        ("vrm", "t", 17.7),
    )
    # in centimetres, inches, metres and the CMU database's unit
    for name, rest, scale in rigs:
        path = write_rig(
            folder / "rig.bvh", motion, STYLES[name], scale, about(0, np.pi / 2), rest
        )
        seeds.append(Seed("bvh", ".bvh", path.read_bytes()))
    body = Body.of(motion.skeleton)
    camera = Camera.around(motion.translations[0], 0.8, 3.5, (64, 48))
    masks = np.stack(
        [
            project(body, camera, *where)
            for where in zip(motion.poses, motion.translations, strict=True)
        ]
    )
    usable = np.array([True, False, True])
    for save in (np.savez, np.savez_compressed):
        for stack in (
            masks,
            masks.astype(np.uint8) * 255,
            np.asfortranarray(masks.astype(np.float32)),
        ):
            seeds.append(
                _npz(
                    "masks",
                    save,
                    masks=stack,
                    valid=~masks,
                    usable=usable,
                    fps=np.array(30.0),
                )
            )
    seeds += [
        Seed("images", suffix, _image(masks[0], suffix))
        for suffix in (".png", ".jpg", ".bmp", ".tif", ".pgm")
    ]
    seeds += [
        Seed("images", suffix, _pages(masks, suffix))
        for suffix in (".gif", ".webp", ".tif")
    ]
    pictures = [
        np.where(mask, 255, 0).astype(np.uint8)[..., None].repeat(3, axis=2)
        for mask in masks
    ]
    for suffix in (".mp4", ".avi"):
        with VideoWriter(folder / f"video{suffix}", 30.0, (64, 48)) as writer:
            for picture in pictures:
                writer.write(picture)
        seeds.append(Seed("video", suffix, (folder / f"video{suffix}").read_bytes()))
    seeds.append(
        Seed(
            "video",
            ".mkv",
            write_matroska(folder / "video.mkv", pictures, [0, 33, 99]).read_bytes(),
        )
    )
    texts = [(".json", camera.to_json()), (".toml", TOML), (".xml", QUALISYS)]
    texts += [
        (Path(name).suffix, text + EXTRI.partition("---")[2] * (name == "intri.yml"))
        for name, text in KINDS.items()
    ]
    texts += [(suffix, write()) for write, suffix, _ in SAMPLES.values()]
    texts += [
        (suffix, opencv(folder / f"calibration{suffix}").read_text())
        for suffix in (".yml", ".json", ".xml")
    ]
    seeds += [Seed("calibration", suffix, text.encode()) for suffix, text in texts]
    suffixes = {"ledger": ".sqlite3"}
    seeds += [
        Seed(kind, suffixes.get(kind, ".jsonl"), content)
        for kind, content in written(folder).items()
    ]
    return [*seeds, Seed("plan", ".toml", PLAN.encode())]


def _npz(reader: str, save: Any, **arrays: Any) -> Seed:
    buffer = io.BytesIO()
    save(buffer, **arrays)
    return Seed(reader, ".npz", buffer.getvalue())


def _image(mask: Any, suffix: str) -> bytes:
    written, content = cv2.imencode(suffix, np.where(mask, 255, 0).astype(np.uint8))
    assert written
    return content.tobytes()


def _pages(masks: Any, suffix: str) -> bytes:
    """Return an image of several pages."""
    first, *others = [
        Image.fromarray(np.where(mask, 255, 0).astype(np.uint8)) for mask in masks
    ]
    buffer = io.BytesIO()
    first.save(
        buffer,
        Image.registered_extensions()[suffix],
        save_all=True,
        append_images=others,
    )
    return buffer.getvalue()
