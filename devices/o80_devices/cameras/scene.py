"""Renders a room with the table and a ball through the lenses of a rig's cameras.

The ball is integrated over the exposure, so that a fast one is a streak; its edge is antialiased,
distorted by the lens, and lit from above. Backgrounds with noise are rendered in advance.
"""

from __future__ import annotations

import numpy as np

from o80.base.arrays import FloatArray, Image
from o80_devices.cameras.flight import Table
from o80_devices.cameras.rig import Rig

BALL = np.array([245.0, 130.0, 35.0])
FLOOR = np.array([[112.0, 104.0, 96.0], [124.0, 117.0, 108.0]])
WALL = np.array([150.0, 152.0, 156.0])
TOP = np.array([32.0, 74.0, 128.0])
LINE = np.array([225.0, 226.0, 228.0])
LINE_WIDTH = 0.02  # [m]
TILE = 0.5  # [m]
LIGHT = np.array([0.2, -0.1, 0.97])
MOMENTS = 6  # samples of an exposure


class Scene:
    """Renders the images of all cameras of a rig.

    exposure: duration, with the time of the image in the middle [s].
    noise: standard deviation of a pixel value, out of 255.
    variations: number of noisy copies of a background, used in turn.
    """

    def __init__(
        self,
        rig: Rig,
        *,
        exposure: float = 0.002,
        noise: float = 3.0,
        variations: int = 4,
        seed: int = 0,
    ) -> None:
        self._cameras = rig.models()
        self._sizes = [camera.size for camera in rig.cameras]
        self._focal = [max(camera.focal) for camera in rig.cameras]
        self._radius = rig.flight.radius
        self._exposure = exposure
        self._noise = noise
        self._random = np.random.default_rng(seed)
        self._rays = [self._directions(i) for i in range(len(self._cameras))]
        self._backgrounds = [
            self._with_noise(self._background(i, rig.table), variations)
            for i in range(len(self._cameras))
        ]
        self._images = 0

    def image(
        self,
        camera: int,
        position: FloatArray | None = None,
        velocity: FloatArray | None = None,
        into: Image | None = None,
    ) -> Image:
        """Renders an image. position: None: no ball. into: (height, width, 3), to be filled."""
        backgrounds = self._backgrounds[camera]
        self._images += 1
        prepared = backgrounds[self._images % len(backgrounds)]
        if into is None:
            into = prepared.copy()
        else:
            into[...] = prepared
        if position is not None:
            self._draw(camera, into, position, np.zeros(3) if velocity is None else velocity)
        return into

    def _directions(self, camera: int) -> FloatArray:
        """Returns the viewing direction of each pixel (height, width, 3); NaN: none."""
        width, height = self._sizes[camera]
        x, y = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
        pixels = np.stack([x.ravel(), y.ravel()], axis=1)
        return self._cameras[camera].directions(pixels).reshape(height, width, 3)

    def _background(self, camera: int, table: Table | None) -> FloatArray:
        rays, place = self._rays[camera], self._cameras[camera].place
        down = np.minimum(rays[..., 2], -1e-9)
        floor = place + rays * (-place[2] / down)[..., np.newaxis]
        tile = (np.floor(floor[..., 0] / TILE) + np.floor(floor[..., 1] / TILE)) % 2
        seen: FloatArray = FLOOR[np.nan_to_num(tile).astype(int)]
        far = ~(np.linalg.norm(floor[..., :2] - place[:2], axis=-1) < 6.0)
        seen[far] = WALL
        if table is not None:
            top = place + rays * ((table.middle[2] - place[2]) / down)[..., np.newaxis]
            beside = np.abs(top[..., :2] - table.middle[:2])
            inside = np.array(table.half) - beside
            on_top = (inside > 0).all(-1)
            line = (inside.min(-1) < LINE_WIDTH) | (beside[..., 0] < LINE_WIDTH / 4)
            seen[on_top] = TOP
            seen[on_top & line] = LINE
        return seen

    def _with_noise(self, background: FloatArray, variations: int) -> list[Image]:
        shape, noises = background.shape, []
        for _ in range(variations):
            noise = self._noise * self._random.standard_normal(shape, np.float32)
            noises.append(np.clip(np.rint(background + noise), 0, 255).astype(np.uint8))
        return noises

    def _draw(self, camera: int, image: Image, position: FloatArray, velocity: FloatArray) -> None:
        """Draws the ball into the rectangle of its motion during the exposure."""
        share = (np.arange(MOMENTS) + 0.5) / MOMENTS - 0.5
        places = position + np.outer(share * self._exposure, velocity)
        seen = self._cameras[camera].project(np.ascontiguousarray(places))
        if not np.isfinite(seen).all():
            return
        margin = 3 + self._radius * self._focal[camera] / seen[:, 2].min()
        width, height = self._sizes[camera]
        left, top = np.maximum(np.floor(seen[:, :2].min(0) - margin), 0).astype(int)
        right, bottom = (np.ceil(seen[:, :2].max(0) + margin) + 1).astype(int)
        patch = image[top : min(bottom, height), left : min(right, width)]
        rays = self._rays[camera][top : min(bottom, height), left : min(right, width)]
        if patch.size == 0:
            return

        # ray of each pixel, ball at each sample => covered share of the pixel, light
        towards = (places - self._cameras[camera].place).T
        along = rays @ towards
        size = (towards**2).sum(0)
        aside2 = np.maximum(0, size - along**2)
        per_metre = self._focal[camera] / np.sqrt(size)
        part = np.clip(0.5 + (self._radius - np.sqrt(aside2)) * per_metre, 0, 1)
        to_light = (rays @ LIGHT)[..., np.newaxis]
        bulge = np.sqrt(np.maximum(0, 1 - aside2 / self._radius**2))
        shade = (along * to_light - LIGHT @ towards) / self._radius - bulge * to_light
        covered = part.sum(-1)
        light = (part * (0.62 + 0.38 * np.clip(shade, 0, 1))).sum(-1)
        noise = self._random.normal(0, self._noise, patch.shape)
        mixed = patch * (1 - covered / MOMENTS)[..., np.newaxis]
        mixed = mixed + (light / MOMENTS)[..., np.newaxis] * BALL
        mixed += noise * (covered / MOMENTS)[..., np.newaxis]
        patch[...] = np.clip(np.round(np.nan_to_num(mixed)), 0, 255).astype(np.uint8)
