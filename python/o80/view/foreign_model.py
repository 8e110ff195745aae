"""Compiles an untrusted model: from a recording, or from the robot of another user.

Such a model may name any file of this computer, and its compilation may take all memory or never
end. So a model that names files is refused; any other is compiled by a separate process with
limits.
"""

import os
import subprocess
import sys
from functools import lru_cache
from typing import Any
from xml.etree import ElementTree

from o80.base.errors import Error

TIMEOUT = 20.0  # [s]
LARGEST = 256 << 20  # largest compiled model [bytes]
DEEPEST = 200  # bodies inside each other

# stdin: a model; stdout: the same, compiled
_PROGRAM = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
resource.setrlimit(resource.RLIMIT_CPU, (15, 15))
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
import mujoco, numpy
try:
    model = mujoco.MjSpec.from_string(sys.stdin.buffer.read().decode()).compile()
except (ValueError, MemoryError) as error:
    sys.exit(str(error) or "it needs too much memory")
content = numpy.empty(mujoco.mj_sizeModel(model), numpy.uint8)
mujoco.mj_saveModel(model, None, content)
sys.stdout.buffer.write(content.tobytes())
"""


@lru_cache(maxsize=8)
def compiled(mjcf: str, mujoco: Any) -> Any:
    """Compiles a model, which must not be changed. Raises Error if it is invalid or names files."""
    text = without_files(mjcf)
    try:
        done = subprocess.run(
            [sys.executable, "-I", "-c", _PROGRAM],
            input=text.encode(),
            capture_output=True,
            timeout=TIMEOUT,
            check=False,
            env={**os.environ, "OPENBLAS_NUM_THREADS": "1"},
        )
    except subprocess.TimeoutExpired:
        raise _unreadable(f"it was not compiled within {TIMEOUT:g} s") from None
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").strip()
        raise _unreadable(said.splitlines()[-1] if said else "it needs too much time or memory")
    if len(done.stdout) > LARGEST:
        raise _unreadable(f"compiled, it is larger than {LARGEST >> 20} MiB")
    return mujoco.MjModel.from_binary_path("model.mjb", {"model.mjb": done.stdout})


def without_files(mjcf: str) -> str:
    """Returns the model unchanged. Raises Error if it names a file or cannot be parsed."""
    if "<!" in mjcf.replace("<!--", "").replace("<![CDATA[", ""):
        raise _unreadable("it has a document type")  # which may define entities
    try:
        root = ElementTree.fromstring(mjcf)
    except (ElementTree.ParseError, ValueError) as error:
        raise _unreadable(str(error)) from error
    waiting = [(root, 0)]
    while waiting:
        element, depth = waiting.pop()
        if depth > DEEPEST:
            raise _unreadable(f"elements are nested more than {DEEPEST} deep")
        for name, value in element.attrib.items():
            if name.lower().startswith("file") and value:
                raise Error(
                    f"The model names a file, {value[:200]!r}, which is not read: the recording "
                    f"may come from a stranger. To read the files of models that you trust, give "
                    f"--model-files."
                )
        waiting += [(child, depth + 1) for child in element]
    return ElementTree.tostring(root, encoding="unicode")


def _unreadable(why: str) -> Error:
    return Error(f"the model of the robot cannot be read: {why}")
