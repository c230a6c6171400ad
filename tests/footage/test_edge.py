"""A film whose border cuts the person in all frames is refused after two seconds."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posefit.errors import NoPersonError
from posefit.footage.extraction import Extraction
from posefit.footage.options import SourceOptions
from posefit.footage.segmentation import Segmentation
from posefit.footage.source import scene_of
from posefit.footage.video import Video
from tests.footage.conftest import ALL, NOBODY, SIZE, encoded

FRAMES = 120  # of 25 a second
Register = Callable[..., None]


def box(down: int, across: int = 60) -> Any:
    """Return the mask of a box that is cut if it reaches the last row, 119."""
    mask = NOBODY.copy()
    mask[40:down, across : across + 20] = True
    return mask


CUT = box(120)
WHOLE = box(100)


def following(masks: Sequence[Any], asked: list[int]) -> Any:
    """Return a segmenter that knows the masks by the pictures' brightness."""

    class Known:
        def __init__(self, footage: Any) -> None:
            pass

        def segment(self, image: Any) -> Any:
            number = round(float(image[:8, :8].mean()) / 2.0)
            asked.append(number)
            return masks[number], NOBODY.copy()

    return Known


def numbered(path: Path, moving: Sequence[Any] = ()) -> Path:
    """Write a film whose frames have their numbers as the brightness of a corner."""
    images = []
    for k in range(FRAMES):
        image = np.full((SIZE[1], SIZE[0], 3), 120, dtype=np.uint8)
        image[:16, :16] = 2 * k
        if moving:
            image[moving[k]] = 250
        images.append(image)
    return encoded(path, images)


@pytest.mark.parametrize("still", [False, True])
def test_a_person_who_is_cut_in_all_frames_is_refused_soon(
    segmenter: Register, tmp_path: Path, still: bool
) -> None:
    asked = list[int]()
    segmenter("known", following([CUT] * FRAMES, asked), still_background=still)
    path = numbered(tmp_path / "cut.avi")
    options = SourceOptions(extraction=Extraction("known"))
    with pytest.raises(NoPersonError) as caught:
        scene_of([path], options)
    looked = 50 + len(range(50, FRAMES, 8))
    assert str(caught.value) == (
        f"{path}: expected a person who is whole in the picture, got one cut by the edge "
        f"in {looked} of {looked} frames looked at, of {FRAMES}"
    )
    assert len(asked) == looked
    # to look at masks is another matter: all are taken
    view, _, doubt = Segmentation(Video.of(path), Extraction("known"), ALL).read()
    assert len(view) == FRAMES
    assert doubt is not None
    assert doubt.text == (
        f"{path}: expected a person who is whole in the picture, got one cut by the edge "
        f"in {FRAMES} of {FRAMES} frames"
    )


@pytest.mark.parametrize("whole", [range(52, 60), range(110, FRAMES)])
def test_a_person_who_is_cut_first_and_whole_later_is_tracked(
    segmenter: Register, tmp_path: Path, whole: range
) -> None:
    masks = [WHOLE if k in whole else CUT for k in range(FRAMES)]
    segmenter("known", following(masks, []))
    video = Video.of(numbered(tmp_path / "later.avi"))
    views = []
    for refuse in (False, True):
        part = Segmentation(video, Extraction("known"), ALL)
        views.append(part.read(refuse_cut=refuse).view)
    np.testing.assert_array_equal(views[0].bits, views[1].bits)
    np.testing.assert_array_equal(views[0].usable, views[1].usable)
    assert views[1].usable.any()


def test_a_film_in_which_another_moves_is_not_refused_soon(
    segmenter: Register, tmp_path: Path
) -> None:
    """A network may report somebody at the edge, while another is whole."""
    segmenter("known", following([CUT] * FRAMES, []), still_background=False)
    # back and forth, 1.4 pixels a frame
    walker = [box(100, 100 + round(abs(1.4 * k % 56 - 28))) for k in range(FRAMES)]
    video = Video.of(numbered(tmp_path / "two.avi", walker))
    read = Segmentation(video, Extraction("known"), ALL).read(refuse_cut=True)
    assert len(read.view) == FRAMES
    alone = Video.of(numbered(tmp_path / "one.avi"))
    part = Segmentation(alone, Extraction("known"), ALL)
    with pytest.raises(NoPersonError, match="looked at"):
        part.read(refuse_cut=True)
