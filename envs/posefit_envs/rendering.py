"""Pictures of an environment: the silhouettes on each other, the body from its side, and the cost in words."""

from abc import ABC, abstractmethod
from typing import Any

import cv2
import gymnasium as gym
import numpy as np
from gymnasium import error
from numpy.typing import NDArray

from posefit import PoseProblem
from posefit.arrays import Array
from posefit.output.drawing import BACKGROUND, BOTH, MISSED, SPILLED, TEXT, side_view
from posefit.silhouette.cost import project

MODES = ("rgb_array", "human")
HEIGHT = 240  # pixels
STRIP = 30  # pixels for the words below

Picture = NDArray[np.uint8]  # (height, width, 3) red, green, blue


def check_mode(mode: str | None) -> None:
    """Return nothing. Raises gymnasium.error.UnsupportedMode for an unknown render mode."""
    if mode is not None and mode not in MODES:
        raise error.UnsupportedMode(f"render_mode must be one of {', '.join(MODES)}, got {mode!r}")


def render_frame(problem: PoseProblem, pose: Array | None, translation: Array | None, label: str) -> Picture:
    """Return the picture: each view with both, missed and spilled pixels in three colours, and the body's side."""
    panels = []
    for camera, silhouette in zip(problem.cameras, problem.silhouettes, strict=True):
        mask = silhouette.mask
        body = np.zeros_like(mask)
        if pose is not None and translation is not None:
            body = project(problem.body, camera, pose, translation)
        image = np.full((*mask.shape, 3), BACKGROUND, dtype=np.uint8)
        image[mask & ~body], image[body & ~mask], image[mask & body] = MISSED, SPILLED, BOTH
        width = 2 * round(mask.shape[1] * HEIGHT / mask.shape[0] / 2)
        panels.append(cv2.resize(image, (width, HEIGHT), interpolation=cv2.INTER_NEAREST))
    if pose is not None and translation is not None:
        panels.append(side_view(problem.body, problem.cameras[0], pose, translation, HEIGHT))
    else:
        panels.append(np.full((HEIGHT, HEIGHT, 3), BACKGROUND, dtype=np.uint8))
    image = np.hstack(panels)
    words = np.full((STRIP, image.shape[1], 3), BACKGROUND, dtype=np.uint8)
    cv2.putText(words, label, (8, 21), cv2.FONT_HERSHEY_SIMPLEX, 0.6, TEXT, 1, cv2.LINE_AA)
    return np.ascontiguousarray(np.vstack([image, words])[..., ::-1])


class RenderedEnv(gym.Env[Any, Any], ABC):
    """A single environment that can be rendered; its pygame window is opened when it is first needed."""

    metadata = {"render_modes": list(MODES), "render_fps": 10}  # noqa: RUF012, as Gymnasium has it

    def __init__(self, render_mode: str | None) -> None:
        check_mode(render_mode)
        self.render_mode = render_mode
        self._window: Any = None

    def render(self) -> Any:
        """Return the picture (height, width, 3), or show it, as `render_mode` asks.

        Raises gymnasium.error.DependencyNotInstalled where it cannot be shown, without pygame or without a display.
        """
        if self.render_mode is None:
            return None
        picture = self._render_frame()
        if self.render_mode == "rgb_array":
            return picture
        try:
            import pygame
        except ImportError:
            raise error.DependencyNotInstalled(
                "render_mode human needs pygame: install it with python -m pip install 'posefit[human]'"
            ) from None
        try:
            if self._window is None:
                pygame.display.init()
                self._window = pygame.display.set_mode((picture.shape[1], picture.shape[0]))
                self._clock = pygame.time.Clock()
        except pygame.error as cause:
            raise error.DependencyNotInstalled(
                f"render_mode human needs a display, got none ({cause}); use render_mode rgb_array instead"
            ) from None
        self._window.blit(pygame.surfarray.make_surface(picture.swapaxes(0, 1)), (0, 0))
        pygame.event.pump()
        pygame.display.flip()
        self._clock.tick(self.metadata["render_fps"])
        return None

    def close(self) -> None:
        """Close the window, if it is open."""
        if self._window is not None:
            import pygame

            pygame.display.quit()
            pygame.quit()
            self._window = None

    def _update_window(self) -> None:
        if self.render_mode == "human":
            self.render()

    @abstractmethod
    def _render_frame(self) -> Picture:
        """Return the picture (height, width, 3) of the current state."""
