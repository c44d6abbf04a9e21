"""The rendering benchmark: its home, its poses, what it writes, and that whoever cannot take part is named."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from openmap_env.navigation import NavigableSurface
from openmap_eval.bench.render import Render, picture_size
from openmap_eval.bench.render_contenders import CONTENDERS
from openmap_eval.bench.render_home import COLUMNS, HEIGHT, ROWS, make_render_home
from openmap_eval.bench.render_measure import compare
from openmap_eval.bench.render_poses import CAMERA_HEIGHT, scattered, walk


@pytest.mark.parametrize(("faces", "seed"), [(10_000, 0), (50_000, 3)])
def test_the_home_is_what_was_asked_for_and_can_be_walked(faces: int, seed: int) -> None:
    scene = make_render_home(faces, seed, textures=5)
    assert abs(len(scene.faces) - faces) < 0.02 * faces
    assert len(scene.rooms) == COLUMNS * ROWS
    assert make_render_home(faces, seed, textures=5).digest() == scene.digest()
    assert make_render_home(faces, seed + 1, textures=5).digest() != scene.digest()
    surface, rng = NavigableSurface.from_scene(scene), np.random.default_rng(0)
    places = [surface.random_point(rng, 0) for _ in range(600)]
    assert all(any(room.contains(p, 0.05) for p in places) for room in scene.rooms)
    for poses in (walk(scene, surface, 40, rng), scattered(surface, 40, rng)):
        assert poses.shape == (40, 4, 4)
        assert np.allclose(poses[:, 1, 3], CAMERA_HEIGHT, atol=0.1)
        assert np.allclose(poses[:, :3, :3] @ poses[:, :3, :3].transpose(0, 2, 1), np.eye(3))
    steps = np.linalg.norm(np.diff(walk(scene, surface, 40, rng)[:, :3, 3], axis=0), axis=1)
    assert steps.max() < 0.3
    assert scene.vertices[:, 1].max() < HEIGHT + 0.05


def test_a_run_says_who_took_part_and_who_could_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("openmap_eval.bench.render_process.find_spec", lambda name: None)
    out, console = tmp_path / "render.json", Console(file=io.StringIO(), width=100)
    Render(
        faces=(10_000,), sizes=("32x24",), frames=6, rounds=2, textures=2, out=out,
        backends=("raycast", "open3d rays", "habitat-sim"),
    ).run(console)  # fmt: skip
    result = json.loads(out.read_text())
    assert set(result["missing"]) == {"open3d rays", "habitat-sim"}
    assert "not installed" in result["missing"]["habitat-sim"]
    (part,) = result["results"]
    row = part["contenders"]["raycast"]
    assert row["agreement"] == {"depth_mean_mm": 0, "depth_max_mm": 0, "ids_differ_percent": 0, "rgb_mean": 0}
    assert row["walk"]["ratio"] is None  # nothing to compare it with took part
    assert row["walk"]["frames_per_s"] > 0
    assert row["scattered"]["cpu_ms"] > 0
    assert result["machine"]["cores"] >= 1
    printed = console.file.getvalue()  # type: ignore[attr-defined]
    assert "habitat-sim: not installed (habitat_sim)" in printed
    assert all(len(line) <= 100 for line in printed.splitlines())


def test_what_differs_is_counted_and_edges_are_left_out() -> None:
    ids = np.ones((1, 20, 20), np.int32)
    ids[:, :, 10:] = 2
    reference = {"ids": ids, "depth": np.ones((1, 20, 20), np.float32), "rgb": np.zeros((1, 20, 20, 3), np.uint8)}
    other = {name: array.copy() for name, array in reference.items()}
    other["ids"][0, 3, 10] = 1
    other["depth"][0, 3, 10] = 9.0  # on the edge
    other["depth"][0, 5, 5] = 1.002
    found = compare(other, reference)
    assert found["ids_differ_percent"] == pytest.approx(100 / 400)
    assert found["depth_max_mm"] == pytest.approx(2.0, rel=1e-3)
    assert compare({"depth": reference["depth"]}, reference)["rgb_mean"] is None


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (Render(sizes=("big",)), "expected WIDTHxHEIGHT"),
        (Render(frames=0), "0 frames"),
        (Render(rounds=0), "0 rounds"),
        (Render(faces=()), "no faces"),
        (Render(faces=(5,), backends=("raycast",)), "expected 10000 faces"),
        (Render(lp_threads=-1), "rasteriser threads"),
        (Render(backends=("vulkan",)), "opengl prepared egl"),
    ],
)
def test_settings_that_cannot_be_measured_with_are_refused(settings: Render, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        settings.run(Console(file=io.StringIO()))
    assert picture_size("640x480") == (640, 480)
    assert all(c.baseline in CONTENDERS for c in CONTENDERS.values())
