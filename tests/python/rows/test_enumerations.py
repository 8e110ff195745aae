"""Values of enumerations know their labels wherever Python meets them."""

import copy
import itertools
import json
import os
import pickle
from enum import IntEnum
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow.parquet
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mixed_robots import ROBOTS
from numpy.typing import NDArray
from processes import run_o80

import o80
from o80.datasets.export import write
from o80.rows.enumerations import Enumeration, enumeration_of, labelled
from o80.rows.layout import labels_of_type

WORDS = st.from_regex(r"[a-z][a-z0-9]{0,8}", fullmatch=True).filter(lambda word: word != "mro")
KINDS = st.sampled_from([f"{sign}{size}" for sign in "iu" for size in (1, 2, 4, 8)])


def drawn(kind: str) -> st.SearchStrategy[dict[str, int]]:
    """The labels of an enumeration whose numbers fit a type; negative ones and gaps too."""
    limits = np.iinfo(kind)
    numbers = st.one_of(
        st.integers(max(limits.min, -3), 6),
        st.integers(int(limits.min), int(limits.max)),
        st.sampled_from([int(limits.min), int(limits.max)]),
    )
    pairs = st.tuples(WORDS, numbers)
    return st.lists(
        pairs, min_size=1, max_size=6, unique_by=(lambda pair: pair[0], lambda pair: pair[1])
    ).map(dict)


def knows_its_labels(value: Any, label: str, labels: dict[str, int]) -> None:
    """Checks one value of a row, and copies of it."""
    for each in (value, pickle.loads(pickle.dumps(value)), copy.deepcopy(value)):
        assert isinstance(each, Enumeration)
        assert {word: (each == word, each != word) for word in labels} == {
            word: (word == label, word != label) for word in labels
        }
        assert each == labels[label] == int(each)
        assert label == each
        assert hash(each) == hash(labels[label])
        assert f"{each}" == str(each) == label
        with pytest.raises(ValueError, match=r"has no label 'no such label'"):
            _ = each == "no such label"
        with pytest.raises(ValueError, match=rf"has no label.*({'|'.join(labels)})"):
            _ = each != "no such label"


def columns_know(array: Any, expected: list[str], labels: dict[str, int]) -> None:
    """Checks values along the first dimension, and what is made of them."""
    wanted = np.array(expected)
    numbers = np.array([labels[label] for label in expected], array.dtype)
    twice = np.concatenate([array, array])
    arrays: list[tuple[Any, NDArray[np.str_]]] = [
        (array, wanted),
        (array[::-1], wanted[::-1]),
        (array[:, np.newaxis], wanted[:, np.newaxis]),
        (pickle.loads(pickle.dumps(array)), wanted),
        (copy.deepcopy(array), wanted),
        (twice, np.concatenate([wanted, wanted])),
        (np.where(np.full(len(array), True), array, array[::-1]), wanted),
    ]
    for each, words in arrays:
        for label in labels:
            assert np.array_equal(each == label, words == label)
            assert np.array_equal(each != label, words != label)
            assert np.array_equal(label == each, words == label)
            assert np.array_equal(np.isin(each, [label]), words == label)
            assert (label in each) == (label in words.ravel().tolist())
        assert np.array_equal(each == words.tolist(), np.full(words.shape, True))
        assert np.array_equal(each, words.tolist())
        assert np.array_equal(each.labels(), words)
        for call in (
            lambda each=each: each == "no such label",
            lambda each=each: each != ["no such label"] * len(each),
            lambda each=each: np.isin(each, ["no such label"]),
        ):
            with pytest.raises(ValueError, match="has no label 'no such label'"):
                call()
    assert np.array_equal(np.asarray(array), numbers)
    assert array.tolist() == numbers.tolist()
    assert type(array + 0) is np.ndarray
    for value, label in zip(array, expected, strict=True):
        knows_its_labels(value, label, labels)


_names = (f"test-words-{os.getpid()}-{i}" for i in itertools.count())


@ROBOTS
@given(data=st.data())
def test_every_reader_and_writer_knows_the_labels(
    data: st.DataObject, tmp_path_factory: pytest.TempPathFactory
) -> None:
    labels: dict[str, int] = data.draw(drawn("i8"))
    words = st.sampled_from([*labels])
    published = data.draw(st.lists(st.tuples(words, words, words), min_size=3, max_size=3))
    commanded, requested = data.draw(words), data.draw(words)
    kind = IntEnum("Gear", labels)  # type: ignore[misc]
    groups = {"gear": kind, "arms": ({"x": float, "mode": kind}, 2)}
    folder = tmp_path_factory.mktemp("words")
    heard: list[Any] = []
    name = next(_names)
    described: Any = {"extended": {"status": kind, "heat": float}, "requests": {"go": {"to": kind}}}
    with o80.Backend(name, groups, bursting=True, **described) as backend:
        backend.on("go", lambda fields: heard.append(fields))

        def publish(gear: str, mode: str, status: str) -> None:
            states = {"gear": gear, "arms": {"x": [0.0, 0.5], "mode": [mode, gear]}}
            backend.publish(states, {"status": status, "heat": 1.0})

        publish(*published[0])
        with o80.Frontend(name) as frontend:
            assert [*frontend.enums["mode"].__members__] == [*labels]
            frontend.add_command("gear", commanded)
            frontend.add_command("arms_1", {"mode": labels[commanded]})
            frontend.add_request("go", to=requested)
            for row in published[1:]:
                frontend.burst(1, wait=False)
                desired = backend.step()
                knows_its_labels(desired.gear, commanded, labels)
                knows_its_labels(desired.arms["mode"][1], commanded, labels)
                knows_its_labels(desired.arms[1]["mode"], commanded, labels)
                publish(*row)
            (fields,) = heard
            knows_its_labels(fields.to, requested, labels)
            latest, history = frontend.latest(), frontend.history()
            sent = [c for entry in frontend.journal() for c in entry.commands]
    o80.clean(name)

    gear, mode, status = published[-1]
    knows_its_labels(latest.observed.gear, gear, labels)
    knows_its_labels(latest.extended.status, status, labels)
    columns_know(latest.observed.arms["mode"], [mode, gear], labels)
    for arms in latest.observed.arms, pickle.loads(pickle.dumps(latest.observed.arms)):
        for element in arms[0], pickle.loads(pickle.dumps(arms[0])):
            knows_its_labels(element["mode"], mode, labels)
            knows_its_labels(element[1], mode, labels)
            assert [*element] == [0.0, mode]
    for many in (history, pickle.loads(pickle.dumps(history))):
        columns_know(many.observed.gear, [row[0] for row in published], labels)
        columns_know(many.extended.status, [row[2] for row in published], labels)
        columns_know(many.observed.arms["mode"][:, 0], [row[1] for row in published], labels)
        columns_know(many.observed.arms[:, 1]["mode"], [row[0] for row in published], labels)
    knows_its_labels(sent[0].targets[0], commanded, labels)
    knows_its_labels(sent[1].targets[0]["mode"], commanded, labels)
    knows_its_labels(sent[2].fields["to"], requested, labels)  # type: ignore[index]
    exports_keep(history, "extended.status", [row[2] for row in published], labels, folder)


def exports_keep(
    history: o80.History, column: str, words: list[str], labels: dict[str, int], folder: Path
) -> None:
    """Checks a column of frames and files: numbers, and labels where each format has them."""
    assert history.to_frame()[column].tolist() == words
    numbers = [labels[word] for word in words]
    for suffix in (".npz", ".h5", ".parquet"):
        write(folder / f"run{suffix}", {"robot": history})
    arrays = np.load(folder / "run.npz")
    assert arrays[f"robot/{column}"].tolist() == numbers
    assert dict(arrays[f"robot/{column}.labels"].tolist()) == labels
    with h5py.File(folder / "run.h5") as file:
        assert file["robot"][column][:].tolist() == numbers
        assert h5py.check_enum_dtype(file["robot"][column].dtype) == labels
    table = pyarrow.parquet.read_table(folder / "run.parquet")
    assert table[column].to_pylist() == numbers
    assert json.loads(table.schema.field(column).metadata[b"labels"]) == labels


@given(data=st.data())
def test_enumerations_of_every_size_know_their_labels(data: st.DataObject) -> None:
    kind = data.draw(KINDS)
    labels = data.draw(drawn(kind))
    words = data.draw(st.lists(st.sampled_from([*labels]), min_size=1, max_size=4))
    described = {"name": "Sensors", "size": 8, "fields": [field_of(kind, labels)]}
    array = np.array([labels[word] for word in words], kind)

    known = labelled(array, labels_of_type(described)["mode"])

    columns_know(known, words, labels)


def field_of(kind: str, labels: dict[str, int]) -> dict[str, Any]:
    """As the schema of a robot in C++ describes it: each number as one of 64 bits with a sign."""
    return {
        "name": "mode",
        "kind": "enum",
        "signed": int(kind[0] == "i"),
        "size": int(kind[1]),
        "shape": [],
        "offset": 0,
        "labels": {word: int(np.uint64(n).view(np.int64)) for word, n in labels.items() if n >= 0}
        | {word: number for word, number in labels.items() if number < 0},
    }


def test_labels_that_python_reserves_are_labels_too() -> None:
    labels = ("mro", "_x_", "__init__", "name", "value", "real", "labels", "", "_gear__x")
    gear = enumeration_of("gear", tuple((label, i) for i, label in enumerate(labels)))
    for number, label in enumerate(labels):
        value = gear(number)
        assert (value == label, str(value), value == number) == (True, label, True)


def test_a_number_without_a_label_stays_a_number() -> None:
    gear = enumeration_of("gear", (("off", 0), ("on", 2)))
    for value in (gear(7), pickle.loads(pickle.dumps(gear(7)))):
        assert (value == 7, value == "on", value != "on", str(value)) == (True, False, True, "7")
    array: Any = labelled(np.array([2, 7]), gear)
    assert (array == "on").tolist() == [True, False]
    assert array.labels().tolist() == ["on", "7"]


def test_arrays_that_lost_their_labels_refuse_words() -> None:
    """Instead of saying that no element has them."""
    gear = enumeration_of("gear", (("off", 0), ("on", 2)))
    other = enumeration_of("gear", (("on", 0), ("off", 2)))
    array = labelled(np.array([0, 2]), gear)
    mixed = np.concatenate([array, labelled(np.array([0, 2]), other)])
    with pytest.raises(ValueError, match="no longer knows its labels"):
        _ = mixed == "on"
    assert (mixed == 2).tolist() == [False, True, False, True]


def test_robots_without_enumerations_have_plain_arrays(arm: o80.Frontend) -> None:
    assert arm.enums == {}
    states: list[NDArray[Any]] = [arm.latest().observed, arm.history().desired]
    assert [type(each) for each in states] == [np.ndarray, np.ndarray]


def test_info_lists_the_labels(segment: str) -> None:
    class Status(IntEnum):
        OK = 0
        LOST = -2

    with o80.Backend(segment, ["elbow"], extended={"status": Status}) as backend:
        backend.publish([0.0], {"status": Status.OK})
        said = run_o80("info", segment).stdout

    assert "enumerations\n  status: OK 0, LOST -2\n" in said


GEARS: Any = IntEnum("GEARS", {"low": 0, "high": 2})


def test_labels_and_numbers_may_stand_side_by_side(segment: str) -> None:
    with o80.Backend(segment, 3, GEARS) as backend:
        backend.publish(["high", 0, GEARS["high"]])
        with o80.Frontend(segment) as frontend:
            gears: Any = frontend.latest().observed
            assert gears.labels().tolist() == ["high", "low", "high"]
            assert (gears == ["high", 0, "low"]).tolist() == [True, True, False]
            assert (gears == np.array(["low", "low", 2], object)).tolist() == [False, True, True]
            assert np.isin(gears, np.array(["low"], object)).tolist() == [False, True, False]
            assert type(np.where(gears == "low", 1.0, 2.0)) is np.ndarray
            for wrong in (["hihg", 0, 0], np.array(["hihg", 0, 0], object)):
                with pytest.raises(ValueError, match=r"no label 'hihg'.*'high'"):
                    _ = gears == wrong
                with pytest.raises(ValueError, match=r"no label 'hihg'.*'high'"):
                    backend.publish(wrong)
