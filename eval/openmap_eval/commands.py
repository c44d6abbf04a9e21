"""What the commands of the command line do."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

from openmap_eval.console import ProgressBars, print_answers, print_summary
from openmap_eval.gallery import Gallery
from openmap_eval.records import RecordFile
from openmap_eval.report import ORACLE, oracle_note, write_report
from openmap_eval.runner import EvalSettings, SceneTask, described, evaluate
from openmap_eval.video import WalkVideo
from openmap_scenes import DataError

if TYPE_CHECKING:
    from openmap_agents.grounding import Grounding
    from openmap_agents.mapping import InstanceMap
    from openmap_eval.cli import Eval, Query


def run_eval(command: Eval, console: Console) -> None:
    """``openmap eval``: evaluate, print the tables, write the report."""
    settings = EvalSettings(
        agent=command.agent,
        perception=command.perception,
        segmenter=command.segmenter,
        encoder=command.encoder,
        llm=command.llm,
        protocol=command.protocol,
        stop_confidence=command.stop_confidence,
        seed=command.seed,
        renderer=command.renderer,
        width=command.width,
        height=command.height,
        max_steps=command.max_steps,
    )
    evaluate_and_report(_tasks(command), settings, command.out, console, video=command.video)


def _tasks(command: Eval) -> list[SceneTask]:
    if (command.scene is None) == (command.split is None):
        found = "neither --scene nor --split" if command.scene is None else "both --scene and --split"
        raise DataError("the command line", found, "one of them")
    episodes = int(command.episodes) if command.episodes.isdigit() else Path(command.episodes)
    if isinstance(episodes, int) and episodes < 1:
        raise DataError("--episodes", "0", "at least one, or a file of episodes")
    if command.scene is not None:
        return [SceneTask(command.scene, episodes)]
    if command.homes < 1:
        raise DataError("--homes", str(command.homes), "at least one")
    split = str(command.split).partition("/")[2]
    return [SceneTask(f"homes:{split}/{n}", episodes) for n in range(command.homes)]


def evaluate_and_report(
    tasks: list[SceneTask], settings: EvalSettings, out: Path, console: Console, *, video: bool = False
) -> None:
    """Run an evaluation with progress, then print its tables and write ``report.html`` beside its records."""
    out.mkdir(parents=True, exist_ok=True)
    oracle = bool(oracle_note(described(settings)))
    gallery, film = Gallery(out, oracle), out / "walk.mp4"
    with ExitStack() as stack:
        bars = stack.enter_context(ProgressBars(console))
        walk = stack.enter_context(WalkVideo(film, oracle=oracle)) if video else None
        summary = evaluate(tasks, settings, out, on_step=walk, on_scene_end=gallery, on_progress=bars)
    records = RecordFile(out / "episodes.jsonl").records
    print_answers(console, records, oracle)
    print_summary(console, summary)
    write_report(
        out / "report.html",
        summary,
        records,
        maps=gallery.maps,
        heatmaps=gallery.heatmaps,
        video=film if film.exists() else None,
    )
    console.print(
        f"written: {', '.join(sorted(p.name for p in out.iterdir() if p.is_file()))} in {out}", soft_wrap=True
    )


def ask(path: Path, instance_map: InstanceMap, instruction: str, encoder: str | None, llm: str) -> Grounding:
    """Ground an instruction in the map that was read from ``path``; its own encoder reads the words unless one is named.

    Raises
    ------
    DataError
        That encoder's words do not fit the map's features.
    """
    from openmap_agents.grounding import Grounder
    from openmap_agents.perception import make_text_tower
    from openmap_agents.perception.specs import check_feature_length, check_text_space

    spec = encoder or instance_map.encoder or "embedded"
    check_text_space(path, instance_map.encoder, spec)
    words = make_text_tower(spec)
    check_feature_length(path, instance_map.feature_lengths, words.dim)
    return Grounder(llm, encoder=words).ground(instruction, instance_map)


def run_query(command: Query, console: Console) -> None:
    """``openmap query``: the instances of a saved map that fit an instruction best."""
    from openmap_agents.mapping import InstanceMap
    from openmap_agents.perception import is_oracle, read_encoder_spec

    if command.top < 1 or not command.instruction.strip():
        raise DataError(
            "the command line",
            f"--top {command.top} and the instruction {command.instruction!r}",
            "at least 1, and words",
        )
    if command.encoder is not None:
        read_encoder_spec(command.encoder)
    instance_map = InstanceMap.load(command.map)
    grounding = ask(command.map, instance_map, command.instruction, command.encoder, command.llm)
    told = is_oracle(instance_map.segmenter) or is_oracle(instance_map.encoder)
    table = Table(title=f"{ORACLE if told else ''}“{command.instruction}”", title_justify="left", pad_edge=False)
    for name in ("rank", "instance", "label", "score", "x", "y", "z"):
        table.add_column(name, justify="left" if name == "label" else "right")
    best = list(zip(grounding.ranking, grounding.scores, strict=True))[: command.top]
    for rank, (instance_id, value) in enumerate(best, start=1):
        instance = instance_map.get(instance_id)
        table.add_row(
            str(rank), str(instance_id), instance.label or "?", f"{value:.2f}", *(f"{x:.2f}" for x in instance.centre)
        )
    console.print(table)
    if grounding.trace["fallbacks"]:
        console.print(
            "the language model failed, the built-in interpreter answered: " + str(grounding.trace["fallbacks"])
        )
    if grounding.choice is None:
        console.print("nothing in this map fits well")
    console.print(f"confidence {grounding.confidence:.2f}; metres in the frame that the map was built in")
