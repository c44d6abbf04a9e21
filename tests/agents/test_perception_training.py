"""The training of the default perception, from nothing to weights that see: small, resumed, the same twice."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console

from openmap_agents.perception import make_perception
from openmap_agents.perception.training.augment import SensorNoise
from openmap_agents.perception.training.settings import Settings
from openmap_agents.perception.training.shards import Shard, rough_masks
from openmap_scenes import DataError, PinholeCamera


def small(tmp_path: Path, name: str = "a", **changes: object) -> Settings:
    sizes = {"homes": 2, "views": 8, "patch_views": 3, "held": 1, "neck_homes": 2, "neck_epochs": 1, "neck_share": 1.0}
    sizes |= {"head_epochs": 1, "segmenter_homes": 2, "processes": 1}
    return Settings(out=tmp_path / name, work=tmp_path / "work", **(sizes | changes))  # type: ignore[arg-type]


@pytest.fixture(scope="module")
def trained(tmp_path_factory: pytest.TempPathFactory) -> Path:
    from openmap_agents.perception.training.run import train

    folder = tmp_path_factory.mktemp("trained")
    train(small(folder), Console(quiet=True))
    return folder


def test_a_small_training_makes_weights_that_perceive(trained: Path):
    weights = trained / "a"
    written = {
        "neck.onnx",
        "regions.npz",
        "segmenter.npz",
        "colour.npz",
        "names.json",
        "training.json",
        "log.jsonl",
        "curves.png",
    }
    assert {p.name for p in weights.iterdir()} == written
    names = json.loads((weights / "names.json").read_text())
    assert "floor" in names
    assert names == sorted(names)
    segmenter, encoder = make_perception(f"embedded:{weights}", f"embedded:{weights}")
    rng = np.random.default_rng(0)
    camera = PinholeCamera.from_hfov(64, 48, 90.0)
    rgb, depth = rng.integers(0, 255, (48, 64, 3), dtype=np.uint8), rng.uniform(1, 3, (48, 64)).astype(np.float32)
    masks = segmenter.segment(rgb, depth, np.eye(4), camera)
    features = encoder.encode_regions(rgb, depth, masks, np.eye(4), camera)
    assert features.shape == (len(masks), encoder.dim)
    right = encoder.calibration(np.array([-0.5, 0.8]))
    assert right[0] < 0.5 < right[1]


def test_a_second_run_goes_on_from_what_is_there_and_ends_the_same(trained: Path):
    from openmap_agents.perception.training.run import train

    seen = {p: p.stat().st_mtime_ns for p in (trained / "work").glob("home-*.npz")}
    train(small(trained, "b"), Console(quiet=True))
    assert {p: p.stat().st_mtime_ns for p in seen} == seen
    for name in ("regions.npz", "segmenter.npz", "colour.npz"):
        with np.load(trained / "a" / name) as a, np.load(trained / "b" / name) as b:
            for key in a.files:
                np.testing.assert_array_equal(a[key], b[key], err_msg=f"{name} {key}")
    with pytest.raises(DataError, match="settings"):
        train(small(trained, "c", views=9), Console(quiet=True))


@pytest.mark.parametrize(
    "wrong",
    [{"homes": 0}, {"views": -1}, {"held": 2}, {"held": 0}, {"neck_share": 0.0}, {"threads": 0}, {"seed": -1}],
    ids=str,
)
def test_numbers_that_nothing_can_be_learned_with_are_refused_before_anything_is_built(
    wrong: dict[str, int], tmp_path: Path
):
    from openmap_agents.perception.training.run import train

    with pytest.raises(DataError, match="--" + next(iter(wrong)).replace("_", "-")):
        train(small(tmp_path, **wrong), Console(quiet=True))
    assert not list(tmp_path.iterdir())


def test_shards_hold_every_thing_twice_and_know_its_name(trained: Path):
    shard = Shard(sorted((trained / "work").glob("home-*.npz"))[0])
    assert shard.n == 8
    assert [shard.has_patches(k) for k in range(shard.n)] == [True] * 3 + [False] * 5
    lesson = shard.lesson(0)
    true = lesson.regions[lesson.kind_of_mask == 0]
    for number, pixels in zip(true.tolist(), lesson.pixels[lesson.kind_of_mask == 0].tolist(), strict=True):
        assert pixels == pytest.approx((lesson.local == number).sum() * 640 * 480 / lesson.local.size)
    assert set(shard.names) >= set(lesson.present.tolist()) & set(shard.names)
    assert np.isfinite(lesson.pooled.astype(np.float32)).all()


def test_damaged_lessons_are_named(tmp_path: Path):
    (tmp_path / "home-0000.npz").write_bytes(b"PK nothing")
    with pytest.raises(DataError, match="home-0000"):
        Shard(tmp_path / "home-0000.npz")


def test_rough_masks_are_made_of_whole_patches_and_mostly_right():
    rng = np.random.default_rng(0)
    patches = np.arange(20 * 20).reshape(20, 20).repeat(4, 0).repeat(4, 1).astype(np.int32)
    patches[:, :4] = -1
    local = np.ones((80, 80), np.int32)
    local[:, 40:] = 2
    rough = rough_masks(local, patches, rng)
    assert not rough[patches < 0].any()
    for p in range(0, 400, 7):
        assert len(np.unique(rough[patches == p])) <= 1
    agree = (rough == local)[patches >= 0].mean()
    assert 0.8 < agree < 1.0


def test_sensor_noise_leaves_depth_alone_or_near_and_holes_are_zero():
    rng = np.random.default_rng(0)
    v, u = np.mgrid[:120, :160].astype(np.float32)
    depth = (1.5 + 0.01 * u + np.where((v > 40) & (v < 80) & (u > 60) & (u < 100), -0.8, 0)).astype(np.float32)
    rgb = rng.integers(0, 255, (120, 160, 3), dtype=np.uint8)
    noise, ideal = SensorNoise(ideal_share=0.0), SensorNoise(ideal_share=1.0)
    out_rgb, out = noise(rgb, depth, np.random.default_rng(1))
    again_rgb, again = noise(rgb, depth, np.random.default_rng(1))
    np.testing.assert_array_equal(out, again)
    np.testing.assert_array_equal(out_rgb, again_rgb)
    assert out.dtype == np.float32
    assert out_rgb.dtype == np.uint8
    assert (out == 0).any()
    seen = out > 0
    assert 0.3 < seen.mean() < 1.0
    assert 0 < np.median(np.abs(out - depth)[seen]) < 0.03
    np.testing.assert_array_equal(ideal(rgb, depth, np.random.default_rng(1))[1], depth)
