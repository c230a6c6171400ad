"""Annotations in COCO's format are masks: polygons and runs, as pycocotools has them."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.errors import InputError
from posefit.footage.annotations import filled, unrun
from posefit.footage.options import SourceOptions
from posefit.footage.source import scene_of
from tests.commands import error_of
from tests.footage.conftest import SIZE, read_masks

WIDTH, HEIGHT = SIZE


def drawn(*rows: str) -> Any:
    """Return the mask of a drawing."""
    return np.array([[letter == "#" for letter in row] for row in rows])


def runs_of(mask: Any) -> dict[str, Any]:
    """Return a mask as runs that are not compressed."""
    pixels = np.concatenate([[False], mask.T.ravel(), [True]])
    changes = np.flatnonzero(np.diff(pixels))
    lengths = np.diff(np.concatenate([[0], changes, [mask.size]]))
    return {"size": [*mask.shape], "counts": [int(length) for length in lengths]}


def document(shapes: Sequence[Sequence[Any]], names: Sequence[str] = ()) -> Any:
    """Return annotations: for each image the shapes of people, and a ball."""
    images = []
    people = []
    for k, shown in enumerate(shapes):
        name = names[k] if names else f"frame_{k:04d}.jpg"
        images.append(
            {"id": 7 + k, "file_name": name, "width": WIDTH, "height": HEIGHT}
        )
        for shape in shown:
            people.append({"image_id": 7 + k, "category_id": 1, "segmentation": shape})
    ball = [[5.0, 5.0, 9.0, 5.0, 9.0, 9.0, 5.0, 9.0]]
    people.append({"image_id": 7, "category_id": 3, "segmentation": ball})
    categories = [{"id": 3, "name": "ball"}, {"id": 1, "name": "person"}]
    # as some programs write them
    return {
        "images": images[::-1],
        "annotations": people,
        "categories": categories,
    }


def written(path: Path, content: Any) -> Path:
    path.write_text(json.dumps(content))
    return path


# filled by pycocotools 2.0
@pytest.mark.parametrize(
    ("corners", "mask"),
    [
        (
            [0.4, 0.6, 5.5, 1.2, 2.3, 4.7],
            drawn("......", ".####.", ".###..", "..#...", "..#..."),
        ),
        (
            [1, 1, 4, 1, 4, 4, 1, 4],
            drawn("......", ".###..", ".###..", ".###..", "......"),
        ),
        (
            [-2, 1.5, 3.5, -1, 8.2, 2.5, 3.5, 6],
            drawn(".####.", "######", "######", ".#####", "..####"),
        ),
    ],
)
def test_polygons_are_filled_as_by_pycocotools(
    corners: Sequence[float], mask: Any
) -> None:
    np.testing.assert_array_equal(filled(np.array(corners, dtype=float), (6, 5)), mask)


def test_random_polygons_and_runs_are_those_of_pycocotools() -> None:
    coco = pytest.importorskip("pycocotools.mask")
    rng = np.random.default_rng(0)
    for _ in range(100):
        width, height = rng.integers(5, 90, 2).tolist()
        corners = rng.uniform(-0.3, 1.3, (rng.integers(3, 30), 2)) * [width, height]
        steps = rng.choice([0.5, 1.0, 1e-3])
        flat = (steps * np.round(corners / steps)).ravel()
        found = filled(flat, (width, height))
        (runs,) = coco.frPyObjects([flat.tolist()], height, width)
        np.testing.assert_array_equal(found, coco.decode(runs) > 0)
        text = coco.encode(np.asfortranarray(found.astype(np.uint8)))["counts"].decode()
        shape = {"size": [height, width], "counts": text}
        np.testing.assert_array_equal(unrun(shape, (width, height)), found)


def test_compressed_runs_are_read() -> None:
    mask = np.zeros((40, 50), dtype=bool)
    mask[3:37, 5:48] = True
    mask[10:20, 10:20] = False
    # encoded by pycocotools 2.0
    text = (
        "[6R1600000000UO4:LF4:LF4:LF4:LF4:LF4:LF4:LF4:LF4:LF4:La000000000000000"
        "0000000000000000000000000000000000000000]2"
    )
    shape = {"size": [40, 50], "counts": text}
    np.testing.assert_array_equal(unrun(shape, (50, 40)), mask)
    np.testing.assert_array_equal(unrun(runs_of(mask), (50, 40)), mask)


def test_the_people_of_each_image_are_its_mask(walk: list[Any], tmp_path: Path) -> None:
    other = np.zeros_like(walk[0])
    other[50:60, 140:150] = True
    shapes = [[runs_of(mask)] for mask in walk]
    shapes[1].append(runs_of(other))
    shapes[3] = []
    # the fifth image is missing
    names = [f"clip/a_{k:03d}.jpg" for k in (1, 2, 3, 4, 6, 7)]
    view = read_masks(written(tmp_path / "a.json", document(shapes, names)))
    masks = list(view.masks())
    assert view.usable.tolist() == [True] * 4 + [False] + [True] * 2
    for number, mask in enumerate([0, 1, 2, None, None, 4, 5]):
        expected = np.zeros_like(other)
        if mask is not None:
            expected = walk[mask] | other if mask == 1 else walk[mask]
        np.testing.assert_array_equal(masks[number], expected)
    assert any("the category person" in guess for guess in view.guesses)


def test_a_crowd_is_unknown_beside_people_and_else_a_person(
    walk: list[Any], tmp_path: Path
) -> None:
    crowd = np.zeros_like(walk[0])
    crowd[40:, 20:] = True
    content = document([[runs_of(mask), runs_of(crowd)] for mask in walk])
    # some programs mark every run of pixels so, and the last image has nothing else
    for k, each in enumerate(content["annotations"]):
        each["iscrowd"] = k % 2
    del content["annotations"][2 * len(walk) - 2]
    view = read_masks(written(tmp_path / "a.json", content))
    for k, mask in enumerate(walk):
        silhouette = view.silhouette(k)
        last = k == len(walk) - 1
        np.testing.assert_array_equal(silhouette.mask, crowd if last else mask)
        np.testing.assert_array_equal(silhouette.valid, mask | ~crowd | last)
    assert any("marked iscrowd are unknown" in guess for guess in view.guesses)


def test_annotations_of_no_image_are_said(walk: list[Any], tmp_path: Path) -> None:
    content = document([[runs_of(mask)] for mask in walk])
    content["images"] = content["images"][2:]
    (warning,) = read_masks(written(tmp_path / "a.json", content)).warnings
    assert f"2 of {len(walk)} annotated images" in warning
    for each in content["annotations"]:
        each["image_id"] = str(each["image_id"])
    content["images"] = content["images"][:1]
    content["images"][0]["id"] = 1
    with pytest.raises(InputError, match="got '7' where images have 1"):
        read_masks(written(tmp_path / "a.json", content))


def test_whole_numbers_may_be_written_with_a_point(
    walk: list[Any], tmp_path: Path
) -> None:
    content = document([[runs_of(mask)] for mask in walk])
    for image in content["images"]:
        for key in ("id", "width", "height"):
            image[key] = float(image[key])
    for each in content["annotations"]:
        each["category_id"] = float(each["category_id"])
    # a program that merges sets lists a category twice
    content["categories"].append({"id": 9, "name": "person"})
    view = read_masks(written(tmp_path / "a.json", content))
    for k, mask in enumerate(walk):
        np.testing.assert_array_equal(view.silhouette(k).mask, mask)


def test_another_category_is_chosen_by_name(walk: list[Any], tmp_path: Path) -> None:
    path = written(tmp_path / "a.json", document([[runs_of(mask)] for mask in walk]))
    scene = scene_of([path], SourceOptions(category="person"))
    assert len(scene.observations) == len(walk)
    error = error_of("track", path, "--category", "cat", "--out", tmp_path / "out")
    assert "category must be one of the file's, 'ball', 'person', " in error
    error = error_of("track", path, "--label", "1", "--out", tmp_path / "out")
    assert "--category chooses among them" in error
    np.savez(tmp_path / "m.npz", masks=np.array(walk))
    for source in ("walk", tmp_path / "m.npz"):
        error = error_of(
            "track", source, "--category", "person", "--out", tmp_path / "out"
        )
        assert "category applies only to annotations" in error


GOOD = {"size": [HEIGHT, WIDTH], "counts": [WIDTH * HEIGHT]}


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ([], "COCO's lists images, annotations and categories, got no images"),
        ({"images": [3]}, "got no images"),
        (document([]), "got no annotation|images of one size"),
        (document([[[1.0, 2.0]]]), "polygons or runs of pixels"),
        (document([[[[0.0, 0.0, 5.0, 5.0]]]]), "polygons or runs of pixels"),
        (document([[[[0.0, 0.0, 1e9, 5.0, 0.0, 9.0]]]]), "polygons or runs of pixels"),
        (document([[[["a"] * 6]]]), "polygons or runs of pixels"),
        (document([[{**GOOD, "counts": [3]}]]), "polygons or runs of pixels"),
        (
            document([[{**GOOD, "counts": [-3, WIDTH * HEIGHT + 3]}]]),
            "polygons or runs",
        ),
        (document([[{**GOOD, "counts": "oooooooooooooooo"}]]), "polygons or runs"),
        (document([[{**GOOD, "size": [3, 4]}]]), "polygons or runs of pixels"),
        (document([[None]]), "polygons or runs of pixels"),
        (document([[GOOD], [GOOD]], ["a.jpg", "a.jpg"]), "each image once"),
        (
            document([[[[0.1, 0.1, 0.5, 0.1, 0.5, 0.9]]]]),
            "polygons in pixels, got corners up to 0.9",
        ),
        (
            {**document([[GOOD]]), "images": 2 * [document([[GOOD]])["images"][0]]},
            "each image once",
        ),
        (
            {
                **document([[GOOD], [GOOD]]),
                "images": [
                    {**image, "id": 7} for image in document([[GOOD], [GOOD]])["images"]
                ],
            },
            "images with an id each, got 7 for 2 images",
        ),
    ],
)
def test_wrong_annotations_leave_one_line(
    tmp_path: Path, content: Any, message: str
) -> None:
    path = written(tmp_path / "a.json", content)
    with pytest.raises(InputError, match=message):
        read_masks(path)
    path.write_text("{")
    with pytest.raises(InputError, match="expected a JSON file"):
        read_masks(path)
