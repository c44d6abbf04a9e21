"""The map of a perfect eye has every instance with its own id, name and box."""

import numpy as np

from openmap_agents.baselines.true_map import true_map
from openmap_agents.perception.text import TextEncoder
from openmap_scenes import Scene


def test_instances_are_the_scenes(toy_scene: Scene) -> None:
    found = true_map(toy_scene, TextEncoder())
    true = {instance.id: instance for instance in toy_scene.instances}
    assert {instance.id for instance in found} == set(true)
    for instance in found:
        assert instance.label == true[instance.id].category
        np.testing.assert_allclose(instance.aabb_min, true[instance.id].aabb_min, atol=1e-4)
        np.testing.assert_allclose(instance.aabb_max, true[instance.id].aabb_max, atol=1e-4)
        np.testing.assert_allclose(instance.centre, true[instance.id].centre, atol=1e-4)
