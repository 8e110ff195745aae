"""A PREEMPT_RT kernel, from Debian's package, without installing it."""

import re
import subprocess
from pathlib import Path

META_PACKAGE = "linux-image-rt-amd64"  # depends on the image of the day


class NoKernelError(Exception):
    """What went wrong, and what to do about it."""


def image_package() -> str:
    """Name of the package that holds the image."""
    shown = subprocess.run(
        ["apt-cache", "depends", META_PACKAGE], capture_output=True, text=True, check=False
    )
    found = re.search(r"Depends: (linux-image-\S+-rt-amd64)", shown.stdout)
    if found is None:
        raise NoKernelError(
            f"apt knows no package {META_PACKAGE}: run `apt-get update` as root on a Debian "
            "machine, or give a PREEMPT_RT kernel with --kernel"
        )
    return found[1]


def obtain_kernel(folder: Path) -> Path:
    """The kernel's file in a folder; downloaded only if none is there."""
    if kept := sorted(folder.glob("vmlinuz-*-rt-amd64")):
        return kept[-1]
    package = image_package()
    kernel = folder / f"vmlinuz-{package.removeprefix('linux-image-')}"
    folder.mkdir(parents=True, exist_ok=True)
    subprocess.run(["apt-get", "download", package], cwd=folder, check=False)
    archives = sorted(folder.glob(f"{package}_*.deb"))
    if not archives:
        raise NoKernelError(
            f"{package} could not be downloaded: see what `apt-get download {package}` says, run "
            "`apt-get update` as root, or give a PREEMPT_RT kernel with --kernel"
        )
    # of 70 MB only the kernel itself: all that the machine needs is built into it
    part = folder / "kernel.part"
    with (
        part.open("wb") as output,
        subprocess.Popen(
            ["dpkg-deb", "--fsys-tarfile", archives[-1]], stdout=subprocess.PIPE
        ) as archive,
    ):
        subprocess.run(
            ["tar", "-xO", f"./boot/{kernel.name}"],
            stdin=archive.stdout, stdout=output, check=True,
        )  # fmt: skip
    part.rename(kernel)
    for each in archives:
        each.unlink()
    return kernel
