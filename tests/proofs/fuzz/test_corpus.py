"""Packing the corpus: what was packed comes back, and the same inputs make the same archive."""

from pathlib import Path

import pytest

from fuzz import corpus


@pytest.fixture(autouse=True)
def elsewhere(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(corpus, "ARCHIVES", tmp_path / "archives")
    monkeypatch.setattr(corpus, "UNPACKED", tmp_path / "unpacked")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    made = tmp_path / "found"
    made.mkdir()
    (made / "first").write_bytes(b"one")
    (made / "second").write_bytes(b"two\0\xff")
    return made


def contents(folder: Path) -> set[bytes]:
    return {file.read_bytes() for file in folder.iterdir()}


def test_inputs_come_back_as_they_were_packed(folder: Path) -> None:
    assert corpus.pack("lane", folder) == 2
    assert contents(corpus.unpack("lane")) == {b"one", b"two\0\xff"}


def test_unpacking_removes_inputs_that_are_not_packed(folder: Path) -> None:
    corpus.pack("lane", folder)
    (corpus.unpack("lane") / "stray").write_bytes(b"stray")
    assert contents(corpus.unpack("lane")) == contents(folder)


def test_the_same_inputs_make_the_same_archive(folder: Path) -> None:
    corpus.pack("lane", folder)
    packed = corpus.archive_of("lane").read_bytes()
    corpus.archive_of("lane").unlink()
    (folder / "first").rename(folder / "zeroth")
    corpus.pack("lane", folder)
    assert corpus.archive_of("lane").read_bytes() == packed


def test_a_second_copy_of_an_input_is_not_added(folder: Path) -> None:
    corpus.pack("lane", folder)
    written = corpus.archive_of("lane").stat().st_mtime_ns
    (folder / "copy").write_bytes(b"one")
    assert corpus.pack("lane", folder) == 0
    assert corpus.archive_of("lane").stat().st_mtime_ns == written


def test_a_fuzzer_without_a_corpus_starts_with_an_empty_folder() -> None:
    assert list(corpus.unpack("new").iterdir()) == []
