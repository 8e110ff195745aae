"""A PREEMPT_RT kernel, from Debian's package, without installing it."""

import re
import subprocess
from pathlib import Path

META_PACKAGE = "linux-image-rt-amd64"  # depends on the image of the day


class NoKernelError(Exception):
    """The kernel is missing: the text says why, and what to do about it."""


def image_package() -> str:
    """Name of the package that holds the image; apt's lists are renewed if they lack it."""
    for command in (None, ["apt-get", "update", "-qq"]):
        if command is not None:
            subprocess.run(command, check=False)
        shown = subprocess.run(
            ["apt-cache", "depends", META_PACKAGE], capture_output=True, text=True, check=False
        )
        if found := re.search(r"Depends: (linux-image-\S+-rt-amd64)", shown.stdout):
            return found[1]
    raise NoKernelError(
        f"apt knows no package {META_PACKAGE}: run `apt-get update` as root on a Debian "
        "machine, or give a PREEMPT_RT kernel with --kernel"
    )


def obtain_kernel(folder: Path) -> Path:
    """The file of the newest kernel that apt knows, downloaded to a folder if it is not there.

    Without a way to download it, the newest that is there.
    """
    folder.mkdir(parents=True, exist_ok=True)
    try:
        package = image_package()
        kernel = folder / f"vmlinuz-{package.removeprefix('linux-image-')}"
        if not kernel.exists():
            unpack_kernel(download(package, folder), kernel)
        return kernel
    except NoKernelError as error:
        kept = sorted(folder.glob("vmlinuz-*-rt-amd64"), key=lambda file: file.stat().st_mtime)
        if not kept:
            raise
        print(f"{error}. Taken is the kernel of an earlier run: {kept[-1].name}")
        return kept[-1]


def download(package: str, folder: Path) -> Path:
    """Downloads the archive of a package; apt's lists are renewed if they are too old for that."""
    for command in (None, ["apt-get", "update", "-qq"]):
        if command is not None:
            subprocess.run(command, check=False)
        subprocess.run(["apt-get", "download", package], cwd=folder, check=False)
        if archives := sorted(folder.glob(f"{package}_*.deb")):
            return archives[-1]
    raise NoKernelError(
        f"{package} could not be downloaded: see what `apt-get download {package}` says, run "
        "`apt-get update` as root, or give a PREEMPT_RT kernel with --kernel"
    )


def unpack_kernel(archive: Path, kernel: Path) -> None:
    """Unpacks only the kernel of 70 MB: all that the machine needs is built into it."""
    part = kernel.with_name("kernel.part")
    with (
        part.open("wb") as output,
        subprocess.Popen(["dpkg-deb", "--fsys-tarfile", archive], stdout=subprocess.PIPE) as all_of,
    ):
        subprocess.run(
            ["tar", "-xO", f"./boot/{kernel.name}"],
            stdin=all_of.stdout, stdout=output, check=True,
        )  # fmt: skip
    part.rename(kernel)
    archive.unlink()
