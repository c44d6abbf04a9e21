"""Textures packed into few arrays show what each of them shows alone."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st
from rendering_cases import scene_of

from openmap_env.rendering.textures import MAX_LAYERS, TexturePlan, plan_textures, resampled
from openmap_scenes import Material, Scene

QUAD = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]


def scene_with(pictures: list[npt.NDArray[np.uint8] | None]) -> Scene:
    materials = [Material("m", np.ones(3, np.float32), picture) for picture in pictures]
    return scene_of([(QUAD, m, 1) for m in range(len(materials))], materials)


def picture(h: int, w: int, seed: int = 0) -> npt.NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(256, size=(h, w, 3), dtype=np.uint8)


def layer_of(plan: TexturePlan, material: int) -> npt.NDArray[np.uint8]:
    return plan.layer_pixels(int(plan.group[material]), int(plan.layer[material]))


@given(
    st.lists(
        st.tuples(st.sampled_from([1, 2, 8, 16, 64, 128]), st.sampled_from([1, 4, 32, 256])), min_size=1, max_size=12
    )
)
def test_a_texel_lies_where_the_scaled_coordinates_of_the_picture_lead(sizes: list[tuple[int, int]]) -> None:
    pictures = [picture(h, w, n) for n, (h, w) in enumerate(sizes)]
    plan = plan_textures(scene_with(list(pictures)))
    for m, (own, (h, w)) in enumerate(zip(pictures, sizes, strict=True)):
        layer = layer_of(plan, m)
        assert (layer[..., 3] == 255).all()
        for v, u in ((0.3, 0.7), (1.4, -2.2), (0.0, 0.0)):
            texel = own[int(np.floor(v % 1.0 * h)), int(np.floor(u % 1.0 * w))]
            su, sv = np.array([u, v]) * plan.scale[m].astype(float)
            there = layer[int(np.floor(sv % 1.0 * layer.shape[0])), int(np.floor(su % 1.0 * layer.shape[1])), :3]
            np.testing.assert_array_equal(there, texel)


def test_a_home_s_many_sizes_share_few_arrays() -> None:
    sizes = [(2**a, 2**b) for a in range(1, 9) for b in range(1, 9)] + [(97, 128), (48, 48), (160, 57)]
    plan = plan_textures(scene_with([picture(h, w) for h, w in sizes]))
    assert len(plan.sizes) <= 2


def test_large_scans_are_not_blown_up() -> None:
    pictures = [np.zeros((s, s, 3), np.uint8) for s in (2048,) * 6 + (1024,) * 20 + (64,) * 30]
    plan = plan_textures(scene_with(list(pictures)))
    texels = sum(h * w * len(p) for (h, w), p in zip(plan.sizes, plan.pictures, strict=True))
    assert texels < 1.6 * sum(p.shape[0] * p.shape[1] for p in pictures)


def test_materials_without_texture_share_one_white_layer_and_a_picture_is_held_once() -> None:
    one = picture(16, 16)
    plan = plan_textures(scene_with([None, one, None, one]))
    assert sum(len(p) for p in plan.pictures) == 2
    assert (plan.group[0], plan.layer[0]) == (plan.group[2], plan.layer[2])
    assert (plan.group[1], plan.layer[1]) == (plan.group[3], plan.layer[3])
    assert (layer_of(plan, 0) == 255).all()


def test_more_pictures_than_an_array_has_layers_take_another_array() -> None:
    plan = plan_textures(scene_with([picture(2, 2, n) for n in range(MAX_LAYERS + 5)]))
    assert [len(p) for p in plan.pictures] == [MAX_LAYERS, 5]


@pytest.mark.parametrize(("h", "w"), [(3, 5), (48, 48), (97, 128), (160, 57)])
def test_a_resampled_picture_looks_the_same_and_its_edges_still_meet(h: int, w: int) -> None:
    y, x = np.mgrid[:h, :w]
    wave = (127.5 + 100.0 * np.sin(2 * np.pi * (x + 0.5) / w) * np.cos(2 * np.pi * (y + 0.5) / h)).astype(np.uint8)
    big_h, big_w = 2 * h + 3, 2 * w + 1
    y, x = np.mgrid[:big_h, :big_w]
    expected = 127.5 + 100.0 * np.sin(2 * np.pi * (x + 0.5) / big_w) * np.cos(2 * np.pi * (y + 0.5) / big_h)
    found = resampled(np.repeat(wave[..., None], 3, axis=2), big_h, big_w)
    # Straight lines between the samples of a sine are off by up to (pi / n)^2 / 2 of its height along each axis.
    bound = 3.0 + 100.0 * sum(min(1.0, (np.pi / n) ** 2 / 2) for n in (h, w))
    assert np.abs(found[..., 0] - expected).max() <= bound
