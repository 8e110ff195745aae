"""Put a backend into a Python program with its own loop; any frontend may send commands."""

import threading
import time

import numpy as np

import o80

MOTOR = np.dtype([("position", float), ("velocity", float)])


def command() -> None:
    """Sends commands, as another process would."""
    with o80.Frontend("gripper") as frontend:
        frontend.add_command("left", {"position": 0.02, "velocity": 0.0}, iterations=50)
        frontend.add_command("right", {"position": -0.02}, iterations=50)
        observation = frontend.pulse_and_wait(timeout=10.0)
        print("closed to", observation.observed["position"].round(4))


with o80.Backend("gripper", ["left", "right"], MOTOR, frequency=200) as backend:
    fingers = np.zeros(2, MOTOR)
    backend.publish(fingers)  # row 0
    commander = threading.Thread(target=command)
    commander.start()
    due = time.monotonic()
    while commander.is_alive():
        desired = backend.step()
        fingers[:] = desired  # simulated: the fingers follow at once
        due += 0.005
        time.sleep(max(0.0, due - time.monotonic()))
        backend.publish(fingers)
    commander.join()
