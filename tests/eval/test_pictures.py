"""Pictures put things where they are."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from openmap_agents.mapping import InstanceMap, MapInstance
from openmap_eval.pictures import (
    Plan,
    draw_instances,
    heat_picture,
    instance_colour,
    map_picture,
    mask_picture,
    write_png,
)
from openmap_scenes import DataError


def block(instance_id: int, x: float, z: float) -> MapInstance:
    grid = np.stack(np.meshgrid(np.arange(10), np.arange(5), np.arange(10)), -1).reshape(-1, 3) * 0.04
    return MapInstance(instance_id, (grid + np.array([x, 0.0, z])).astype(np.float32), None)


def test_an_instance_is_drawn_at_its_place_in_its_colour():
    near, far = block(1, -3.0, -3.0), block(2, 3.0, 3.0)
    plan = Plan.around(np.stack([near.centre, far.centre]), (400, 400))
    picture = plan.blank()
    draw_instances(picture, plan, [near, far])
    for instance in (near, far):
        column, row = plan.pixels(instance.centre[None])[0]
        assert tuple(picture[row, column]) == instance_colour(instance.id)
    column, row = plan.pixels(np.array([[3.0, 0.0, -3.0]]))[0]
    assert tuple(picture[row, column]) == tuple(plan.blank()[0, 0])


def test_x_runs_right_and_z_runs_down():
    plan = Plan.around(np.array([[-1.0, 0.0, -1.0], [1.0, 0.0, 1.0]]), (200, 200))
    left_top, right_bottom = plan.pixels(np.array([[-1.0, 0.0, -1.0], [1.0, 0.0, 1.0]]))
    assert (left_top < right_bottom).all()


def test_the_best_fit_is_the_brightest():
    instance_map = InstanceMap([block(1, -2.0, 0.0), block(2, 2.0, 0.0)])
    picture = heat_picture(instance_map, {1: 0.1, 2: 0.9}, {}, top=0)
    plan = Plan.around(
        np.stack([i.aabb_min for i in instance_map] + [i.aabb_max for i in instance_map]), (1000, 720), tight=True
    )
    dark, bright = (picture[row, column].astype(int).sum() for column, row in plan.pixels(instance_map.centres))
    assert bright > dark + 200


def test_an_empty_map_still_makes_a_picture():
    assert map_picture(InstanceMap(), {}).shape[2] == 3


def test_a_picture_that_cannot_be_written_is_one_error_and_leaves_nothing(tmp_path: Path):
    (tmp_path / "map.png").mkdir()
    with pytest.raises(DataError, match=r"map\.png: found no way to write it"):
        write_png(tmp_path / "map.png", np.zeros((4, 4, 3), np.uint8))
    assert [p.name for p in tmp_path.iterdir()] == ["map.png"]


def test_masks_are_tinted_and_the_rest_is_left_alone():
    rgb = np.full((20, 20, 3), 90, np.uint8)
    labels = np.zeros((20, 20), np.int32)
    labels[5:15, 5:15] = 1
    picture = mask_picture(rgb, labels)
    assert tuple(picture[0, 0]) == (90, 90, 90)
    assert tuple(picture[10, 10]) != (90, 90, 90)
