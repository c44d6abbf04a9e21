"""What perception reaches on a scene whose ids are known: ``python -m openmap_agents.perception.measure SPEC [VIEWS] [SEED]``.

Segmenter: the best IoU of any mask with each visible object (at least 400 pixels of a 640 x 480 picture, no wall, floor or
ceiling), its mean and the share at or above one half. Encoder: every category of the scene is asked for; R@k is the share of
categories of which an instance is among the first k. An instance's feature is the mean over its views: with the true masks, and
with the best predicted mask of each view where that has an IoU of at least 0.3. Labels: the share of instances whose own
category is the first, or among the first five, of all the scene's.
"""

from __future__ import annotations

import sys
import time
from collections import defaultdict

import numpy as np
import numpy.typing as npt
import psutil

from openmap_agents.perception import Encoder, Segmenter, make_encoder, make_segmenter
from openmap_agents.perception.overlap import ious, true_masks
from openmap_agents.perception.views import STRUCTURE, View, random_views
from openmap_scenes import PinholeCamera, load_scene

_MIN_IOU = 0.3


def retrieval(
    features: dict[int, npt.NDArray[np.float32]], categories: dict[int, str], encoder: Encoder
) -> dict[str, float]:
    """R@1, R@4, R@8 over the categories; top-1 and top-5 label accuracy over the instances."""
    if not features:
        return {}
    ids = sorted(features)
    names = sorted({categories[i] for i in ids})
    own = np.array([names.index(categories[i]) for i in ids])
    similarity = np.stack([features[i] for i in ids]) @ encoder.encode_text(names).T
    by_name, by_instance = np.argsort(-similarity, axis=0), np.argsort(-similarity, axis=1)
    found = {f"R@{k}": float(np.mean([(own[by_name[:k, c]] == c).any() for c in range(len(names))])) for k in (1, 4, 8)}
    found |= {f"top-{k}": float(np.mean((by_instance[:, :k] == own[:, None]).any(1))) for k in (1, 5)}
    return found | {"instances": float(len(ids)), "categories": float(len(names))}


class _Tally:
    """Sums of features by instance; their means as unit vectors."""

    def __init__(self) -> None:
        self._sums: dict[int, npt.NDArray[np.float64]] = defaultdict(lambda: np.zeros(1))

    def add(self, instance: int, feature: npt.NDArray[np.float32]) -> None:
        self._sums[instance] = self._sums[instance] + feature

    def means(self) -> dict[int, npt.NDArray[np.float32]]:
        return {i: (s / np.linalg.norm(s)).astype(np.float32) for i, s in self._sums.items()}


def measure(
    views: list[View], categories: dict[int, str], camera: PinholeCamera, segmenter: Segmenter, encoder: Encoder
) -> dict[str, dict[str, float]]:
    """All figures over the views of one scene; ``categories`` holds the objects' ids, without structure."""
    best: list[float] = []
    seconds: dict[str, list[float]] = defaultdict(list)
    counts: list[int] = []
    true_tally, predicted_tally = _Tally(), _Tally()
    for view in views:
        frame, pose = view.frame, view.T_world_camera
        start = time.perf_counter()
        masks = segmenter.segment(frame.rgb, frame.depth, pose, camera)
        seconds["segment"].append(time.perf_counter() - start)
        start = time.perf_counter()
        features = encoder.encode_regions(frame.rgb, frame.depth, masks, pose, camera)
        seconds["encode"].append(time.perf_counter() - start)
        counts.append(len(masks))
        truth, kept = true_masks(frame.instance, sorted(set(np.unique(frame.instance).tolist()) & set(categories)))
        for i, f in zip(kept, encoder.encode_regions(frame.rgb, frame.depth, truth, pose, camera), strict=True):
            true_tally.add(i, f)
        present, overlap = ious(masks.labels, frame.instance)
        for i in kept:
            row = overlap[np.searchsorted(present, i)]
            best.append(float(row.max(initial=0.0)))
            if best[-1] >= _MIN_IOU:
                predicted_tally.add(i, features[row.argmax()])
    return {
        "segmenter": {
            "best IoU": float(np.mean(best)),
            "recall@.5": float(np.mean(np.array(best) >= 0.5)),
            "objects": float(len(best)),
            "masks a frame": float(np.mean(counts)),
        },
        "encoder, true masks": retrieval(true_tally.means(), categories, encoder),
        "encoder, predicted masks": retrieval(predicted_tally.means(), categories, encoder),
        "median ms": {k: float(np.median(v) * 1e3) for k, v in seconds.items()},
        "memory": {"MiB": psutil.Process().memory_info().rss / 2**20},
    }


def main() -> None:
    """Print the figures of the scene named on the command line."""
    if len(sys.argv) < 2:
        raise SystemExit(__doc__)
    n, seed = (int(a) for a in (*sys.argv[2:4], *("60", "0")[len(sys.argv) - 2 :]))
    scene, camera = load_scene(sys.argv[1]), PinholeCamera.from_hfov(640, 480, 90.0)
    objects = {i.id: i.category for i in scene.instances if i.category and i.category not in STRUCTURE}
    views = list(random_views(scene, camera, n, np.random.default_rng(seed)))
    for part, values in measure(views, objects, camera, make_segmenter(), make_encoder()).items():
        print(f"{part}: " + ", ".join(f"{name} {value:.3g}" for name, value in values.items()))


if __name__ == "__main__":
    main()
