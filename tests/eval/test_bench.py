"""Benchmarks: what they write, that nothing in it names a person or a computer, that the synthetic home is what was asked for."""

from __future__ import annotations

import getpass
import io
import json
import os
import platform
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from openmap_eval.bench import Loading, Machine
from openmap_eval.bench.loading import COLUMNS, ROWS, measure
from openmap_eval.bench.machine import describe_machine, write_json
from openmap_eval.bench.synthetic import PARTS, make_part, write_glb
from openmap_eval.cli import main
from openmap_scenes import load_scene


@pytest.mark.parametrize(("faces", "textures", "image"), [(2003, 7, "jpeg"), (8, 1, "png")])
def test_the_synthetic_home_is_what_was_asked_for(faces: int, textures: int, image: str, tmp_path: Path) -> None:
    path = tmp_path / "home.glb"
    write_glb(path, faces, textures, 64, image, seed=3)
    scene = load_scene(f"file:{path}", cache=False)
    assert len(scene.faces) == faces
    found = [m.texture for m in scene.materials if m.texture is not None]
    assert [t.shape for t in found] == [(64, 64, 3)] * textures
    assert len({t.tobytes() for t in found}) == textures
    assert np.array_equal(np.unique(scene.face_material), np.arange(textures))
    write_glb(tmp_path / "again.glb", faces, textures, 64, image, seed=3)
    assert (tmp_path / "again.glb").read_bytes() == path.read_bytes()
    write_glb(tmp_path / "again.glb", faces, textures, 64, image, seed=4)
    assert (tmp_path / "again.glb").read_bytes() != path.read_bytes()


@pytest.mark.parametrize("kind", PARTS)
def test_parts_face_into_the_room_and_lie_in_it(kind: str) -> None:
    part = make_part(kind, 0, 1, 4000, np.random.default_rng(0))
    a, b, c = (part.vertices[part.faces[:, k]].astype(np.float64) for k in range(3))
    normal = np.cross(b - a, c - a)
    low, high = part.vertices.min(0), part.vertices.max(0)
    assert np.all(low > -0.05)
    assert np.all(high < (5.05, 2.75, 5.05))
    middle = (low + high) / 2 if kind in ("sofa", "table") else np.array([2.5, 1.35, 2.5])
    inward = np.sum(normal * (middle - (a + b + c) / 3), axis=1) > 0
    wanted = kind not in ("sofa", "table")
    assert np.mean(inward == wanted) > 0.95


@pytest.mark.parametrize(
    "settings", [(7, 1, 64, "jpeg"), (100, 0, 64, "jpeg"), (100, 1, 4, "jpeg"), (100, 1, 64, "gif")]
)
def test_a_home_that_cannot_be_made_is_named(settings: tuple[int, int, int, str], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="expected 8 faces"):
        write_glb(tmp_path / "home.glb", *settings, seed=0)
    assert list(tmp_path.iterdir()) == []


def nameless(text: str) -> bool:
    """Whether a text holds neither this computer's name, nor the user's, nor a path."""
    words = [platform.node(), getpass.getuser(), str(Path.home()), "/tmp", str(Path(__file__).parents[1])]
    return not any(len(word) > 3 and word in text for word in words)


def test_the_machine_is_described_without_names() -> None:
    description = describe_machine()
    assert description["cores"] >= 1
    assert description["memory_gib"] > 0
    assert description["versions"]["numpy"] == np.__version__
    assert nameless(json.dumps(description))


def test_results_are_whole_or_not_there(tmp_path: Path) -> None:
    write_json(tmp_path / "a" / "b.json", {"x": 1})
    assert json.loads((tmp_path / "a" / "b.json").read_text()) == {"x": 1}
    with pytest.raises(TypeError):
        write_json(tmp_path / "a" / "b.json", {"x": object()})
    assert [p.name for p in (tmp_path / "a").iterdir()] == ["b.json"]
    assert json.loads((tmp_path / "a" / "b.json").read_text()) == {"x": 1}


def test_loading_is_measured_in_processes_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setenv("OPENMAP_CACHE", str(tmp_path / "of the user"))
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    out = tmp_path / "result.json"
    console = Console(file=io.StringIO(), width=200)
    Loading(faces=4000, textures=3, texture_size=64, repeats=1, out=out).run(console)
    result = json.loads(out.read_text())
    assert list(result["rows"]) == [row for row in ROWS if hasattr(os, "posix_fadvise") or not ROWS[row].cold]
    for figures in result["rows"].values():
        assert set(figures) >= set(COLUMNS)
        assert figures["process_seconds"] > figures["seconds"] > 0
        assert figures["peak_mib"] > 10
    assert result["disk_mib"]["cache"] > 0
    assert result["settings"] == {
        "faces": 4000, "textures": 3, "texture_size": 64, "image": "jpeg", "repeats": 1, "seed": 0,
    }  # fmt: skip
    second = result["second_process"]
    assert second["second_uss_mib"] > 0
    both = second["first_beside_pss_mib"] + second["second_pss_mib"]
    assert second["added_pss_mib"] == pytest.approx(both - second["first_alone_pss_mib"], abs=0.2)
    assert nameless(out.read_text())
    assert list(scratch.iterdir()) == []  # removed afterwards
    assert not (tmp_path / "of the user").exists()
    printed = console.file.getvalue()  # type: ignore[attr-defined]
    for row in result["rows"]:
        assert row in printed


def test_no_repeats_are_refused() -> None:
    with pytest.raises(ValueError, match="repeats"):
        measure(Loading(repeats=0))


def test_the_command_line_knows_the_benchmarks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main(["bench", "machine", "--out", str(tmp_path / "machine.json")])
    assert json.loads((tmp_path / "machine.json").read_text()) == describe_machine()
    with pytest.raises(SystemExit) as caught:
        main(["bench", "loading", "--faces", "3"])
    assert caught.value.code == 2
    assert "expected 8 faces" in capsys.readouterr().out
    Machine().run(Console(file=io.StringIO()))
