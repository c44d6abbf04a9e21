"""RGB, depth and gravity -> class-agnostic masks of things.

Patches (``superpixels``) are joined to a tree (``regions``), each step the pair that most likely lies on one thing. A second
network reads every node of the tree, the way to its root included, and says how well it would do as a mask; the masks are the
cut through the tree that promises most. A third says which of them are floor, wall or ceiling: those are dropped.
All of it happens on the working picture of ``surface``. ``train`` made the networks.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from openmap_agents.perception.protocol import Masks
from openmap_agents.perception.regions import (
    N_PAIR,
    N_REGION,
    Network,
    Tree,
    agglomerate,
    best_cut,
    describe,
    region_features,
)
from openmap_agents.perception.superpixels import superpixels
from openmap_agents.perception.surface import Surface, to_full_size, working_picture
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
    patches = superpixels(surface)
    kept, inverse = np.unique(np.where(surface.depth > 0, patches, -1), return_inverse=True)
    return np.asarray(inverse.reshape(patches.shape) - (1 if kept[0] == -1 else 0), np.int32)


def node_features(tree: Tree, floor: float, pixels: int) -> npt.NDArray[np.float64]:
    """What a network may know of every node, (n, N_NODE): the region itself, how sure its join was and how sure the next is."""
    made, joined = np.ones(len(tree.sums)), np.zeros(len(tree.sums))
    made[tree.n_leaves :] = tree.probabilities
    joined[tree.children[:, 0]] = joined[tree.children[:, 1]] = tree.probabilities
    return np.column_stack([region_features(tree, floor, pixels), made, joined])


def _network(arrays: dict[str, npt.NDArray[np.float32]], name: str) -> Network:
    return Network(*(arrays[f"{name}.{part}"].astype(np.float64) for part in ("w1", "b1", "w2", "b2")))


class EmbeddedSegmenter:
    """The default segmenter.

    Parameters
    ----------
    weights : Path, optional
        Its networks; the installed ones by default.

    Raises
    ------
    DataError
        The weights cannot be used.
    """

    def __init__(self, weights: str | Path = FOLDER / "segmenter.npz") -> None:
        shapes: dict[str, tuple[int | None, ...]] = {}
        for name, inputs, outputs in (("join", N_PAIR, 1), ("node", N_NODE, 2)):
            shapes |= {
                f"{name}.w1": (None, inputs),
                f"{name}.b1": (None,),
                f"{name}.w2": (outputs, None),
                f"{name}.b2": (outputs,),
            }
        arrays = load_weights(Path(weights), shapes)
        self._join, self._node = _network(arrays, "join"), _network(arrays, "node")

    def segment(
        self,
        rgb: npt.NDArray[np.uint8],
        depth: npt.NDArray[np.float32],
        T_world_camera: npt.NDArray[np.floating],
        camera: PinholeCamera,
    ) -> Masks:
        """Masks of a picture; none where there is no depth, none of floors, walls and ceilings.

        A mask's score is the IoU with a thing that the network promises.
        """
        surface = working_picture(rgb, depth, T_world_camera, camera)
        patches = patches_of(surface)
        if patches.max() < 0:
            return Masks(np.zeros((camera.height, camera.width), np.int32), np.zeros(0, np.float32))
        tree, _ = agglomerate(describe(patches, surface), surface.floor, self._join, LOWEST_JOIN)
        promise, structure = self._node(node_features(tree, surface.floor, patches.size)).T
        owner = best_cut(tree, tree.sums[:, 0] * promise)
        smallest = MIN_PIXELS_VGA / (640 * 480) * patches.size
        nodes = np.unique(owner)
        nodes = nodes[(tree.sums[nodes, 0] >= smallest) & (structure[nodes] < _STRUCTURE_AT)]
        number = np.zeros(len(tree.sums) + 1, np.int32)
        number[nodes] = np.arange(1, len(nodes) + 1)
        labels = number[np.append(owner, len(tree.sums))[patches]]
        return Masks(to_full_size(labels, surface.step, camera.height, camera.width), promise[nodes].astype(np.float32))
