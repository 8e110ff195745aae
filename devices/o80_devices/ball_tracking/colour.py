"""Probability that a pixel of a colour shows the ball: a table of 32 x 32 x 32 colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from o80.errors import InvalidArgument

LEVELS = 32
ColourTable = NDArray[np.uint8]


def _levels() -> NDArray[np.float64]:
    """Returns the colours of the table (32, 32, 32, 3), from 0 to 1."""
    middle = (np.arange(LEVELS) + 0.5) / LEVELS
    return np.stack(np.meshgrid(middle, middle, middle, indexing="ij"), axis=-1)


def of_hue(
    hue: float = 28.0, width: float = 16.0, saturation: float = 0.45, value: float = 0.3
) -> ColourTable:
    """Builds the table of a saturated colour; the default is the orange of a table-tennis ball.

    hue, width: hue of the ball, and difference at which the probability is one half [degrees].
    saturation, value: least values of a ball.
    """
    rgb = _levels()
    largest, smallest = rgb.max(-1), rgb.min(-1)
    chroma = np.maximum(largest - smallest, 1e-9)
    red, green, blue = (rgb[..., i] for i in range(3))
    sector = np.select(
        [largest == red, largest == green],
        [((green - blue) / chroma) % 6.0, (blue - red) / chroma + 2.0],
        (red - green) / chroma + 4.0,
    )
    apart = np.abs((60.0 * sector - hue + 180.0) % 360.0 - 180.0)
    likely = 1 / (1 + np.exp((apart - width) / 3.0))
    likely *= 1 / (1 + np.exp(-(chroma / largest - saturation) / 0.05))
    likely *= 1 / (1 + np.exp(-(largest - value) / 0.03))
    table: ColourTable = np.round(255 * likely).astype(np.uint8).ravel()
    return table


def of_examples(
    ball: NDArray[np.uint8], others: NDArray[np.uint8], share: float = 0.1
) -> ColourTable:
    """Builds the table from example pixels: (n, 3) of balls, (m, 3) of everything else.

    share: fraction of ball pixels in a searched region. Similar colours count, too, so
    that a few hundred pixels are enough. Raises InvalidArgument without pixels.
    """
    if len(ball) == 0 or len(others) == 0:
        raise InvalidArgument(
            f"ball and others must each have a pixel, got {len(ball)} and {len(others)}"
        )
    of_ball, of_others = _density(ball), _density(others)
    likely = share * of_ball / np.maximum(share * of_ball + (1 - share) * of_others, 1e-12)
    table: ColourTable = np.round(255 * likely).astype(np.uint8).ravel()
    return table


def _density(pixels: NDArray[np.uint8]) -> NDArray[np.float64]:
    """Frequency of each colour, smoothed over neighbouring colours."""
    index = (np.asarray(pixels, np.uint8).reshape(-1, 3) >> 3).astype(np.intp)
    count = np.zeros((LEVELS,) * 3)
    np.add.at(count, tuple(index.T), 1.0)
    kernel = np.array([0.25, 0.5, 0.25])
    for _ in range(3):
        for axis in range(3):
            padded = np.pad(count, [(1, 1) if i == axis else (0, 0) for i in range(3)], "edge")
            parts = [np.take(padded, range(k, k + LEVELS), axis) for k in range(3)]
            count = sum(w * part for w, part in zip(kernel, parts, strict=True))
    # colours without an example are most likely not the ball
    density: NDArray[np.float64] = (count + 1e-6) / count.sum()
    return density


def save(table: ColourTable, path: Path | str) -> None:
    np.save(path, table, allow_pickle=False)


def load(path: Path | str) -> ColourTable:
    """Reads a table. Raises InvalidArgument if the file holds none."""
    try:
        table: ColourTable = np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise InvalidArgument(f"the colours {path} cannot be read: {error}") from error
    if table.dtype != np.uint8 or table.size != LEVELS**3:
        raise InvalidArgument(f"{path} holds no table of 32 x 32 x 32 bytes")
    return np.ascontiguousarray(table.ravel())
