"""AP by masks, features, semantics and consensus; the peer, the reference and the paper's own figures beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, get_args

import numpy as np

from openmap_agents.mapping.settings import Consensus, Semantics
from openmap_eval.mapping.inputs import Features, MaskSpec
from openmap_eval.mapping.jobs import Job, Result, Store, mean_of
from openmap_eval.mapping.walks import WalkSpec
from openmap_eval.perception.tables import Cell, TextTable

CONSENSUS: tuple[Consensus, ...] = get_args(Consensus)
SEMANTICS: tuple[Semantics, ...] = ("structural", "alone", "product", "calibrated")
MARGINS = (0.0, 0.03)
"""Of the peer: the public code as it stands, and without the fault in its crop of the cloud."""
REFERENCE_FRAMES, REFERENCE_STEP = 24, 8
PAPER: dict[str, tuple[float, float | None, float | None]] = {
    "OpenMap, structural only": (12.2, None, None),
    "OpenMap, semantic only": (10.1, None, None),
    "OpenMap, both": (14.3, 26.0, 33.3),
    "MaskClustering": (12.0, 23.3, 30.1),
    "OVIR-3D": (9.3, 18.7, 25.0),
    "OpenMap, class-agnostic": (19.8, 38.0, 51.8),
    "MaskClustering, class-agnostic": (19.0, 36.6, 50.8),
    "OVIR-3D, class-agnostic": (14.4, 27.5, 38.8),
}
"""Published, on ScanNet200: AP, AP50, AP25 in percent."""
Rows = dict[str, Any]


def mask_specs(names: Sequence[str], seed: int) -> list[MaskSpec]:
    """Perfect, corrupted, embedded masks by name."""
    all_specs = [MaskSpec(), MaskSpec(strength=1.0, seed=seed), MaskSpec("embedded")]
    return [spec for spec in all_specs if spec.name in names]


def features_of(masks: MaskSpec) -> tuple[Features, ...]:
    """The features that go with masks, with any at all."""
    return ("own",) if masks.kind == "embedded" else ("good", "poor")


def table_jobs(walk: WalkSpec, masks: MaskSpec, seed: int) -> list[Job]:
    """All maps of the online mapper on a walk with certain masks; structure alone needs no features."""
    choices: list[tuple[Features, Semantics]] = [("none", "structural")]
    choices += [(f, s) for f in features_of(masks) for s in SEMANTICS[1:]]
    return [Job(walk, masks, f, consensus=c, semantics=s, seed=seed) for f, s in choices for c in CONSENSUS]


def reference_jobs(walk: WalkSpec, masks: MaskSpec, seed: int) -> list[Job]:
    """The reference beside the online mapper, on a small part of a walk."""
    small = replace(walk, every=1, first=REFERENCE_FRAMES, step=REFERENCE_STEP)
    # Its masks are of small pictures too; a segmenter makes nothing of those.
    return [
        replace(job, walk=small, method="reference")
        for job in table_jobs(small, masks, seed)
        if job.features in ("none", "good")
    ]


def peer_jobs(walk: WalkSpec, masks: MaskSpec, seed: int) -> list[Job]:
    """MaskClustering with both crops; OpenMap's public rule with features, without the fault."""
    jobs = [Job(walk, masks, method="peer", box_margin=margin, seed=seed) for margin in MARGINS]
    rule = Job(walk, masks, method="peer", semantics="product", box_margin=MARGINS[1], seed=seed)
    return jobs + [replace(rule, features=f) for f in features_of(masks)]


def as_rows(jobs: Sequence[Job], store: Store) -> list[Rows]:
    """Scores with what they are of, for JSON."""
    keep = ("ap", "ap50", "ap25", "ranked", "instances", "same", "fast_ap")
    return [
        {
            "walk": job.walk.source,
            "masks": job.masks.name,
            "features": job.features,
            "method": job.method,
            "consensus": job.consensus if job.method != "peer" else None,
            "semantics": job.semantics,
            "box_margin": job.box_margin if job.method == "peer" else None,
            **{name: store[job][name] for name in keep if name in store[job]},
        }
        for job in jobs
    ]


def main_tables(rows: Sequence[Rows]) -> list[TextTable]:
    """One table for each kind of masks, and one of what joining brings; means over scenes, and scene by scene."""
    tables = []
    for masks in dict.fromkeys(row["masks"] for row in rows):
        mine = [r for r in rows if r["masks"] == masks]
        walks = list(dict.fromkeys(r["walk"] for r in mine))
        columns = [f"{c} {name}" for c in CONSENSUS for name in ("AP", "AP50", "AP25", "ranked")]
        columns += [f"{c} AP, {short(w)}" for w in walks for c in CONSENSUS] if len(walks) > 1 else []
        lines = []
        for features, semantics in dict.fromkeys((r["features"], r["semantics"]) for r in mine):
            of = {
                c: [r for r in mine if (r["features"], r["semantics"], r["consensus"]) == (features, semantics, c)]
                for c in CONSENSUS
            }
            cells = [Cell(percent(v)) for c in CONSENSUS for v in (*_mean(of[c]), _ranked(of[c]))]
            if len(walks) > 1:
                cells += [
                    Cell(percent(_mean([r for r in of[c] if r["walk"] == w])[0])) for w in walks for c in CONSENSUS
                ]
            name = "structure alone" if features == "none" else f"{features} features, {TITLES[semantics]}"
            lines.append((name, cells))
        count = f"{len(walks)} walk{'s' if len(walks) > 1 else ''}"
        note = f"Class-agnostic, on things, %, mean of {count}; confidence 1, ranked: by the map's."
        tables.append(TextTable(f"Masks: {masks}", note, tuple(columns), lines))
    return tables


TITLES = {"alone": "features alone", "product": "both, plain product", "calibrated": "both, calibrated"}


def joint_table(rows: Sequence[Rows]) -> TextTable:
    """Whether structure and features together do better than each alone."""
    lines = []
    for masks in dict.fromkeys(r["masks"] for r in rows):
        for features in dict.fromkeys(r["features"] for r in rows if r["masks"] == masks and r["features"] != "none"):
            for c in CONSENSUS:
                mine = [r for r in rows if r["masks"] == masks and r["consensus"] == c]
                ap = {
                    s: _mean([r for r in mine if r["semantics"] == s and r["features"] in (features, "none")])[0]
                    for s in SEMANTICS
                }
                alone = max(ap["structural"], ap["alone"])
                cells = [Cell(percent(ap[s])) for s in SEMANTICS]
                cells += [Cell(f"{100 * (ap[s] - alone):+.1f}") for s in ("product", "calibrated")]
                lines.append((f"{masks} masks, {features} features, {c}", cells))
    columns = ("structure", "features", "product", "calibrated", "product gains", "calibrated gains")
    note = "AP, %, mean of walks; gains are over the better of structure alone and features alone."
    return TextTable("Do both together beat each alone?", note, columns, lines)


def peer_table(rows: Sequence[Rows]) -> TextTable:
    """MaskClustering and OpenMap's public rule on the same walks."""
    lines = []
    for key in dict.fromkeys((r["masks"], r["features"], r["semantics"], r["box_margin"]) for r in rows):
        mine = [r for r in rows if (r["masks"], r["features"], r["semantics"], r["box_margin"]) == key]
        masks, features, semantics, margin = key
        rule = "MaskClustering" if semantics == "structural" else f"OpenMap's public rule, {features} features"
        crop = "as published" if margin == 0 else f"crop widened by {margin:g} m"
        lines.append((f"{masks} masks, {rule}, {crop}", [Cell(percent(v)) for v in _mean(mine)]))
    note = "Class-agnostic, on things, %, mean of walks, on the cloud that the whole walk saw; confidence 1."
    return TextTable("MaskClustering on the same walks", note, ("AP", "AP50", "AP25"), lines)


def reference_table(rows: Sequence[Rows]) -> TextTable:
    """Whether the online mapper makes what the reference makes."""
    lines = []
    for r in rows:
        what = "structure alone" if r["features"] == "none" else TITLES[r["semantics"]]
        cells = [Cell(percent(r["ap"])), Cell(percent(r["fast_ap"])), Cell(str(r["instances"]))]
        lines.append(
            (
                f"{short(r['walk'])}, {r['masks']} masks, {r['consensus']}, {what}",
                [*cells, Cell("yes" if r["same"] else "NO")],
            )
        )
    note = f"Every {REFERENCE_STEP}th pixel of {REFERENCE_FRAMES} frames in 10 cm voxels, where the partition must be the same."
    return TextTable("The reference beside the online mapper", note, ("AP", "online AP", "instances", "same"), lines)


def paper_table() -> TextTable:
    """The published figures."""
    lines = [(name, [Cell("–" if v is None else f"{v:.1f}") for v in values]) for name, values in PAPER.items()]
    note = "Published, on ScanNet200 with a learned segmenter: other data, not to be compared in size."
    return TextTable("Paper, other data", note, ("AP", "AP50", "AP25"), lines)


def short(source: str) -> str:
    """The last part of a scene's or a recording's name, with its kind."""
    return source if len(source) < 24 else source.rstrip("/").rpartition("/")[2]


def percent(value: float) -> str:
    """For a cell."""
    return "–" if np.isnan(value) else f"{100 * value:.1f}"


def _mean(rows: Sequence[Mapping[str, Any]]) -> tuple[float, float, float]:
    ap, ap50, ap25 = mean_of([dict(r) for r in rows], "ap", "ap50", "ap25").tolist()
    return ap, ap50, ap25


def _ranked(rows: Sequence[Result]) -> float:
    return float(mean_of([r["ranked"] for r in rows], "ap")[0])
