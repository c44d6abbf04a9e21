"""Batches lose no face, and frustum culling drops none that shows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_env.rendering.geometry import projection_matrix, split_into_batches, view_matrix, visible_boxes
from openmap_scenes import PinholeCamera


def random_mesh(rng: np.random.Generator, n_faces: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    vertices = rng.uniform(-5, 5, (n_faces * 3, 3)).astype(np.float32)
    return vertices, np.arange(n_faces * 3).reshape(-1, 3), rng.integers(0, 4, n_faces)


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n_faces=st.integers(1, 200), size=st.integers(1, 50))
def test_batches_hold_every_face_once_by_group_and_inside_their_boxes(seed: int, n_faces: int, size: int) -> None:
    vertices, faces, group = random_mesh(np.random.default_rng(seed), n_faces)
    batches = split_into_batches(vertices, faces, group, size)
    assert sorted(batches.order.tolist()) == list(range(n_faces))
    assert batches.starts[0] == 0
    assert batches.starts[-1] == n_faces
    for b in range(len(batches)):
        members = batches.order[batches.starts[b] : batches.starts[b + 1]]
        assert 1 <= len(members) <= size
        assert (group[members] == batches.group[b]).all()
        corners = vertices[faces[members]]
        np.testing.assert_allclose(corners.min((0, 1)), batches.low[b])
        np.testing.assert_allclose(corners.max((0, 1)), batches.high[b])


@settings(max_examples=60, deadline=None)
@given(seed=st.integers(0, 2**32 - 1))
def test_culling_keeps_every_box_with_a_point_in_view(seed: int) -> None:
    rng = np.random.default_rng(seed)
    camera = PinholeCamera(64, 48, *rng.uniform(20, 90, 2), *rng.uniform(0, 48, 2))
    T = np.eye(4)
    T[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    T[:3, 3] = rng.uniform(-5, 5, 3)
    low = rng.uniform(-6, 6, (40, 3))
    high = low + rng.uniform(0, 2, (40, 3))
    near, far = 0.1, 8.0
    kept = visible_boxes(low, high, projection_matrix(camera, near, far) @ view_matrix(T), T[:3, 3])
    for box in range(40):
        uv, depth = camera.project(rng.uniform(low[box], high[box], (60, 3)), T)
        inside = (depth > near) & (depth < far) & (uv > -0.5).all(1) & (uv < (63.5, 47.5)).all(1)
        assert box in kept or not inside.any()
    gaps = np.linalg.norm(np.maximum(np.maximum(low - T[:3, 3], T[:3, 3] - high), 0), axis=1)[kept]
    assert (np.diff(gaps) >= 0).all()


def test_culling_drops_what_lies_behind_and_beside() -> None:
    camera = PinholeCamera.from_hfov(64, 64, 90)
    low = np.array([[-1.0, -1, -5], [-1, -1, 2], [9, -1, -5]])
    kept = visible_boxes(low, low + 1, projection_matrix(camera, 0.1, 100.0), np.zeros(3))
    assert kept.tolist() == [0]


@pytest.mark.parametrize(("u", "v"), [(0, 0), (63, 47), (10, 40)])
def test_pixel_centres_at_integers_land_on_frame_buffer_centres(u: int, v: int) -> None:
    camera = PinholeCamera(64, 48, 50.0, 40.0, 20.25, 30.5)
    point = 3.0 * camera.rays()[v, u].astype(np.float64)
    clip = projection_matrix(camera, 0.1, 10.0) @ (*point, 1.0)
    np.testing.assert_allclose((clip[:2] / clip[3] + 1) / 2 * (64, 48), (u + 0.5, v + 0.5), atol=1e-5)
    assert clip[3] == pytest.approx(3.0)
