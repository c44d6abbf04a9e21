"""The label sets against the benchmarks' own lists, and free names against what people mean by them."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from openmap_scenes.formats.instances import make_instance
from openmap_scenes.homes.kinds import read_kinds
from openmap_scenes.taxonomy import LVIS, MPCAT40, SCANNET200, Labels, labels_of, scannet200_group


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8") as file:
        return list(csv.DictReader(file, delimiter="\t"))


def test_the_lists_are_those_of_the_benchmarks(shared_scenes):
    meta = shared_scenes / "meta"
    assert [row["mpcat40"] for row in rows_of(meta / "mpcat40.tsv")] == list(MPCAT40)
    scannet = json.loads((meta / "scannet200.json").read_text())
    assert scannet["labels"] == list(SCANNET200)
    for group in ("head", "common", "tail"):
        assert {name for name in SCANNET200 if scannet200_group(name) == group} == set(scannet[group])
    known = {entry["name"] for entry in json.loads((meta / "lvis_v1_categories.json").read_text())}
    assert set(LVIS) <= known


def test_every_class_is_called_by_its_own_name():
    assert [name for name in MPCAT40 if labels_of(name).mpcat40 != name] == []
    assert [name for name in SCANNET200 if labels_of(name).scannet200 != name] == []
    # LVIS names a sense in brackets; a few of its words mean something else in a home ("cooker").
    assert sum(labels_of(name).lvis == name for name in LVIS) > 0.98 * len(LVIS)


def test_the_table_names_only_what_the_sets_have():
    for kind in {piece.kind for piece in read_kinds().values()}:
        labels = labels_of(kind)
        assert labels.mpcat40 in MPCAT40, kind
        assert labels.scannet200 is None or labels.scannet200 in SCANNET200, kind
        assert labels.lvis is None or labels.lvis in LVIS, kind


def test_it_agrees_with_the_mapping_of_scannet(shared_scenes):
    """ScanNet's annotators' names and the Matterport classes that were given to them."""
    agreed = total = names = 0
    rows = [row for row in rows_of(shared_scenes / "meta" / "scannetv2-labels.combined.tsv") if row["mpcat40"]]
    for row in rows:
        is_same = labels_of(row["raw_category"]).mpcat40 == row["mpcat40"]
        agreed, total, names = agreed + int(row["count"]) * is_same, total + int(row["count"]), names + is_same
    print(f"agrees for {agreed / total:.2%} of {total} annotations, {names / len(rows):.2%} of {len(rows)} names")
    assert agreed > 0.97 * total
    assert names > 0.93 * len(rows)


def test_it_agrees_with_the_names_of_the_house(shared_scenes):
    truth = json.loads((shared_scenes / "ground_truth_aws_small_house.json").read_text())
    wrong = {
        (entry["category"], labels_of(entry["category"]).mpcat40, entry["mpcat40"])
        for entry in truth["instances"]
        if entry["category"] and labels_of(entry["category"]).mpcat40 != entry["mpcat40"]
    }
    assert wrong <= {("tablet", "objects", "table")}


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Office Chair", Labels("chair", "office chair", "chair")),
        ("coffee_table", Labels("table", "coffee table", "coffee_table")),
        ("armchairs", Labels("chair", "armchair", "armchair")),
        ("arm chair", Labels("chair", "armchair", "armchair")),
        ("the bookshelves", Labels("shelving", "bookshelf", "bookcase")),
        ("Night-Stand", Labels("chest_of_drawers", "nightstand", "table")),
        ("fridge", Labels("appliances", "refrigerator", "refrigerator")),
        ("TV", Labels("tv_monitor", "tv", "television_set")),
        ("couch", Labels("sofa", "couch", "sofa")),
        ("wall#clock", Labels("objects", "clock", "wall_clock")),
        ("door /otherroom", Labels("door", "door", None)),
        ("shelf / cabinet", Labels("shelving", "shelf", None)),
        ("chair_02", Labels("chair", "chair", "chair")),
        ("wooden dining chair", Labels("chair", "chair", "chair")),
        ("stainless steel kitchen sink", Labels("sink", "sink", "kitchen_sink")),
        ("stack of chairs", Labels("chair", "chair", "chair")),
        ("bowl of fruit", Labels("objects", "bowl", "bowl")),
        ("desk w/ clutter", Labels("table", "desk", "desk")),
        ("picture on wall", Labels("picture", "picture", None)),
        ("mouse (computer equipment)", Labels("objects", "mouse", "mouse_(computer_equipment)")),
        ("steak knives", Labels("objects", None, "steak_knife")),
        ("glass_(drink_container)", Labels("objects", "cup", "glass_(drink_container)")),
    ],
)
def test_free_names(name, expected):
    assert labels_of(name) == expected


@pytest.mark.parametrize(
    "name", ["", "  ", "zorgblatt", "12", "chairs' leg", "tabl", "cha1r", "stool sample top", "/", "bed bug"]
)
def test_what_is_not_known_has_no_labels(name):
    assert labels_of(name) == Labels()


@given(st.text(max_size=60))
def test_no_name_is_too_odd(name):
    labels = labels_of(name)
    assert labels.mpcat40 is None or labels.mpcat40 in MPCAT40


def test_an_instance_is_filled_in_from_its_name():
    sofa = make_instance(3, " Corner  SOFA", [0, 1, 2], [2, 2, 6], room=4, source_id=2)
    assert (sofa.category, sofa.mpcat40, sofa.scannet200, sofa.lvis) == ("corner sofa", "sofa", "couch", "sofa")
    assert sofa.centre.tolist() == [1, 1.5, 4]
    assert (sofa.room, sofa.source_id, sofa.attributes) == (4, 2, {})
    # What the source says counts for more than the table.
    assert make_instance(1, "tablet", [0] * 3, [1] * 3, mpcat40="table").mpcat40 == "table"
    assert make_instance(1, "##", [0] * 3, [1] * 3).category == "unlabelled"
