"""Films of two calibrated cameras, rendered for the page about two phones: a chessboard, and a walk."""

from pathlib import Path

import cv2
import numpy as np

from posefit import Body, Camera
from posefit.arrays import Array
from posefit.motion import built_in
from posefit.output.drawing import draw_body

# as on the page; TEXEL: pixels of a square in the board's own picture
COLUMNS = 8
ROWS = 5
SQUARE = 0.06
TEXEL = 60
SIZE = (1920, 1080)
# so wide that a person who walks near the board is whole in the picture
MATRIX = np.array([[1100.0, 0.0, 960.0], [0.0, 1100.0, 540.0], [0.0, 0.0, 1.0]])
# metres from the middle of the board on the floor
EYES = np.array([[2.87, 0.89, 1.3], [0.51, 2.96, 1.3]])
# from the world of posefit, where y is up, to that of the board, where z is
Z_UP = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
# the walk is turned, so that it crosses the pictures of both cameras
ACROSS = cv2.Rodrigues(np.radians([0.0, 0.0, 59.0]))[0]
EMPTY = 30  # frames of the walk's films before the person appears


def looking(eye: Array) -> tuple[Array, Array]:
    """Return the rotation and translation of a camera that looks at a place above the floor."""
    ahead = np.array([0.0, 0.0, 0.6]) - eye
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    axes = np.array(
        [axis / np.linalg.norm(axis) for axis in (right, np.cross(ahead, right), ahead)]
    )
    return axes, -axes @ eye


def boards() -> list[tuple[Array, Array]]:
    """Return the board's axes and place: on the floor, then in a hand, tilted at random."""
    rng = np.random.default_rng(0)
    towards = np.array([*(EYES[0] + EYES[1])[:2], 0.6])
    across = np.cross([0.0, 0.0, 1.0], towards)
    axes = (across, np.cross(across, towards), -towards)
    facing = np.column_stack([axis / np.linalg.norm(axis) for axis in axes])
    held = [facing @ cv2.Rodrigues(rng.uniform(-0.5, 0.5, 3))[0] for _ in range(12)]
    places = np.column_stack(
        [rng.uniform(-0.4, 0.4, (12, 2)), rng.uniform(0.3, 1.2, 12)]
    )
    return [(np.diag([1.0, -1.0, -1.0]), np.zeros(3)), *zip(held, places, strict=True)]


def write_boards(folder: Path) -> None:
    """Write `board-a.mp4` and `board-b.mp4`."""
    squares = np.indices((ROWS + 1, COLUMNS + 1)).sum(axis=0) % 2 * 255
    picture = np.pad(
        np.kron(squares, np.ones((TEXEL, TEXEL))), TEXEL, constant_values=255
    ).astype(np.uint8)
    size = SQUARE / TEXEL
    corner = -2.0 * SQUARE
    texels = np.array([[size, 0.0, corner], [0.0, size, corner], [0.0, 0.0, 1.0]])
    for name, eye in zip("ab", EYES, strict=True):
        turn, move = looking(eye)
        writer = _writer(folder / f"board-{name}.mp4")
        for axes, place in boards():
            plane = MATRIX @ np.column_stack(
                [(turn @ axes)[:, :2], turn @ place + move]
            )
            shown = cv2.warpPerspective(picture, plane @ texels, SIZE, borderValue=128)
            for _ in range(10):
                writer.write(cv2.cvtColor(shown, cv2.COLOR_GRAY2BGR))
        writer.release()


def write_walks(folder: Path) -> None:
    """Write `walk-a.mp4` and `walk-b.mp4`: a second of the empty room, then a person who walks past both cameras."""
    walk = built_in.motion("walk", frames=30, fps=30.0)
    body = Body.of(walk.skeleton)
    middle = walk.translations.mean(axis=0) * [1.0, 0.0, 1.0]
    rng = np.random.default_rng(0)
    for name, eye in zip("ab", EYES, strict=True):
        turn, move = looking(eye)
        camera = Camera(
            *SIZE, MATRIX[[0, 1], [0, 1]], MATRIX[:2, 2], turn @ ACROSS @ Z_UP, move
        )
        room = rng.uniform(20, 70, (SIZE[1], SIZE[0], 3)).astype(np.uint8)
        room = cv2.GaussianBlur(room, (0, 0), 3)
        writer = _writer(folder / f"walk-{name}.mp4")
        for k in range(-EMPTY, len(walk)):
            image = room.copy()
            if k >= 0:
                draw_body(
                    image, body, camera, walk.poses[k], walk.translations[k] - middle
                )
            writer.write(image)
        writer.release()


def _writer(path: Path) -> cv2.VideoWriter:
    return cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 30.0, SIZE)
