"""The random generators of the copies, seeded like single environments of Gymnasium."""

from collections.abc import Sequence

import numpy as np
from gymnasium.utils import seeding
from numpy.typing import NDArray

from o80.base.errors import InvalidArgument

Seed = int | Sequence[int | None] | None


class Generators:
    """One generator for each copy; a copy without a seed gets one from the system."""

    def __init__(self, copies: int) -> None:
        self._generators: list[np.random.Generator | None] = [None] * copies
        self._seeds = [-1] * copies

    def seed(self, seed: Seed, copies: NDArray[np.intp]) -> None:
        """Seeds copy i with seed + i, or with entry i. Raises InvalidArgument for a wrong count."""
        if seed is None:
            return
        count = len(self._seeds)
        given: Sequence[int | None]
        if isinstance(seed, int | np.integer):
            given = [int(seed) + copy for copy in range(count)]
        else:
            given = list(seed)
        if len(given) != count:
            raise InvalidArgument(
                f"seed must be a number or one for each of the {count} copies, got {len(given)}"
            )
        for copy in copies:
            wanted = given[copy]
            if wanted is not None:
                self._generators[copy], self._seeds[copy] = seeding.np_random(int(wanted))

    def of(self, copies: NDArray[np.intp]) -> list[np.random.Generator]:
        """Returns the generators of some copies."""
        return [self._of(copy) for copy in copies.tolist()]

    def seeds_of(self, copies: NDArray[np.intp]) -> list[int]:
        """Returns the seeds of some copies."""
        for copy in copies.tolist():
            self._of(copy)
        return [self._seeds[copy] for copy in copies.tolist()]

    def _of(self, copy: int) -> np.random.Generator:
        generator = self._generators[copy]
        if generator is None:
            generator, self._seeds[copy] = seeding.np_random()
            self._generators[copy] = generator
        return generator
