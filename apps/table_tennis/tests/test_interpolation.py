"""Values between the steps of an integration."""

import numpy as np

from o80_table_tennis.physics.interpolation import along_path


def test_a_path_goes_through_its_nodes_and_jumps_at_a_bounce() -> None:
    times = np.array([0.0, 1.0, 1.0, 2.0])
    nodes = np.array(
        [
            [0.0, 0, 0, 1.0, 0, 0],
            [1.0, 0, 0, 1.0, 0, 0],
            [1.0, 0, 0, -2.0, 0, 0],
            [-1.0, 0, 0, -2.0, 0, 0],
        ]
    )

    positions, velocities = along_path(np.array([0.5, 1.0, 1.5, 2.5]), nodes, times)

    np.testing.assert_allclose(positions[:, 0], [0.5, 1.0, 0.0, -2.0])
    np.testing.assert_allclose(velocities[:, 0], [1.0, -2.0, -2.0, -2.0])
