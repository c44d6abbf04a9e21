"""``openmap map``: a map that can be asked, whatever happens to the process on the way."""

from __future__ import annotations

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from walks import frame, write_truth, write_walk

from openmap_agents.mapping import InstanceMap
from openmap_agents.perception.stored_frames import picture_digest
from openmap_eval import map_run
from openmap_eval.cli import main
from openmap_eval.map_run import read_settings
from openmap_scenes import DataError, PinholeCamera

README = Path(__file__).resolve().parents[2] / "README.md"
FRAMES = 40


@pytest.fixture(scope="module")
def walk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_walk(tmp_path_factory.mktemp("walk"), FRAMES, blind=(7,), lost=(11,))


@pytest.fixture(scope="module")
def truth(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_truth(tmp_path_factory.mktemp("truth"), FRAMES)


def command(walk: Path, truth: Path, out: Path, *more: str) -> list[str]:
    return ["map", str(walk), "--out", str(out), "--perception", f"precomputed:{truth}", *more]


@pytest.fixture(scope="module")
def whole(walk: Path, truth: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("whole") / "map.npz"
    main(command(walk, truth, out))
    return out


def kept_frames(partial: Path) -> int:
    journal = partial / "frames.jsonl"
    return journal.read_bytes().count(b"\n") if journal.exists() else 0


@pytest.mark.slow
def test_a_run_that_is_killed_again_and_again_ends_in_the_same_file(walk, truth, whole: Path, tmp_path: Path):
    out, rng, kills, kept = tmp_path / "map.npz", np.random.default_rng(), 0, [0]
    partial = tmp_path / "map.npz.partial"
    call = [sys.executable, "-m", "openmap_eval.cli", *command(walk, truth, out)]
    for wanted in (1, 13, 28):
        process = subprocess.Popen(call, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            while process.poll() is None and kept_frames(partial) < wanted:
                time.sleep(0.001)
            time.sleep(float(rng.uniform(0.0, 0.02)))
        finally:
            process.send_signal(signal.SIGKILL)
        kills += process.wait() == -signal.SIGKILL
        kept.append(kept_frames(partial))
        assert kept == sorted(kept)
    assert kills == 3
    done = subprocess.run(call, capture_output=True, text=True, check=True)
    assert "frames are kept in" in done.stdout
    assert out.read_bytes() == whole.read_bytes()
    assert sorted(p.name for p in tmp_path.iterdir() if not p.name.endswith(".tmp")) == ["map.npz", "map.png"]


def test_the_map_is_right_and_can_be_asked(whole: Path, truth: Path, capsys: pytest.CaptureFixture[str]):
    instance_map = InstanceMap.load(whole)
    television = next(i for i in instance_map if i.label == "television")
    assert np.abs(television.centre - (-0.175, 1.3, -3.9)).max() < 0.1
    assert {"sofa", "refrigerator", "television"} <= {i.label for i in instance_map}
    main(["query", str(whole), "the fridge", "--top", "1"])
    assert "refrigerator" in capsys.readouterr().out


def test_it_says_what_became_of_the_frames_and_draws_the_map(walk, truth, whole: Path, tmp_path, capsys):
    main(command(walk, truth, tmp_path / "map.npz", "--every", "4"))
    said = " ".join(capsys.readouterr().out.split())
    assert "frames: 10 seen" in said
    assert "1 without a pose left out" in said
    with Image.open(whole.with_suffix(".png")) as picture:
        colours = picture.convert("RGB").getcolors(1 << 20)
    assert colours is not None
    assert len(colours) > 10
    main(command(walk, truth, tmp_path / "bare.npz", "--last", "5", "--no-picture"))
    assert not (tmp_path / "bare.png").exists()


def test_kept_frames_are_a_perception_of_their_own(walk, truth, whole: Path, tmp_path: Path):
    main(command(walk, truth, tmp_path / "first.npz", "--keep-frames"))
    kept = tmp_path / "first.npz.partial"
    main(command(walk, kept, tmp_path / "second.npz"))
    first, second, plain = (InstanceMap.load(p) for p in (tmp_path / "first.npz", tmp_path / "second.npz", whole))
    assert [i.label for i in second] == [i.label for i in first] == [i.label for i in plain]
    for a, b in zip(first, second, strict=True):
        assert np.array_equal(a.points, b.points)
        np.testing.assert_allclose(a.feature, b.feature, atol=1e-6)


def test_frames_found_by_order_are_read_from_the_start(tmp_path: Path):
    walk = write_walk(tmp_path / "walk", 6)
    spec = write_truth(tmp_path / "truth", 6)
    ordered = tmp_path / "ordered"
    ordered.mkdir()
    for n in range(6):
        seen, _ = frame(n, float(np.linspace(-1.0, 1.0, 6)[n]))
        source = next(p for p in spec.iterdir() if p.stem == picture_digest(seen.rgb))
        (ordered / f"{n}.npz").write_bytes(source.read_bytes())
    main(["map", str(walk), "--out", str(tmp_path / "map.npz"), "--perception", f"precomputed:{ordered}?frames=order"])
    assert not (tmp_path / "map.npz.partial").exists()
    assert len(InstanceMap.load(tmp_path / "map.npz")) >= 3


def test_stopped_by_hand_the_default_perception_goes_on(tmp_path: Path, monkeypatch, capsys):
    walk = write_walk(tmp_path / "walk", 5)
    call = ["map", str(walk), "--out", str(tmp_path / "whole.npz")]
    main(call)
    watch = map_run.MapProgress.__call__

    def interrupted(self, report) -> None:
        watch(self, report)
        if report.done == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr(map_run.MapProgress, "__call__", interrupted)
    call[3] = str(tmp_path / "map.npz")
    with pytest.raises(SystemExit) as stopped:
        main(call)
    assert stopped.value.code == 130
    assert "the same command goes on from here" in capsys.readouterr().out
    monkeypatch.undo()
    main(call)
    assert "3 kept from before" in " ".join(capsys.readouterr().out.split())
    assert (tmp_path / "map.npz").read_bytes() == (tmp_path / "whole.npz").read_bytes()


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (["--settings", "tau_obs=0.5"], r"settings\.tau_obs 0\.3.*--fresh"),
        (["--every", "2"], r"frames\.every 1.*--fresh"),
        (["--max-depth", "3"], r"settings\.max_depth 10\.0.*--fresh"),
    ],
)
def test_another_command_on_kept_frames_is_one_error(walk, truth, tmp_path: Path, capsys, more, said):
    out = tmp_path / "map.npz"
    main(command(walk, truth, out, "--keep-frames", "--last", "9"))
    with pytest.raises(SystemExit) as refused:
        main(command(walk, truth, out, "--last", "9", *more))
    assert refused.value.code == 2
    assert re.search(said, " ".join(capsys.readouterr().out.split()))
    main(command(walk, truth, out, "--last", "9", *more, "--fresh"))
    assert not (tmp_path / "map.npz.partial").exists()


@pytest.mark.parametrize(
    "more",
    [
        ["--out", "map.txt"],
        ["--perception", "oracle"],
        ["--perception", "precomputed:nowhere"],
        ["--settings", "tau=1"],
        ["--settings", "tau_obs"],
        ["--settings", "tau_obs=much"],
        ["--settings", "tau_obs=7"],
        ["--settings", "min_masks=1.5"],
        ["--every", "0"],
        ["--first", "1000"],
        ["--kind", "tum"],
        ["--max-depth", "nan"],
    ],
)
def test_a_wrong_command_is_one_error_and_leaves_nothing(walk: Path, tmp_path: Path, monkeypatch, capsys, more):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(SystemExit) as refused:
        main(["map", str(walk), *([] if "--out" in more else ["--out", "map.npz"]), *more])
    assert refused.value.code == 2
    assert capsys.readouterr().out.count("openmap:") == 1
    assert list(tmp_path.iterdir()) == []


def test_settings_are_read_as_their_defaults_are():
    settings = read_settings(("min_masks=3", "tau_obs=0.25", "semantics=structural"), max_depth=4.0)
    assert (settings.min_masks, settings.tau_obs, settings.semantics, settings.max_depth) == (3, 0.25, "structural", 4)
    with pytest.raises(DataError, match="min_masks=a number such as 2"):
        read_settings(("min_masks=few",))


def blocks_of_readme() -> tuple[str, list[str]]:
    """The Python block and the command lines of the README's section on recordings."""
    section = README.read_text(encoding="utf-8").partition("## A map of your own recording")[2].partition("\n## ")[0]
    python = re.search(r"```python\n(.*?)```", section, re.DOTALL)
    shell = re.search(r"```sh\n(.*?)```", section, re.DOTALL)
    assert python
    assert shell
    return python[1], [line.partition(" #")[0] for line in shell[1].strip().splitlines()]


def test_the_readmes_example_runs(tmp_path: Path, monkeypatch, capsys):
    # A world with z up and OpenCV's camera axes, as the example has them.
    T_file_world = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], float)
    T_opengl_opencv = np.diag([1.0, -1.0, -1.0, 1.0])
    monkeypatch.chdir(tmp_path)
    poses = []
    for part in ("color", "depth"):
        (tmp_path / "walk" / part).mkdir(parents=True)
    for n, x in enumerate((-0.6, -0.2, 0.2, 0.6)):
        seen, _ = frame(n, x, PinholeCamera(640, 480, 577.9, 577.9, 319.5, 239.5))
        Image.fromarray(seen.rgb).save(f"walk/color/{n}.jpg", quality=95)
        Image.fromarray(np.rint(1000 * seen.depth).astype(np.uint16)).save(f"walk/depth/{n}.png")
        poses.append((T_file_world @ seen.T_world_camera @ T_opengl_opencv).tolist())
    Path("walk/poses.json").write_text(json.dumps(poses))
    python, lines = blocks_of_readme()
    exec(compile(python, "README.md", "exec"), {})
    for line in lines:
        words = re.findall(r'"([^"]*)"|(\S+)', line)
        name, *arguments = [quoted or plain for quoted, plain in words]
        assert name == "openmap"
        main(arguments)
    built = InstanceMap.load("walk.npz")
    assert len(built) >= 2
    points = np.concatenate([i.points for i in built])
    assert points[:, 1].min() > -0.2  # the floor is at 0, and up is up
    assert points[:, 1].max() < 3.5
    assert points[:, 2].max() < 0  # ahead of the camera
    assert "confidence" in capsys.readouterr().out
