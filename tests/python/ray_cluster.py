"""Ray's own cluster of several machines, all of which are this one."""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ATTEMPTS = 4
SETTINGS = {
    "RAY_USAGE_STATS_ENABLED": "0",
    # a machine that is busy with other tests is slow, not dead
    "RAY_gcs_server_port_wait_time_s": "300",
    "RAY_health_check_timeout_ms": "60000",
    "RAY_worker_register_timeout_seconds": "300",
    "RAY_memory_monitor_refresh_ms": "0",
    "PYTHONPATH": str(Path(__file__).parent),  # so that actors find the modules of the tests
}
NODE = {"num_cpus": 1, "object_store_memory": 80 << 20}  # [B]


@contextlib.contextmanager
def ray_cluster() -> Iterator[Any]:
    """Two raylets with a processor each, and this process connected to them."""
    import ray

    folder = tempfile.mkdtemp(prefix="ray-", dir="/tmp")  # short: paths of sockets go below it
    with pytest.MonkeyPatch.context() as patch:
        for name, value in (SETTINGS | {"RAY_TMPDIR": folder}).items():
            patch.setenv(name, value)
        try:
            cluster = started(folder)
            ray.init(address=cluster.address, log_to_driver=False)
            yield cluster
            ray.shutdown()
            cluster.shutdown()
        finally:
            ray.shutdown()
            end_processes_of(folder)
            shutil.rmtree(folder, ignore_errors=True)


def started(folder: str) -> Any:
    """A cluster. Ray gives each node 30 s to start, which is too short on a busy machine."""
    from ray.cluster_utils import Cluster

    for attempt in range(1, ATTEMPTS + 1):
        try:
            cluster = Cluster(
                initialize_head=True, head_node_args={**NODE, "include_dashboard": False}
            )
            cluster.add_node(**NODE)
        except Exception:
            end_processes_of(folder)
            if attempt == ATTEMPTS:
                raise
        else:
            return cluster
    raise AssertionError


def end_processes_of(folder: str) -> None:
    """Ends those that name the folder among their arguments."""
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError):
            if folder in (process / "cmdline").read_text():
                os.kill(int(process.name), signal.SIGKILL)
