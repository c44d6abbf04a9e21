"""The command line.

``openmap eval | eval perception | eval mapping | eval exploration | eval grounding | demo | map | query | export | ap
| scenes | episodes | bench | train perception``.
"""

from __future__ import annotations

import logging
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro
from rich.console import Console

from openmap_agents.perception.training.settings import Settings as PerceptionTraining
from openmap_eval.ap.command import Ap
from openmap_eval.bench import Benchmark
from openmap_eval.episode_commands import EpisodeCommand
from openmap_eval.exploration.command import EvalExploration
from openmap_eval.export_command import Export
from openmap_eval.grounding.command import EvalGrounding
from openmap_eval.map_command import Map
from openmap_eval.mapping.command import EvalMapping
from openmap_eval.perception.command import EvalPerception
from openmap_eval.scene_commands import SceneCommand
from openmap_scenes import DataError


@dataclass(frozen=True)
class Eval:
    """Run an agent over episodes and score it; a run that was stopped goes on where it was. For masks and names by themselves:
    ``openmap eval perception``; for maps: ``openmap eval mapping``."""

    out: Path
    """Folder for episodes.jsonl, summary.json, report.html, the map pictures and the maps. A second call with it resumes."""
    scene: str | None = None
    """A scene of the catalogue: mp3d:<scan folder>, file:<mesh> or homes:<split>/<n>."""
    split: Literal["homes/train", "homes/val", "homes/test"] | None = None
    """Instead of --scene: a split of the built-in homes."""
    homes: int = 3
    """How many homes of the split."""
    episodes: str = "24"
    """How many for each scene: the benchmark's, evenly over their kinds, or generated where a scene has none of those.
    Or a file or folder of episodes (R2R-CE, ObjectNav, VLMaps, own JSONL)."""
    agent: str = "openmap"
    """openmap, random, stand_still, oracle, oracle_map (true map, own grounding), or ppo:<policy.safetensors> for
    what openmap_agents.training learned."""
    perception: str = "embedded"
    """Segmenter and encoder: embedded (from pixels), precomputed:<folder>, or oracle (the renderer's ids and names, right or
    with noise: oracle:split=.1,merge=.05,drop=.1,boundary=2,features=.3,names=.1,seed=0; for analysis only)."""
    segmenter: str | None = None
    """Instead of --perception's: any of those, sam:<folder or encoder.onnx>, or yolo:<model.onnx>."""
    encoder: str | None = None
    """Instead of --perception's: any of those, clip-onnx:<folder>, or openclip:<architecture>/<tag>. Features from disk may
    need the words of the model that made them: precomputed:<folder>?text=clip-onnx:<folder>."""
    llm: str = "builtin"
    """builtin, openai:<model>@<base url> for any OpenAI-compatible endpoint, or gguf:<file> for a local model (extra gguf)."""
    protocol: Literal["retrieval", "navigation"] = "retrieval"
    """Explore once and answer everything, or every episode by itself."""
    stop_confidence: float = 0.0
    """In navigation: explore no further once the same answer was this sure (0..1) twice running; 0 = explore to the end."""
    seed: int = 0
    """Draws episodes and everything that an agent draws."""
    renderer: str = "auto"
    """opengl, pyrender or raycast; auto is opengl where there is a context for it, else raycast."""
    width: int = 640
    """Picture width, px."""
    height: int = 480
    """Picture height, px."""
    max_steps: int = 2000
    """Budget of actions for one walk."""
    video: bool = False
    """Also write the walk as walk.mp4 (one scene only)."""

    def run(self, console: Console) -> None:
        from openmap_eval.commands import run_eval

        run_eval(self, console)


@dataclass(frozen=True)
class Demo:
    """Walk the whole road once: a home, an agent that maps it, questions, scores, pictures."""

    out: Path = Path("runs/demo")
    """Folder for what it writes."""
    scene: str = "homes:val/0"
    """A scene of the catalogue."""
    seed: int = 0

    def run(self, console: Console) -> None:
        from openmap_eval.demo import run_demo

        run_demo(self.out, self.scene, self.seed, console)


@dataclass(frozen=True)
class Query:
    """Ask a saved map for something."""

    map: tyro.conf.Positional[Path]
    """A map that ``openmap map``, an evaluation or the demo wrote."""
    instruction: tyro.conf.Positional[str]
    top: int = 5
    """How many answers to list."""
    encoder: str | None = None
    """What reads the words, as for an evaluation; the one that made the map's features, unless given."""
    llm: str = "builtin"

    def run(self, console: Console) -> None:
        from openmap_eval.commands import run_query

        run_query(self, console)


@dataclass(frozen=True)
class Scenes:
    """What scenes there are, what they look like, what is wrong with them."""

    command: tyro.conf.OmitSubcommandPrefixes[SceneCommand]

    def run(self, console: Console) -> None:
        self.command.run(console)


@dataclass(frozen=True)
class Episodes:
    """What is asked: the benchmark's frozen episodes and your own; make them, hold them against their homes, read them."""

    command: tyro.conf.OmitSubcommandPrefixes[EpisodeCommand]

    def run(self, console: Console) -> None:
        self.command.run(console)


@dataclass(frozen=True)
class Bench:
    """Measure what things cost on this machine."""

    benchmark: tyro.conf.OmitSubcommandPrefixes[Benchmark]

    def run(self, console: Console) -> None:
        self.benchmark.run(console)


@dataclass(frozen=True)
class TrainPerception(PerceptionTraining):
    """Train the default perception anew, on renders of the built-in homes; a run that was stopped goes on where it was."""

    def run(self, console: Console) -> None:
        from openmap_agents.perception.training.run import train

        train(self, console)


Command = (
    Annotated[Eval, tyro.conf.subcommand("eval")]
    | Annotated[EvalPerception, tyro.conf.subcommand("eval perception")]
    | Annotated[EvalMapping, tyro.conf.subcommand("eval mapping")]
    | Annotated[EvalExploration, tyro.conf.subcommand("eval exploration")]
    | Annotated[EvalGrounding, tyro.conf.subcommand("eval grounding")]
    | Annotated[Demo, tyro.conf.subcommand("demo")]
    | Annotated[Map, tyro.conf.subcommand("map")]
    | Annotated[Query, tyro.conf.subcommand("query")]
    | Annotated[Export, tyro.conf.subcommand("export")]
    | Annotated[Ap, tyro.conf.subcommand("ap")]
    | Annotated[Scenes, tyro.conf.subcommand("scenes")]
    | Annotated[Episodes, tyro.conf.subcommand("episodes")]
    | Annotated[Bench, tyro.conf.subcommand("bench")]
    | Annotated[TrainPerception, tyro.conf.subcommand("train perception")]
)


OF_TWO_WORDS = (
    ["eval", "perception"],
    ["eval", "mapping"],
    ["eval", "exploration"],
    ["eval", "grounding"],
    ["train", "perception"],
)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; bad input ends in one message and exit status 2, without a traceback."""
    logging.basicConfig(level=logging.INFO, format="%(name)s: %(message)s", stream=sys.stderr)
    console = Console()
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    if arguments[:2] in OF_TWO_WORDS:
        # A command of its own: ``eval`` has flags, and so no commands below it.
        arguments[:2] = [" ".join(arguments[:2])]
    command: (
        Eval
        | EvalPerception
        | EvalMapping
        | EvalExploration
        | EvalGrounding
        | Demo
        | Map
        | Query
        | Export
        | Ap
        | Scenes
        | Episodes
        | Bench
        | TrainPerception
    ) = tyro.cli(Command, args=arguments, prog="openmap", description=__doc__)
    try:
        command.run(console)
    except (DataError, ValueError, OSError) as error:
        console.print(f"[bold red]openmap:[/] {error}", soft_wrap=True, highlight=False)
        raise SystemExit(2) from error
    except KeyboardInterrupt:
        console.print("stopped; the same command goes on from here")
        raise SystemExit(130) from None


if __name__ == "__main__":
    main()
