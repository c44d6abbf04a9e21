"""RGB, depth and gravity -> class-agnostic masks of things.

Patches (``superpixels``) are described by what they measure and by what the neck says of their pixels (``regions``), and joined
to a tree (``joining``), each step the pair that most likely lies on one thing. Every node of the tree is a proposal; a second
network reads it, the way to its root included, and says how well it would do as a mask and whether it is floor, wall or ceiling.
The masks are the cut through the tree that promises most, so of overlapping proposals the best are kept and no two overlap.
All of it happens on the working picture of ``surface``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.front import FrontEnd, View
from openmap_agents.perception.joining import N_PAIR, Network, Tree, agglomerate, best_cut
from openmap_agents.perception.maps import cells_of
from openmap_agents.perception.protocol import Masks
from openmap_agents.perception.regions import N_REGION, Regions, add_belonging, describe, region_features
from openmap_agents.perception.superpixels import superpixels
from openmap_agents.perception.surface import Surface, to_full_size
from openmap_agents.perception.weights import FOLDER, load_weights
from openmap_scenes import PinholeCamera

MIN_PIXELS_VGA = 250  # smallest mask of a 640 x 480 picture; other sizes in proportion
LOWEST_JOIN = 0.05  # pairs less probable than this are never joined
N_NODE = N_REGION + 2
_STRUCTURE_AT = 0.95  # a window taken for wall is lost, a piece of wall taken for a thing is only called "wall" later


def plain_join() -> Network:
    """A hand-set rule to begin training with: gaps, creases and colour edges separate, convex edges and small size join."""
    w = np.zeros(N_PAIR)
    w[[0, 4, 5, 7, 8, 9, 10, 11]] = [-0.4, -1.5, -3.0, -1.5, 2.0, -0.8, -0.8, -0.8]
    return Network(np.stack([w, -w]), np.zeros(2), np.array([[1.0, -1.0]]), np.array([2.2]))


def patches_of(surface: Surface) -> npt.NDArray[np.int32]:
    """Patch numbers (h, w) from 0 without gaps; -1 where there is no depth, since such a patch has no place in the world."""
    return superpixels(surface, seen_only=True)


def node_features(tree: Tree, floor: float, pixels: int) -> npt.NDArray[np.float64]:
    """What a network may know of every node, (n, N_NODE): the region itself, how sure its join was and how sure the next is."""
    made, joined = np.ones(len(tree.sums)), np.zeros(len(tree.sums))
    made[tree.n_leaves :] = tree.probabilities
    joined[tree.children[:, 0]] = joined[tree.children[:, 1]] = tree.probabilities
    return np.column_stack([region_features(tree.sums, tree.extremes, floor, pixels), made, joined])


def described(
    patches: npt.NDArray[np.int32], surface: Surface, belonging: npt.NDArray[np.float32], camera: PinholeCamera
) -> Regions:
    """The patches' descriptions, what the neck says included."""
    regions = describe(patches, surface)
    add_belonging(regions, patches, belonging, *cells_of(surface.step, 4, camera.height, camera.width))
    return regions


def _network(arrays: dict[str, npt.NDArray[np.float32]], name: str) -> Network:
    return Network(*(arrays[f"{name}.{part}"].astype(np.float64) for part in ("w1", "b1", "w2", "b2")))


class EmbeddedSegmenter:
    """The default segmenter.

    Parameters
    ----------
    weights : Path, optional
        The folder of its networks; the installed one by default.
    front : FrontEnd, optional
        Shared with the encoder, so that a picture is looked at once.

    Raises
    ------
    DataError
        The weights cannot be used.
    """

    def __init__(self, weights: str | Path = FOLDER, front: FrontEnd | None = None) -> None:
        shapes: dict[str, tuple[int | None, ...]] = {}
        for name, inputs, outputs in (("join", N_PAIR, 1), ("node", N_NODE, 2)):
            shapes |= {
                f"{name}.w1": (None, inputs),
                f"{name}.b1": (None,),
                f"{name}.w2": (outputs, None),
                f"{name}.b2": (outputs,),
            }
        arrays = load_weights(Path(weights) / "segmenter.npz", shapes)
        self._join, self._node = _network(arrays, "join"), _network(arrays, "node")
        self.front = front or FrontEnd(weights)

    def segment(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> Masks:
        """Masks of a picture; none where there is no depth, none of floors, walls and ceilings.

        A mask's score is the IoU with a thing that the network promises, times the odds that it is a thing.
        """
        view = self.front.look(rgb, depth, T_world_camera, camera)
        labels, scores = self._masks(view)
        return Masks(to_full_size(labels, view.surface.step, camera.height, camera.width), scores)

    def _masks(self, view: View) -> tuple[npt.NDArray[np.int32], npt.NDArray[np.float32]]:
        """Labels of the working picture and their scores."""
        surface = view.surface
        patches = patches_of(surface)
        if patches.max(initial=-1) < 0:
            return np.zeros(surface.depth.shape, np.int32), np.zeros(0, np.float32)
        regions = described(patches, surface, view.features.belonging, view.camera)
        tree, _ = agglomerate(regions, surface.floor, self._join, LOWEST_JOIN)
        promise, structure = self._node(node_features(tree, surface.floor, patches.size)).T
        owner = best_cut(tree, tree.sums[:, 0] * promise)
        smallest = MIN_PIXELS_VGA / (640 * 480) * patches.size
        nodes = np.unique(owner)
        nodes = nodes[(tree.sums[nodes, 0] >= smallest) & (structure[nodes] < _STRUCTURE_AT)]
        number = np.zeros(len(tree.sums) + 1, np.int32)
        number[nodes] = np.arange(1, len(nodes) + 1)
        scores = promise[nodes] * (1.0 - structure[nodes])
        return number[np.append(owner, len(tree.sums))[patches]], scores.astype(np.float32)
