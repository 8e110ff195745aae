"""Converts images of GenICam cameras to red, green and blue bytes."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from o80.base.arrays import Image
from o80.base.extras import needed

PixelFormat = Literal["BayerRG8", "BayerGB8", "BayerGR8", "BayerBG8", "RGB8", "BGR8", "Mono8"]
# GenICam names the colours of the first two pixels of the first row
PATTERNS = {"BayerRG8": "RGGB", "BayerGB8": "GBRG", "BayerGR8": "GRBG", "BayerBG8": "BGGR"}


def rgb_of(content: Image, size: tuple[int, int], pixel_format: PixelFormat) -> Image:
    """Decodes an image (height, width, 3). Raises ValueError for a wrong size, MissingExtra."""
    width, height = size
    channels = 3 if pixel_format in ("RGB8", "BGR8") else 1
    if content.size < width * height * channels:
        raise ValueError(
            f"an image of {content.size} bytes is too small for {width} x {height} pixels of "
            f"{pixel_format}"
        )
    pixels = content[: width * height * channels].reshape(height, width, channels)
    if pixel_format == "RGB8":
        return pixels
    if pixel_format == "BGR8":
        return np.ascontiguousarray(pixels[..., ::-1])
    if pixel_format == "Mono8":
        return np.repeat(pixels, 3, axis=-1)
    cv2: Any = needed("cv2", "cameras", "colours of Bayer patterns", package="o80-devices")
    code = getattr(cv2, f"COLOR_Bayer{PATTERNS[pixel_format]}2RGB")
    image: Image = cv2.cvtColor(pixels[..., 0], code)
    return image
