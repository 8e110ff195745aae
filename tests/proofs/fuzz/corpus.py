"""The corpus: inputs that each reach something new, or that once broke something.

corpus/<fuzzer>.tar.xz holds the inputs of a fuzzer. They are unpacked into build/fuzz/corpus, where
fuzzers read them. The same inputs make the same archive: names are sorted, and times and owners
are left out.
"""

import hashlib
import io
import shutil
import tarfile
from pathlib import Path

from checkout import ROOT

ARCHIVES = Path(__file__).with_name("corpus")
UNPACKED = ROOT / "build" / "fuzz" / "corpus"


def archive_of(fuzzer: str) -> Path:
    return ARCHIVES / f"{fuzzer}.tar.xz"


def read(fuzzer: str) -> dict[str, bytes]:
    """The packed inputs of a fuzzer by name; none if nothing was packed yet."""
    archive = archive_of(fuzzer)
    if not archive.exists():
        return {}
    with tarfile.open(archive, "r:xz") as packed:
        files = ((member.name, packed.extractfile(member)) for member in packed)
        return {name: file.read() for name, file in files if file is not None}


def unpack(fuzzer: str) -> Path:
    """The folder with exactly the packed inputs of a fuzzer."""
    folder = UNPACKED / fuzzer
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    for name, content in read(fuzzer).items():
        (folder / Path(name).name).write_bytes(content)
    return folder


def pack(fuzzer: str, folder: Path) -> int:
    """Packs the inputs of a folder, each named by its content; how many were not packed before."""
    contents = (file.read_bytes() for file in folder.iterdir() if file.is_file())
    inputs = {hashlib.sha1(content).hexdigest(): content for content in contents}
    known = read(fuzzer)
    if inputs == known:
        return 0
    ARCHIVES.mkdir(exist_ok=True)
    with tarfile.open(archive_of(fuzzer), "w:xz", format=tarfile.USTAR_FORMAT) as packed:
        for name, content in sorted(inputs.items()):
            member = tarfile.TarInfo(name)
            member.size = len(content)
            packed.addfile(member, io.BytesIO(content))
    return len(inputs.keys() - known.keys())
