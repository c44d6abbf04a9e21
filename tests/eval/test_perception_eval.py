"""The measures of perception against plain twins and cases worked out by hand; the command, from a scene to its page."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from openmap_agents.perception import Masks, make_perception
from openmap_agents.perception.views import View, random_views
from openmap_env.episodes.vocabulary import load_data, vocabulary
from openmap_env.rendering import Frame
from openmap_eval import commands
from openmap_eval.bootstrap import balanced_figure, mean_figure
from openmap_eval.cli import main
from openmap_eval.perception.colour import colour_figures, true_colour, voted
from openmap_eval.perception.command import EvalPerception
from openmap_eval.perception.confusions import confusions
from openmap_eval.perception.figures import figures, scene_result
from openmap_eval.perception.labels import NameList, Ranks, own_ranks, ranks_of
from openmap_eval.perception.masks import (
    FALSE,
    LEFT_OUT,
    THRESHOLDS,
    TRUE,
    RankedMasks,
    ViewMasks,
    compare,
    mask_figures,
    verdicts,
)
from openmap_eval.perception.names import trained_names
from openmap_eval.perception.observe import Clock, Observed, Observer, Roles, observe
from openmap_eval.perception.retrieval import NEVER, category_ranks, first_rank, mean_features, recall_figures
from openmap_eval.perception.run import _trained, make_sensor, scene_specs, shown_views
from openmap_eval.perception.uses import serves, that_apply, uses
from openmap_scenes import DataError, Instance, PinholeCamera, Scene, load_scene

# --- masks ----------------------------------------------------------------------------------------------------------


def view_of(
    iou: npt.ArrayLike,
    scores: npt.ArrayLike,
    thing_pixels: npt.ArrayLike | None = None,
    mask_pixels: npt.ArrayLike | None = None,
    ignored: npt.ArrayLike | None = None,
) -> ViewMasks:
    """A view of things and masks of 5,000 pixels where nothing else is said; iou (m, n)."""
    n = len(np.asarray(scores))
    matrix = np.asarray(iou, np.float64)
    m = len(matrix)
    return ViewMasks(
        np.arange(1, m + 1, dtype=np.int32),
        matrix,
        np.asarray(scores, np.float64),
        np.full(m, 5000.0) if thing_pixels is None else np.asarray(thing_pixels, np.float64),
        np.full(n, 5000.0) if mask_pixels is None else np.asarray(mask_pixels, np.float64),
        np.zeros(n, bool) if ignored is None else np.asarray(ignored, bool),
    )


def plain_average_precision(views: list[ViewMasks], threshold: float, low: float, high: float) -> float:
    """AP as the COCO paper tells it, one mask and one recall at a time."""
    ranking: list[tuple[float, int, int, str]] = []
    total = 0
    for v, view in enumerate(views):
        counts = [low <= pixels < high for pixels in view.thing_pixels]
        total += sum(counts)
        taken: set[int] = set()
        for k in sorted(range(len(view.scores)), key=lambda k: (-view.scores[k], k)):
            fits = [t for t in range(len(view.things)) if t not in taken and view.iou[t, k] >= threshold]
            fits = [t for t in fits if counts[t]] or fits
            if fits:
                best = max(fits, key=lambda t: (view.iou[t, k], -t))
                taken.add(best)
                verdict = "true" if counts[best] else "left out"
            else:
                verdict = "left out" if view.ignored[k] or not low <= view.mask_pixels[k] < high else "false"
            ranking.append((-view.scores[k], v, k, verdict))
    if not total:
        return float("nan")
    kept = [verdict for *_, verdict in sorted(ranking) if verdict != "left out"]
    points = []
    for end in range(1, len(kept) + 1):
        found = kept[:end].count("true")
        points.append((found / total, found / end))
    recalls = np.linspace(0.0, 1.0, 101)
    return float(np.mean([max((p for r, p in points if r >= recall), default=0.0) for recall in recalls]))


@st.composite
def random_sets(draw: st.DrawFn, ties: bool = True) -> list[ViewMasks]:
    """One to four views with masks that may lie on one another, some of equal scores."""
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    views = []
    for _ in range(draw(st.integers(1, 4))):
        m, n = draw(st.integers(0, 5)), draw(st.integers(0, 6))
        scores = rng.integers(0, 4, n) / 4 if ties else rng.random(n)
        iou = np.where(rng.random((m, n)) < 0.5, rng.random((m, n)), 0.0)
        pixels = [rng.choice([500.0, 3000.0, 20000.0], size=k) for k in (m, n)]
        views.append(view_of(iou, scores, pixels[0], pixels[1], rng.random(n) < 0.3))
    return views


@settings(max_examples=60, deadline=None)
@given(views=random_sets(), bounds=st.sampled_from([(0.0, np.inf), (0.0, 1024.0), (1024.0, 9216.0)]))
def test_average_precision_is_that_of_the_plain_twin(views: list[ViewMasks], bounds: tuple[float, float]) -> None:
    fast = RankedMasks(views, *bounds).average_precision()
    plain = [plain_average_precision(views, t, *bounds) for t in THRESHOLDS]
    np.testing.assert_allclose(fast, plain, atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(views=random_sets(ties=False), data=st.data())
def test_a_view_that_counts_twice_is_a_view_that_is_there_twice(views: list[ViewMasks], data: st.DataObject) -> None:
    times = data.draw(st.lists(st.integers(0, 3), min_size=len(views), max_size=len(views)))
    repeated = [view for view, k in zip(views, times, strict=True) for _ in range(k)]
    weighted = RankedMasks(views).average_precision(np.array(times))
    np.testing.assert_allclose(weighted, RankedMasks(repeated).average_precision(), atol=1e-12)


def test_perfect_masks_have_an_average_precision_of_one() -> None:
    found = mask_figures([view_of(np.eye(3), [0.9, 0.2, 0.5]), view_of(np.eye(2), [0.1, 0.3])])
    assert {name: (f.value, f.low, f.high) for name, f in found["all"].items()} == dict.fromkeys(
        ("AP", "AP50", "AP75", "best IoU", "recall@.5"), (1.0, 1.0, 1.0)
    )
    assert found["all"]["AP"].n == 5
    assert found["medium"]["AP"].value == 1.0
    assert "large" not in found


def test_a_second_mask_of_a_thing_is_wrong_and_the_surer_one_right() -> None:
    twice = view_of([[1.0, 0.9]], [0.4, 0.8])
    assert verdicts(twice, 0.5).tolist() == [FALSE, TRUE]
    # The wrong one is ranked behind all there is to find: it costs nothing. Before it, it halves the precision.
    assert RankedMasks([twice]).average_precision()[0] == 1.0
    assert RankedMasks([view_of([[0.6, 1.0]], [0.8, 0.4])]).average_precision()[-1] == 0.5
    assert verdicts(view_of([[1.0, 1.0]], [0.5, 0.5]), 0.5).tolist() == [TRUE, FALSE]


def test_nothing_predicted_is_zero_and_nothing_to_find_is_no_figure() -> None:
    assert RankedMasks([view_of(np.zeros((2, 0)), [])]).average_precision().tolist() == [0.0] * 10
    assert mask_figures([view_of(np.zeros((0, 2)), [0.5, 0.4])]) == {}


def test_masks_of_other_sizes_and_in_ignored_regions_do_not_count() -> None:
    small_and_large = view_of(np.eye(2, 4), [0.9, 0.8, 0.7, 0.6], [500, 20000], [500, 20000, 500, 20000], [0, 0, 1, 0])
    assert verdicts(small_and_large, 0.5).tolist() == [TRUE, TRUE, LEFT_OUT, FALSE]
    assert verdicts(small_and_large, 0.5, 0, 1024).tolist() == [TRUE, LEFT_OUT, LEFT_OUT, LEFT_OUT]
    assert verdicts(small_and_large, 0.5, 9216).tolist() == [LEFT_OUT, TRUE, LEFT_OUT, FALSE]


def test_masks_are_held_against_things_background_and_what_is_not_known() -> None:
    ids = np.zeros((480, 640), np.int32)
    ids[:, :200] = 9  # a wall
    ids[100:200, 300:400] = 1  # a thing of 10,000 px
    ids[300:310, 300:330] = 2  # one of 300 px: too small to count
    ids[300:400, 500:600] = 3  # without a name
    labels = np.zeros(ids.shape, np.int32)
    labels[100:200, 300:380] = 1  # most of the thing
    labels[300:310, 300:330] = 2
    labels[320:400, 500:600] = 3
    labels[0:50, 0:100] = 4  # on the wall
    labels[450:470, 500:600] = 5  # on no instance
    labels[200:300, 150:220] = 6  # on the wall for the most part
    scores = np.linspace(0.9, 0.2, 7, dtype=np.float32)
    view = compare(Masks(labels, scores), ids, {1, 2, 77}, {9})
    assert view.things.tolist() == [1]
    np.testing.assert_allclose(view.iou, [[0.8, 0, 0, 0, 0, 0, 0]])
    assert view.ignored.tolist() == [False, True, True, False, True, False, False]
    assert view.thing_pixels.tolist() == [10_000]
    assert view.mask_pixels.tolist() == [8000, 300, 8000, 5000, 2000, 7000, 0]
    assert verdicts(view, 0.5)[:6].tolist() == [TRUE, LEFT_OUT, LEFT_OUT, FALSE, LEFT_OUT, FALSE]


# --- intervals ------------------------------------------------------------------------------------------------------


def test_intervals_cover_the_truth_about_as_often_as_they_say() -> None:
    rng = np.random.default_rng(5)
    covered = []
    for k in range(120):
        figure = mean_figure(rng.random(80) < 0.3, seed=k)
        assert figure is not None
        covered.append(figure.low <= 0.3 <= figure.high)
    assert 0.87 <= np.mean(covered) <= 1.0


def test_what_belongs_together_is_drawn_together() -> None:
    values = np.random.default_rng(0).random(30)
    once, tenfold = mean_figure(values, seed=2), mean_figure(np.repeat(values, 10), np.repeat(np.arange(30), 10), 2)
    assert once is not None
    assert tenfold is not None
    assert (once.low, once.high) == pytest.approx((tenfold.low, tenfold.high))
    assert mean_figure(values, seed=2) == once
    assert mean_figure([]) is None
    balanced = balanced_figure([1, 1, 1, 0], ["chair", "chair", "chair", "vase"])
    assert balanced is not None
    assert (balanced.value, balanced.n) == (0.5, 2)


# --- labels and retrieval -------------------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), n=st.integers(1, 6), kinds=st.integers(1, 8))
def test_the_rank_of_the_right_name_is_its_place_in_the_sorted_list(seed: int, n: int, kinds: int) -> None:
    rng = np.random.default_rng(seed)
    similarity, own = rng.integers(0, 4, (n, kinds)) / 4, rng.integers(0, kinds, n)
    plain = [sorted(range(kinds), key=lambda c: (-row[c], c)).index(o) for row, o in zip(similarity, own, strict=True)]
    assert own_ranks(similarity, own).tolist() == plain


def test_other_words_for_a_kind_are_right_among_all_names_but_not_among_a_scenes_own() -> None:
    assert vocabulary().kind("tv") == vocabulary().kind("television")
    every = NameList.every(["television", "wall", "vase"], ["tv", "vase"])
    assert len(every.words) == 4
    assert len(every.kinds) == 3
    # What is a tv looks most like "television", then like a vase, least like "tv".
    scores = {"television": 0.9, "vase": 0.5, "tv": 0.1, "wall": 0.0}
    similarity = np.array([[scores[w] for w in every.words]])
    assert ranks_of(similarity, every, ["tv"], np.array([True])).tolist() == [0]
    own = NameList.own(["tv", "vase", "vase"])
    assert own.words == ("tv", "vase")
    assert ranks_of(similarity[:, [every.words.index(w) for w in own.words]], own, ["tv"], np.array([True])) == [1]
    assert ranks_of(similarity, every, ["tv"], np.array([False])).tolist() == [NEVER]


def test_label_figures_by_hand() -> None:
    ranks = Ranks(
        np.array([0, 3, NEVER, 0]),
        ("chair", "chair", "chair", "harp"),
        np.array([0, 0, 0, 1], bool),
        np.array([0, 0, 1, 2]),
    )
    found = ranks.figures()
    assert {group: f["top-1"].value for group, f in found.items()} == {"all": 0.5, "seen": 1 / 3, "unseen": 1.0}
    assert {group: f["top-5"].value for group, f in found.items()} == {"all": 0.75, "seen": 2 / 3, "unseen": 1.0}
    assert found["all"]["balanced top-1"].value == pytest.approx((1 / 3 + 1) / 2)
    assert Ranks.joined([ranks, ranks]).units.tolist() == [0, 0, 1, 2, 3, 3, 4, 5]
    assert "unseen" not in Ranks(ranks.ranks, ranks.categories, np.zeros(4, bool), ranks.units).figures()


def test_retrieval_by_hand() -> None:
    categories = ["bed", "chair", "chair", "vase"]
    names = ["bed", "chair", "vase"]
    there = np.array([True, True, True, False])
    similarity = np.array([[0.9, 0.5, 0.1], [0.2, 0.5, 0.3], [0.8, 0.1, 0.2], [0.1, 0.2, 0.9]])
    # The bed comes first for "bed"; for "chair" it ties with a chair and is listed before it; no mask showed the vase.
    ranks = category_ranks(similarity, categories, names, there)
    assert ranks.tolist() == [0, 1, NEVER]
    found = recall_figures(ranks)
    assert [found[f"R@{k}"].value for k in (1, 4, 8)] == pytest.approx([1 / 3, 2 / 3, 2 / 3])
    assert first_rank(np.array([0.1, 0.2]), np.array([True, False]), np.array([True, True])) == 1
    assert recall_figures(np.zeros(0, np.int64)) == {}


def test_an_instances_feature_is_the_unit_mean_of_its_views() -> None:
    features = np.array([[1.0, 0.0], [0.0, 1.0], [0.6, 0.8]])
    means, there = mean_features(features, np.array([2, 2, 0]), 3)
    np.testing.assert_allclose(means, [[0.6, 0.8], [0, 0], [2**-0.5, 2**-0.5]], atol=1e-6)
    assert there.tolist() == [True, False, True]


def test_uses_are_forty_of_known_kinds_and_in_words_of_their_own() -> None:
    assert len(uses()) == 40
    known = set(vocabulary().names) | {kind for parents in vocabulary().parents.values() for kind in parents}
    for question, kinds in uses().items():
        assert kinds
        assert {kind.removeprefix("=") for kind in kinds} <= known, question
    sentences = {s.lower() for need in load_data("needs.json")["needs"].values() for s in need["sentences"]}
    assert not sentences & set(uses())
    assert serves("something to sit on", ["armchair", "bed", "loveseat", "vase"]).tolist() == [True, False, True, False]
    assert serves("to eat a meal at", ["dining table", "nightstand", "table"]).tolist() == [True, False, True]
    assert that_apply(["refrigerator"]) == ["to keep food cold"]


# --- colour, names, what the command takes --------------------------------------------------------------------------


def instance(category: str, **attributes: str) -> Instance:
    return Instance(1, category, np.zeros(3), -np.ones(3), np.ones(3), attributes=attributes)


def test_colours_are_voted_for_and_only_said_of_what_has_one() -> None:
    assert voted(["red", "blue", "red", "white"], np.array([0, 0, 0, 2]), 3) == ["red", None, "white"]
    assert voted(["red", "grey"], np.array([0, 0]), 1) == ["grey"]  # listed before red
    assert true_colour(instance("sofa", colour="blue")) == "blue"
    assert true_colour(instance("sofa")) is None
    assert true_colour(instance("plant", colour="blue")) is None
    assert true_colour(instance("sofa", colour="no such colour")) is None
    found = colour_figures(["red", None, "blue", "blue"], ["red", "red", "red", "blue"], np.arange(4))
    assert (found["right"].value, found["balanced"].value) == pytest.approx((0.5, (1 / 3 + 1) / 2))
    assert colour_figures([], [], np.zeros(0, np.int64)) == {}


@pytest.mark.parametrize("content", ["", "[", "[1]", "[]", '{"words": []}', '{"names": "a"}', '[""]'])
def test_names_that_are_none_end_in_one_error(content: str, tmp_path: Path) -> None:
    path = tmp_path / "names.json"
    path.write_text(content)
    with pytest.raises(DataError, match="names that the embedded weights"):
        trained_names(path)
    with pytest.raises(DataError, match="no readable list"):
        trained_names(tmp_path / "nowhere.json")


@pytest.mark.parametrize("content", [["b", "a", "b"], {"names": ["a", "b"]}, {"names": {"a": 3, "b": 1}}])
def test_names_are_read(content: object, tmp_path: Path) -> None:
    path = tmp_path / "names.json"
    path.write_text(json.dumps(content))
    assert trained_names(path) == ["a", "b"]


def test_what_is_measured_on(tmp_path: Path) -> None:
    assert scene_specs(EvalPerception(tmp_path, split="homes/val", homes=2)) == ["homes:val/0", "homes:val/1"]
    for wrong in (
        EvalPerception(tmp_path),
        EvalPerception(tmp_path, ("homes:val/0",), "homes/val"),
        EvalPerception(tmp_path, ("homes:val/0",) * 2),
        EvalPerception(tmp_path, ("homes:val/0",), views=0),
    ):
        with pytest.raises(DataError):
            scene_specs(wrong)
    assert shown_views(1, 12) == [frozenset(range(12))]
    assert [len(s) for s in shown_views(3, 60)] == [4, 4, 4]
    assert shown_views(2, 1) == [frozenset({0})] * 2


def test_a_real_sensor_spoils_every_picture_and_the_same_seed_the_same_way() -> None:
    rgb, depth = np.full((60, 80, 3), 90, np.uint8), np.full((60, 80), 2.0, np.float32)
    real = make_sensor("real")
    for seed in range(5):
        first, again = real(rgb, depth, np.random.default_rng(seed)), real(rgb, depth, np.random.default_rng(seed))
        assert all(a.tobytes() == b.tobytes() for a, b in zip(first, again, strict=True))
        assert not np.array_equal(first[0], rgb)
        assert not np.array_equal(first[1], depth)
    assert make_sensor("ideal")(rgb, depth, np.random.default_rng(0))[1] is depth


# --- from pictures to figures ---------------------------------------------------------------------------------------

AXES = {"sofa": [1, 0, 0], "vase": [0, 1, 0], "bed": [0, 0, 1]}
AXES |= {"something to sit on": AXES["sofa"], "to stand cut flowers in": AXES["vase"]}
CAMERA = PinholeCamera.from_hfov(64, 48, 90.0)


class Halves:
    """Masks of the left and of the right half of a picture, and an encoder that takes everything for a sofa."""

    dim = 3

    def segment(self, rgb: np.ndarray, *_: object) -> Masks:
        labels = np.ones(rgb.shape[:2], np.int32)
        labels[:, rgb.shape[1] // 2 :] = 2
        return Masks(labels, np.array([0.9, 0.8], np.float32))

    def encode_regions(self, rgb: np.ndarray, depth: object, masks: Masks, *_: object) -> np.ndarray:
        return np.tile(np.array(AXES["sofa"], np.float32), (len(masks), 1))

    def encode_text(self, texts: list[str]) -> np.ndarray:
        return np.array([AXES[t] for t in texts], np.float32).reshape(-1, 3)


def halves_observed(any_masks: bool) -> Observed:
    """Two views: a sofa beside a vase, and a vase in the right third alone."""
    things = {1: instance("sofa", colour="red"), 2: instance("vase", colour="blue")}
    ids = np.ones((2, 48, 64), np.int32)
    ids[0, :, 32:], ids[1, :, :], ids[1, :, 48:] = 2, 9, 2
    halves = Halves()
    observer = Observer(
        Roles(things, frozenset({9})),
        CAMERA,
        halves,
        halves,
        make_sensor("ideal"),
        np.random.default_rng(0),
        Clock(),
        any_masks,  # type: ignore[arg-type]
    )
    rgb, depth = np.full((48, 64, 3), (220, 30, 30), np.uint8), np.ones((48, 64), np.float32)
    return observe([View(Frame(rgb, depth, i), np.eye(4)) for i in ids], observer, "halves", {1})


def test_what_is_said_of_pictures_becomes_figures() -> None:
    observed, encode = halves_observed(True), Halves().encode_text
    assert [i.category for i in observed.things] == ["sofa", "vase"]
    assert observed.boxes.tolist() == [[0, 0, 32, 48], [32, 0, 64, 48], [48, 0, 64, 48]]
    assert len(observed.shown) == 1
    found = figures([scene_result(observed, ["bed", "sofa"], encode)])
    # In the second view a half covers the vase with an IoU of one half.
    assert found["masks"]["all"]["recall@.5"].value == 1.0
    assert found["masks"]["all"]["best IoU"].value == pytest.approx(2.5 / 3)
    for side in ("true masks", "predicted masks"):
        labels = found[side]["labels"]["own names"]["instances"]
        assert (labels["seen"]["top-1"].value, labels["unseen"]["top-1"].value) == (1.0, 0.0)
        assert labels["all"]["top-5"].value == 1.0
        assert found[side]["labels"]["all names"]["views"]["all"]["top-1"].value == pytest.approx(1 / 3)
        assert [found[side]["categories"][f"R@{k}"].value for k in (1, 4)] == [0.5, 1.0]
        assert [found[side]["uses"][f"R@{k}"].value for k in (1, 4)] == [0.5, 1.0]
        assert found[side]["colour"]["instances"]["right"].value == 0.5
    (worst,) = confusions([observed], ["bed", "sofa"], encode)
    assert (worst.kind, worst.taken_for, worst.instances, worst.views, worst.kind_views) == ("vase", "sofa", 1, 2, 2)
    assert len(worst.examples) == 2


def test_features_that_were_made_elsewhere_are_measured_with_their_masks_alone() -> None:
    observed = halves_observed(False)
    assert observed.true is None
    found = figures([scene_result(observed, ["bed"], Halves().encode_text)] * 2)
    assert "true masks" not in found
    assert found["predicted masks"]["categories"]["R@1"].n == 4
    assert len(confusions([observed], ["bed"], Halves().encode_text)) == 1


def test_the_command_measures_a_scene_and_writes_its_page(
    toy_specs: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = tmp_path / "names.json"
    names.write_text(json.dumps(["bed", "chair", "sofa", "wall"]))
    arguments = ["--views", "3", "--width", "160", "--height", "120", "--perception", "oracle", "--names", str(names)]
    out = tmp_path / "out"
    main(["eval", "perception", "--scene", *toy_specs, "--out", str(out), *arguments])
    printed = capsys.readouterr().out
    content = json.loads((out / "perception.json").read_text())
    page = (out / "perception.html").read_text()
    assert "ORACLE" in printed
    assert "ORACLE" in page
    assert content["oracle"]
    assert list(content["scenes"]) == toy_specs
    for found in (content["figures"], *content["scenes"].values()):
        assert found["masks"]["all"]["recall@.5"]["value"] == 1.0
        # Whoever is told is right; walls are masks of the oracle, and wrong.
        assert found["masks"]["all"]["AP"]["value"] < 1.0
        for side in ("true masks", "predicted masks"):
            assert found[side]["categories"]["R@1"]["value"] == 1.0
            assert found[side]["labels"]["all names"]["views"]["all"]["top-1"]["value"] == 1.0
            assert found[side]["labels"]["own names"]["instances"]["unseen"]["top-1"]["n"] > 0
    assert content["figures"]["counts"]["things"] == 2 * content["scenes"][toy_specs[0]]["counts"]["things"]
    assert set(content["timing"]["ms"]) == {"segment", "encode", "text"}
    assert page.count('class="frame"') == 6
    assert "http" not in page.replace("http://www.w3.org", "")

    with pytest.raises(SystemExit) as stopped:
        main(["eval", "perception", "--out", str(out)])
    assert stopped.value.code == 2
    assert "neither --scene nor --split" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["eval", "perception", "--scene", *toy_specs, "--out", str(names), *arguments])
    refused = capsys.readouterr().out
    assert "--out: found" in refused
    assert "recall" not in refused  # before anything was measured


def test_the_names_are_those_beside_the_weights_in_use(tmp_path: Path) -> None:
    (tmp_path / "names.json").write_text(json.dumps(["bed", "sofa"]))
    command = EvalPerception(tmp_path)
    assert _trained(command, f"embedded:{tmp_path}") == ["bed", "sofa"]
    assert len(_trained(command, "embedded")) > 2


def test_eval_itself_takes_what_it_took(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = []
    monkeypatch.setattr(commands, "run_eval", lambda command, console: asked.append(command))
    main(["eval", "--scene", "homes:val/0", "--out", str(tmp_path), "--perception", "oracle"])
    main(["eval", "--perception", "embedded", "--scene", "homes:val/0", "--out", str(tmp_path)])
    assert [command.perception for command in asked] == ["oracle", "embedded"]


def test_what_is_seen_in_a_house_is_found_by_its_name_more_often_than_by_chance(shared_scenes: Path) -> None:
    scene: Scene = load_scene(f"mp3d:{shared_scenes / 'mp3d' / 'aws_small_house'}")
    camera = PinholeCamera.from_hfov(320, 240, 90.0)
    segmenter, encoder = make_perception()
    views = random_views(scene, camera, 8, np.random.default_rng(3))
    rng, clock = np.random.default_rng(0), Clock()
    observer = Observer(Roles.of(scene), camera, segmenter, encoder, make_sensor("ideal"), rng, clock)
    found = figures([scene_result(observe(views, observer, "house", set()), ["chair"], encoder.encode_text)])
    assert found["masks"]["all"]["best IoU"].value > 0.35
    true = found["true masks"]
    # Chance is the mean of 1 - (1 - share of a category)^4, under 0.25 for this house's 20 to 40 categories.
    assert true["categories"]["R@4"].n > 10
    assert true["categories"]["R@4"].value > 0.4
    assert true["labels"]["own names"]["instances"]["all"]["top-5"].value > 0.4
    assert len(clock.wall["segment"]) == 8
