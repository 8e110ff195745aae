"""Put a bursting backend into a Python simulation: it waits until a frontend requests steps."""

import threading
from collections.abc import Callable

import numpy as np

import o80


def learn(world_ends: Callable[[], None]) -> None:
    """Steps the simulation, as a learner in another process would."""
    with o80.Frontend("pendulum") as world:
        for step in range(3):
            world.add_command("torque", 0.5 * step)
            observation = world.burst(100)
            print(
                f"iteration {observation.iteration}: angle {observation.extended['angle']:.3f} rad"
            )
    world_ends()


SENSORS = np.dtype([("angle", float), ("speed", float)])

with o80.Backend("pendulum", ["torque"], extended=SENSORS, frequency=500, bursting=True) as backend:
    angle, speed = 0.1, 0.0
    backend.publish([0.0], (angle, speed))
    learner = threading.Thread(target=learn, args=(backend.stop,))
    learner.start()
    while (desired := backend.step()) is not None:  # waits until a frontend requests iterations
        speed += 0.002 * (desired[0] - 9.81 * np.sin(angle))
        angle += 0.002 * speed
        backend.publish(desired, (angle, speed))
    learner.join()
