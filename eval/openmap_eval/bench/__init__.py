"""``openmap bench NAME``: what things cost on this machine, as a table and as JSON beside the machine's description.

One more: a module here with a frozen dataclass of its settings and ``run(console)``, and a line in ``Benchmark``. The modules are
imported whenever the command line is, so they import what they measure inside their functions.
"""

from __future__ import annotations

from typing import Annotated

import tyro

from openmap_eval.bench.env import Env
from openmap_eval.bench.homes import Homes
from openmap_eval.bench.loading import Loading
from openmap_eval.bench.machine import Machine
from openmap_eval.bench.map import Map
from openmap_eval.bench.perception import Perception
from openmap_eval.bench.render import Render

Benchmark = (
    Annotated[Env, tyro.conf.subcommand("env")]
    | Annotated[Homes, tyro.conf.subcommand("homes")]
    | Annotated[Loading, tyro.conf.subcommand("loading")]
    | Annotated[Machine, tyro.conf.subcommand("machine")]
    | Annotated[Map, tyro.conf.subcommand("map")]
    | Annotated[Perception, tyro.conf.subcommand("perception")]
    | Annotated[Render, tyro.conf.subcommand("render")]
)

__all__ = ["Benchmark", "Env", "Homes", "Loading", "Machine", "Map", "Perception", "Render"]
