"""Every choice of the map in one place, each with where it comes from.

"Paper" is OpenMap (MM '25), section 3.2; "code" is what the public code of it and of MaskClustering does where the paper is silent;
"ours" is a choice made here.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

Consensus = Literal["soft", "paper"]
Semantics = Literal["calibrated", "product", "structural", "alone"]
Visibility = Literal["labelled", "depth"]
Observers = Literal["visible", "contained"]


@dataclass(frozen=True)
class MappingSettings:
    """Settings of the reference and of the online mapper alike.

    Parameters
    ----------
    voxel_size : float
        Edge of a voxel, 0.005 to 1 m. Code: 0.03; ours: 0.04, half as many voxels for boxes that differ by under a centimetre.
    max_depth : float
        Readings beyond it are ignored, up to 100 m. Code: 20; ours: 10, where one pixel of a small picture outgrows a voxel.
    max_gap : float
        A surface is filled between neighbouring pixels of one mask up to this far apart, m; 0 = not at all. Ours, for small
        pictures: a pixel of a 128 pixel wide picture is 5 cm at 3 m.
    min_mask_pixels : int
        Smaller masks count as unlabelled. Code: 400 of 640 x 480; ours is lower, for small pictures and small things.
    min_mask_voxels : int
        Masks with fewer voxels count as unlabelled. Code: 25 points of 3 cm.
    visibility : {"labelled", "depth"}
        V_t, what a frame sees: voxels under a mask (code: a frame whose segmenter said nothing of a place is no witness), or all
        voxels that its depth hits (the paper's words).
    consensus : {"soft", "paper"}
        How masks become instances: by shares, best pair first (ours, ``reference_soft.py``), or as the paper has it: yes or no,
        whole components at a time (``reference.py``). Which settings only one of the two reads is said with them.
    tau_soft : float
        Soft: nodes join where R_struc * R_seman is at least this.
    doubt : float
        Soft: added to the frames that observe two nodes, so that one frame alone convinces less than many.
    min_share : float
        Soft: smaller shares of a node under a mask are edges that wander, and count as none.
    min_vote : float
        Soft: a voxel joins the instance that most of its sightings name if that is at least this share of them.
    trust : float
        Soft: the factor, at least 1, by which features that are sure of themselves raise or lower R_struc; 1 = no heed.
    tau_obs : float
        A frame observes a mask if more than this share of the mask's voxels is in V_t. Paper: 0.3.
    observers : {"visible", "contained"}
        Paper: frames that see more than tau_obs of a mask (the paper's words), or only those of them in which one mask contains it
        (code of both ancestors).
    tau_sub : float
        A frame's mask contains another if it holds at least this share of the visible voxels. Paper: 0.8. Above 0.5, so that
        at most one mask of a frame contains another.
    tau_thres : float
        Paper: nodes merge where R_struc * R_seman is at least this. Paper: 0.6.
    tau_structural : float
        Paper: the same threshold where features say nothing. MaskClustering: 0.9, but there only frames that contain a mask are its
        observers; ours: 0.8, measured with the paper's observers.
    tau_undersegmented : float
        A mask that is split in more than this share of its observers is under-segmented. Code: 0.3.
    observer_start, observer_step : int
        Percentile of the observer counts at which N_o starts, and by how much it falls a round. Paper: top 5 %, 5 %.
    semantics : {"calibrated", "product", "structural", "alone"}
        R_seman: a weight learned from the walk (``semantics.py``), the bare cosine (paper), or none (MaskClustering). "alone" is
        the bare cosine with R_struc = 1 wherever a frame holds both under one mask: the paper's ablation.
    min_masks : int
        Instances of fewer masks are dropped. Code: 2.
    detection_ratio : float
        A voxel stays in an instance if its masks hold it in more than this share of their frames that see it. Code: 0.5.
    split_distance : float
        Pieces of an instance that lie apart are split, in a grid of cells of about this edge, m. Code: DBSCAN with eps 0.1.
    min_voxels : int
        Smaller instances are dropped.
    tau_overlap : float
        An instance that lies in a larger one with more than this share of its voxels is dropped. Code: 0.8.
    top_k : int
        The features of this many largest masks are averaged. Paper: 5 (times 3 crop levels, which are the encoder's matter).
    max_views, min_novelty : int, float
        A frame is skipped if less than ``min_novelty`` of its voxels have been in fewer than ``max_views`` frames. Ours: it
        bounds the cost of a frame and the memory of a place when an agent turns on the spot. ``min_novelty`` 0 keeps all frames.
    """

    voxel_size: float = 0.04
    max_depth: float = 10.0
    max_gap: float = 0.25
    min_mask_pixels: int = 30
    min_mask_voxels: int = 8
    visibility: Visibility = "labelled"
    consensus: Consensus = "soft"
    tau_soft: float = 0.45
    doubt: float = 0.5
    min_share: float = 0.0625
    min_vote: float = 0.3
    trust: float = 1.3
    tau_obs: float = 0.3
    observers: Observers = "visible"
    tau_sub: float = 0.8
    tau_thres: float = 0.6
    tau_structural: float = 0.8
    tau_undersegmented: float = 0.3
    observer_start: int = 95
    observer_step: int = 5
    semantics: Semantics = "calibrated"
    min_masks: int = 2
    detection_ratio: float = 0.5
    split_distance: float = 0.1
    min_voxels: int = 8
    tau_overlap: float = 0.8
    top_k: int = 5
    max_views: int = 15
    min_novelty: float = 0.1

    def __post_init__(self) -> None:
        self._require("max_gap", lambda x: 0 <= x < 1, "at least 0 and below 1")
        # Below it, surfaces that are filled take gigabytes and numbers of voxels do not suffice.
        self._require("voxel_size", lambda x: 0.005 <= x <= 1, "within 0.005..1")
        self._require("max_depth", lambda x: 0 < x <= 100, "above 0 and at most 100")
        self._require("split_distance", lambda x: math.isfinite(x) and x > 0, "finite and positive")
        for name in (
            "min_mask_pixels",
            "min_mask_voxels",
            "min_masks",
            "min_voxels",
            "top_k",
            "max_views",
            "observer_step",
        ):
            self._require(name, lambda x: isinstance(x, int) and x >= 1, "a whole number of at least 1")
        for name in (
            "tau_obs",
            "tau_undersegmented",
            "detection_ratio",
            "tau_overlap",
            "min_novelty",
            "min_share",
            "min_vote",
        ):
            self._require(name, lambda x: 0 <= x <= 1, "within 0..1")
        self._require("trust", lambda x: 1 <= x <= 100, "within 1..100")
        self._require("doubt", lambda x: 0 <= x <= 100, "within 0..100")
        for name in ("tau_thres", "tau_structural", "tau_soft"):
            self._require(name, lambda x: 0 < x <= 1, "above 0 and at most 1")
        self._require("tau_sub", lambda x: 0.5 < x <= 1, "above 0.5 and at most 1")
        self._require("observer_start", lambda x: 0 <= x <= 100, "a percentile, 0..100")
        for name, choices in (
            ("semantics", get_args(Semantics)),
            ("consensus", get_args(Consensus)),
            ("observers", get_args(Observers)),
        ):
            self._require(name, lambda x, choices=choices: x in choices, f"one of {', '.join(choices)}")
        self._require("visibility", lambda x: x in ("labelled", "depth"), "labelled or depth")
        if self.tau_structural < self.tau_thres:
            raise ValueError(f"tau_structural is {self.tau_structural}, expected at least tau_thres, {self.tau_thres}")

    def _require(self, name: str, holds: object, expected: str) -> None:
        value = getattr(self, name)
        if not holds(value):  # type: ignore[operator]
            raise ValueError(f"{name} is {value!r}, expected {expected}")
