"""Tables, drawn frames and confusions -> one self-contained HTML page."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import cv2
import jinja2
import numpy as np
import numpy.typing as npt

from openmap_eval.perception.confusions import Confusion
from openmap_eval.perception.frames import DrawnFrame
from openmap_eval.perception.tables import TextTable
from openmap_eval.records import write_atomically


def write_page(
    path: Path,
    settings: Mapping[str, Any],
    oracle: bool,
    shown: Sequence[TextTable],
    frames: Sequence[DrawnFrame],
    confused: Sequence[Confusion],
) -> None:
    """Write ``perception.html``, whole or not at all."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("openmap_eval"), autoescape=True, undefined=jinja2.StrictUndefined
    )
    page = environment.get_template("perception.html").render(
        title=("ORACLE · " if oracle else "") + "OpenMapNav perception",
        oracle=oracle,
        settings=settings,
        tables=shown,
        frames=[{"title": f.title, "data": jpeg_url(f.picture), "rows": f.rows} for f in frames],
        confusions=[{"is": c, "examples": [jpeg_url(e) for e in c.examples]} for c in confused],
    )
    write_atomically(path, page.encode())


def jpeg_url(picture: npt.NDArray[np.uint8]) -> str:
    """A picture (H, W, 3) uint8 as a data URL."""
    data = cv2.imencode(".jpg", cv2.cvtColor(picture, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, 85])[1]
    return f"data:image/jpeg;base64,{base64.b64encode(bytes(data)).decode()}"
