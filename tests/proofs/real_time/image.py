"""The initial file system of the machine: busybox, our static programs, cyclictest."""

import re
import shutil
import subprocess
from pathlib import Path

# dynamic programs of Debian that come with their libraries
GUESTS = ("cyclictest", "chrt", "prlimit")


def libraries(program: Path) -> set[Path]:
    """Shared libraries of a program, its loader among them."""
    listed = subprocess.run(["ldd", program], capture_output=True, text=True, check=True)
    return {Path(path) for path in re.findall(r"(/\S+) \(0x", listed.stdout)}


def stage(root: Path, programs: list[Path], init: str = "init.sh") -> None:
    """Lays all out in a folder as the machine will see it. init: script of its first process."""
    shutil.rmtree(root, ignore_errors=True)
    for folder in ("bin", "dev", "etc", "o80", "proc", "sys", "tmp"):
        (root / folder).mkdir(parents=True)
    (root / "etc/passwd").write_text(
        "root:x:0:0:root:/:/bin/sh\nnobody:x:65534:65534:nobody:/:/bin/sh\n"
    )
    busybox = shutil.which("busybox")
    assert busybox is not None, "tools/setup.sh installs busybox-static"
    shutil.copy(busybox, root / "bin/busybox")
    (root / "bin/sh").symlink_to("busybox")
    shutil.copy(Path(__file__).with_name(init), root / "init")
    (root / "init").chmod(0o755)
    for program in programs:
        subprocess.run(["strip", "-o", root / "o80" / program.name, program], check=True)
    for guest in GUESTS:
        found = shutil.which(guest)
        assert found is not None, "tools/setup.sh installs rt-tests"
        shutil.copy(found, root / "bin" / guest)
        for library in libraries(Path(found)):
            place = root / library.relative_to("/")
            place.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(library.resolve(), place)


def make_image(image: Path, programs: list[Path], init: str = "init.sh") -> None:
    """Packs the folder beside it that bears its name."""
    stage(image.with_suffix(""), programs, init)
    pack(image)


def pack(image: Path) -> None:
    """Makes an initial file system of the folder beside it that bears its name."""
    root = image.with_suffix("")
    names = "\n".join(str(path.relative_to(root)) for path in sorted(root.rglob("*")))
    with image.open("wb") as output:
        subprocess.run(
            ["cpio", "--quiet", "-o", "-H", "newc", "-R", "+0:+0"],
            cwd=root, input=names.encode(), stdout=output, check=True,
        )  # fmt: skip
