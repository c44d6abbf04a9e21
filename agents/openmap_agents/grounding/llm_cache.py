"""Replies of language models, kept on disk, so that a run with a paid model can be repeated for nothing.

A file is named after what was asked: model, messages, schema and sampling settings. It holds the reply and no key. One that
cannot be read, is damaged or does not fit the schema counts as absent and is written anew; a folder that cannot be written
costs requests and nothing else.
"""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

import jsonschema

from openmap_agents.grounding.llm import Budget, LanguageModel, Message
from openmap_scenes.cache import cache_root

CACHE_VARIABLE = "OPENMAP_LLM_CACHE"
OFF = ("off", "none", "no", "0")
MAX_ENTRY_BYTES = 4 << 20
"""A file that is longer is no entry."""


def cache_folder() -> Path | None:
    """Where replies are kept: the folder in ``OPENMAP_LLM_CACHE``, by default ``llm-v1`` in the user's cache folder; None
    where that variable says "off"."""
    place = os.environ.get(CACHE_VARIABLE, "").strip()
    if place.lower() in OFF:
        return None
    return Path(place).expanduser() if place else cache_root() / "llm-v1"


class CachedModel:
    """A language model whose replies are kept.

    Parameters
    ----------
    model : LanguageModel
        Who is asked what is not kept. What its attribute ``sampling`` holds (a dict, where there is one) is part of the key.
    folder : Path
    """

    def __init__(self, model: LanguageModel, folder: Path) -> None:
        self.model, self.folder, self.name = model, folder, model.name

    def complete(
        self, messages: list[Message], schema: dict[str, Any], budget: Budget
    ) -> tuple[dict[str, Any], list[dict[str, Any]]]:
        """As in ``LanguageModel``; a kept reply costs nothing of the budget, and its record says ``"cached": true``."""
        start = time.monotonic()
        key = self.key(messages, schema)
        reply = self._load(key, schema)
        if reply is not None:
            milliseconds = round(1000 * (time.monotonic() - start), 1)
            text = json.dumps(reply, ensure_ascii=False)
            return reply, [{"cached": True, "messages": messages, "reply": text, "milliseconds": milliseconds}]
        reply, record = self.model.complete(messages, schema, budget)
        self._store(key, reply)
        return reply, record

    def key(self, messages: list[Message], schema: dict[str, Any]) -> str:
        """Hex digest of all that decides about the reply."""
        asked = [self.name, getattr(self.model, "sampling", None), messages, schema]
        return hashlib.sha256(json.dumps(asked, sort_keys=True).encode()).hexdigest()

    def _path(self, key: str) -> Path:
        return self.folder / key[:2] / f"{key}.json"

    def _load(self, key: str, schema: dict[str, Any]) -> dict[str, Any] | None:
        """The kept reply, None if there is none that is whole."""
        try:
            with self._path(key).open("rb") as file:
                body = file.read(MAX_ENTRY_BYTES + 1)
            if len(body) > MAX_ENTRY_BYTES:
                return None
            entry = json.loads(body)
            reply = entry["reply"]
            if entry["key"] != key or entry["sha256"] != _digest(reply):
                return None
            jsonschema.validate(reply, schema)
        except (OSError, ValueError, KeyError, TypeError, RecursionError, jsonschema.ValidationError):
            return None
        return reply if isinstance(reply, dict) else None

    def _store(self, key: str, reply: dict[str, Any]) -> None:
        """Write a reply, whole or not at all."""
        entry = {"model": self.name, "key": key, "sha256": _digest(reply), "reply": reply}
        path = self._path(key)
        with suppress(OSError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryDirectory(dir=path.parent) as aside:
                new = Path(aside) / "new.json"
                new.write_text(json.dumps(entry, indent=1), encoding="utf-8")
                os.replace(new, path)


def _digest(reply: Any) -> str:
    return hashlib.sha256(json.dumps(reply, sort_keys=True).encode()).hexdigest()
