"""Follow one of several people with a segmenter that reports one person only.

Such a segmenter, for example a network, reports one person of each frame, and not
always the same one. A second segmenter, for example of the still background, finds all
people and tells which of them it is.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from posefit.footage.people import (
    Persons,
    Tracklet,
    excluded_mask,
    person_indices,
    replace_detection,
    rows_of,
)
from posefit.footage.quality import verdict
from posefit.footage.scanner import Progress, Scan, Scanner
from posefit.footage.views import MOST, View
from posefit.silhouette.foreground import Image


def with_identities(
    all_people: Scanner, single: Scanner, scan: Scan, progress: Progress | None
) -> Scan:
    """Return the scan of a segmenter that reports one person only, with identities.

    The segmenter runs again with the background pasted over everyone except the person
    who is followed. In frames where it still shows another person, the mask of the
    second segmenter is used.

    Nothing changes if the second segmenter finds one person only, or if its masks of
    everyone are poor.

    Args:
        all_people: A pass by the second segmenter, which finds all people.
        single: A pass by the segmenter that reports one person only.
        scan: What that pass found.
        progress: Shows the progress of further passes.

    Returns:
        A scan that follows the person whom the user chose. By default this is the first
        person, or the one whom `single` shows most often if it does not find the first.
    """
    everyone = all_people.scan(progress)
    persons = everyone.people.persons()
    if len(persons) < 2 or everyone.view.moves:
        return scan
    learned = all_people.segmenter.learned
    doubts = [
        verdict(
            rows_of(person, everyone.blanks)[1], all_people.how.name, learned=learned
        )
        for person in persons
    ]
    # poor masks of everyone do not show which person is which
    if all(doubts):
        return scan
    indices = person_indices(persons, scan.view.masks())
    if not any(index is not None for index in indices):
        return scan
    choices = [all_people.how.person]
    if all_people.how.person is None:
        most = max(range(len(persons)), key=indices.count)
        choices = [1] if most == 0 else [1, 1 + most]
    for choice in choices:
        parts, _ = everyone.people.chosen(choice, str, 1.0 / all_people.video.scale)
        others = everyone.people.others(parts)
        scan = _without_others(all_people, single, parts, others, progress)
        frames = _frames_of(parts, persons, scan)
        detected = {frame for part in parts for frame in part.detections}
        if len(frames) >= MOST * len(detected):
            break
    for k, mask in enumerate(scan.view.masks()):
        if k in frames:
            replace_detection(parts, k, mask, scan.largest[k])
    view = _merged(everyone.view, scan.view, frames)
    return everyone._replace(view=view, choice=choice)


def _frames_of(parts: Sequence[Tracklet], persons: Persons, scan: Scan) -> list[int]:
    """Return the frames in which a scan shows the person with these parts."""
    frames = list[int]()
    for k, index in enumerate(person_indices(persons, scan.view.masks())):
        if index is not None and persons[index] == parts:
            frames.append(k)
    return frames


def _without_others(
    all_people: Scanner,
    single: Scanner,
    parts: Sequence[Tracklet],
    others: Sequence[Tracklet],
    progress: Progress | None,
) -> Scan:
    """Return another pass of `single`, with the background pasted over the others.

    Args:
        all_people: The pass that found the background.
        single: The pass by the segmenter that reports one person only.
        parts: The parts of the person who is followed.
        others: The parts of all other people.
        progress: Shows the progress of the pass.
    """

    def changed(k: int, image: Image) -> Image:
        excluded = excluded_mask(parts, others, k, all_people.video.size)
        return all_people.segmenter.without(image, excluded)

    return single.again().scan(progress, changed)


def _merged(everyone: View, single: View, frames: Sequence[int]) -> View:
    """Return a view that takes what is known in some frames from another pass.

    In all other frames it has neither landmarks nor facings.
    """
    # every pass states all of these
    assert single.known is not None
    assert everyone.known is not None
    assert single.landmarks is not None
    assert single.facings is not None
    used = np.zeros(len(single), dtype=bool)
    used[frames] = True
    return replace(
        everyone,
        known=np.where(used[:, None], single.known, everyone.known),
        landmarks=np.where(used[:, None, None], single.landmarks, 0.0),
        facings=np.where(used, single.facings, np.nan),
    )
