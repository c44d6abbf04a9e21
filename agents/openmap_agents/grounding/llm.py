"""Language models behind one protocol: messages in, JSON that fits a schema out.

``make_llm("builtin")`` is no model (None): the interpreter does the work. ``make_llm("openai:<model>@<base_url>")``
is any endpoint that speaks OpenAI's chat completions, ``make_llm("gguf:<path>")`` a local model in this process. The key comes
from the environment and goes nowhere else: what is raised, recorded or answered is redacted.
"""

from __future__ import annotations

import json
import os
import re
import threading
import time
from dataclasses import dataclass, field
from email.utils import parsedate_to_datetime
from typing import TYPE_CHECKING, Any, Protocol

import jsonschema

if TYPE_CHECKING:
    from openmap_agents.grounding.llm_limits import RunBudget

Message = dict[str, str]
KEY_VARIABLE = "OPENAI_API_KEY"
MAX_BYTES = 1 << 20
"""No reply that is worth reading is longer."""
MAX_RECORDED = 20_000
FIRST_WAIT = 0.25
"""Seconds before the first retry; twice as long before each further one."""


class LanguageModelError(Exception):
    """The model gave nothing that can be used; the message says why and holds no secret."""


@dataclass
class Budget:
    """What one grounding may spend on a language model.

    Parameters
    ----------
    seconds : float
        Wall clock for all requests together, waiting between them included.
    calls : int
        Requests, retries included.
    """

    seconds: float = 30.0
    calls: int = 6
    _start: float = field(default_factory=time.monotonic)
    used: int = 0

    def left(self) -> float:
        """Seconds left; at most 0 when the calls are used up."""
        return 0.0 if self.used >= self.calls else self.seconds - (time.monotonic() - self._start)

    def ends(self) -> float:
        """When the seconds are over, on the monotonic clock."""
        return self._start + self.seconds


class LanguageModel(Protocol):
    """Messages in, JSON out."""

    name: str

    def complete(
        self, messages: list[Message], schema: dict[str, Any], budget: Budget
    ) -> tuple[dict[str, Any], list[dict[str, Any]]]:
        """The reply, valid under ``schema``, and a record of every request (plain JSON).

        Raises
        ------
        LanguageModelError
            After the last retry that the budget allows; ``args[1]`` is the record so far.
        """
        ...


class OpenAIModel:
    """Any OpenAI-compatible endpoint.

    Parameters
    ----------
    model : str
    base_url : str or None
        None: OpenAI's own.
    timeout : float
        Seconds for one request, from connecting to the last byte.
    retries : int
        For time-outs, refused or cut connections, 408, 409, 429, 5xx and replies that do not fit. Where the endpoint says how
        long to wait (``Retry-After``), that is how long it is left alone, or for good if the budget ends before.
    """

    sampling: dict[str, Any] = {"temperature": 0}  # noqa: RUF012

    def __init__(self, model: str, base_url: str | None = None, timeout: float = 20.0, retries: int = 2) -> None:
        self.model, self.base_url, self.timeout, self.retries = model, base_url, timeout, retries
        self.name = f"openai:{model}" + (f"@{_public(base_url)}" if base_url else "")

    def complete(
        self, messages: list[Message], schema: dict[str, Any], budget: Budget
    ) -> tuple[dict[str, Any], list[dict[str, Any]]]:
        """As in ``LanguageModel``."""
        record: list[dict[str, Any]] = []
        structured = True
        for attempt in range(self.retries + 1):
            left = budget.left()
            if left <= 0:
                break
            budget.used += 1
            start = time.monotonic()
            entry: dict[str, Any] = {"attempt": attempt + 1}
            if attempt == 0:
                entry["messages"] = [{role: _redacted(text) for role, text in message.items()} for message in messages]
            record.append(entry)
            wait = min(FIRST_WAIT * 2**attempt, 4.0)
            try:
                body = self._request(messages, schema if structured else None, min(self.timeout, left))
                entry["tokens"] = _tokens(body)
                reply = _content(body)
                entry["reply"] = _redacted(reply)[:MAX_RECORDED]
                return fitting(reply, schema), record
            except _RefusedError as refused:
                entry["error"] = _redacted(str(refused))
                if refused.status == 400 and structured:
                    structured, wait = False, 0.0
                elif not refused.again:
                    break
                elif refused.wait is not None:
                    wait = refused.wait
                    if wait >= budget.left():
                        entry["error"] += f", asks to wait {wait:.0f} s, which is longer than the budget"
                        break
            except LanguageModelError as error:
                entry["error"] = _redacted(str(error))
            finally:
                entry["milliseconds"] = round(1000 * (time.monotonic() - start), 1)
            if attempt < self.retries:
                time.sleep(max(0.0, min(wait, budget.left())))
        errors = (
            "; ".join(str(entry.get("error")) for entry in record) or "the budget was used up before the first request"
        )
        raise LanguageModelError(f"{self.name}: {errors}", record)

    def _request(self, messages: list[Message], schema: dict[str, Any] | None, seconds: float) -> bytes:
        """The body of the answer to one request. All of it has to be there within ``seconds``, whatever holds it up: looking
        up the name, connecting, or an endpoint that sends a byte now and then. So it is waited for from outside."""
        import openai

        options: dict[str, Any] = dict(self.sampling)
        if schema is not None:
            options["response_format"] = {"type": "json_schema", "json_schema": {"name": "reply", "schema": schema}}
        outcome: list[bytes | LanguageModelError] = []
        over = threading.Event()

        def fetch() -> None:
            try:
                outcome.append(_fetched(client, {"model": self.model, "messages": messages, **options}, over))
            except LanguageModelError as error:
                outcome.append(error)
            except Exception as error:
                # While a body is read the transport raises errors of its own, of another library in each client version.
                outcome.append(_RefusedError(f"{type(error).__name__}: {error}"[:300], None, True))

        with openai.OpenAI(
            api_key=os.environ.get(KEY_VARIABLE) or "none", base_url=self.base_url, timeout=seconds, max_retries=0
        ) as client:
            thread = threading.Thread(target=fetch, daemon=True)
            thread.start()
            thread.join(seconds)
            over.set()
        if not outcome:
            raise _RefusedError(f"no whole answer in time ({seconds:.2f} s)", None, True)
        if isinstance(outcome[0], LanguageModelError):
            raise outcome[0]
        return outcome[0]


def _fetched(client: Any, request: dict[str, Any], over: threading.Event) -> bytes:
    """What the endpoint answers, no longer than ``MAX_BYTES``; nobody waits for it any more when ``over`` is set."""
    import openai

    try:
        with client.chat.completions.with_streaming_response.create(**request) as response:
            body = b""
            for chunk in response.iter_bytes():
                body += chunk
                if over.is_set():
                    break
                if len(body) > MAX_BYTES:
                    raise _RefusedError(f"the answer is longer than {MAX_BYTES} bytes", None, False)
            return body
    except openai.APIStatusError as error:
        status = error.status_code
        again = status in (408, 409, 429) or status >= 500
        raise _RefusedError(f"HTTP {status}", status, again, _retry_after(error.response.headers)) from None
    except openai.APIConnectionError as error:
        reason = "no answer in time" if isinstance(error, openai.APITimeoutError) else "connection failed"
        raise _RefusedError(reason, None, True) from None


def _retry_after(headers: Any) -> float | None:
    """Seconds that an endpoint asks to be left alone for, None if it does not say (RFC 9110, 10.2.3)."""
    text = str(headers.get("retry-after") or "").strip()
    try:
        seconds = (
            float(text) if re.fullmatch(r"[0-9.]+", text) else parsedate_to_datetime(text).timestamp() - time.time()
        )
    except (ValueError, TypeError, OverflowError):
        return None
    return max(0.0, seconds)


def _public(url: str) -> str:
    """An address without the user and the query, which may hold secrets."""
    return re.sub(r"//[^/@]*@", "//", url.split("?")[0])


def _redacted(text: str) -> str:
    key = os.environ.get(KEY_VARIABLE)
    text = text.replace(key, "[key]") if key else text
    return re.sub(r"sk-[A-Za-z0-9_\-]{6,}", "[key]", text)


def _redacted_json(value: Any) -> Any:
    """The value with every text in it redacted, whatever escapes it was written with."""
    if isinstance(value, str):
        return _redacted(value)
    if isinstance(value, list):
        return [_redacted_json(entry) for entry in value]
    if isinstance(value, dict):
        return {_redacted(key): _redacted_json(entry) for key, entry in value.items()}
    return value


class _RefusedError(LanguageModelError):
    def __init__(self, message: str, status: int | None, again: bool, wait: float | None = None) -> None:
        super().__init__(message)
        self.status, self.again, self.wait = status, again, wait


def _tokens(body: bytes) -> int:
    """Tokens read and written, as a chat completion's body tells; 0 where it does not."""
    try:
        total = json.loads(body)["usage"]["total_tokens"]
    except (ValueError, KeyError, IndexError, TypeError, RecursionError):
        return 0
    return total if isinstance(total, int) and not isinstance(total, bool) and 0 <= total < 1 << 40 else 0


def _content(body: bytes) -> str:
    """The reply's text in a chat completion's body."""
    try:
        choice = json.loads(body)["choices"][0]
        text = choice["message"]["content"]
    except (ValueError, KeyError, IndexError, TypeError, RecursionError):
        raise LanguageModelError(f"found {body[:80]!r}, expected a chat completion") from None
    if choice.get("finish_reason") == "length":
        raise LanguageModelError("the reply was cut off at the model's length limit")
    if not isinstance(text, str):
        raise LanguageModelError("the reply holds no text")
    return text


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not JSON")


def fitting(text: str, schema: dict[str, Any]) -> dict[str, Any]:
    """The JSON object in a reply (which may be fenced as code), valid under the schema."""
    fenced = re.search(r"```(?:json)?\s*(.*?)```", text, re.DOTALL)
    try:
        reply = _redacted_json(json.loads(fenced.group(1) if fenced else text, parse_constant=_refuse_constant))
        jsonschema.validate(reply, schema)
    except (ValueError, RecursionError) as error:
        raise LanguageModelError(f"the reply is no JSON: {type(error).__name__}") from None
    except jsonschema.ValidationError as error:
        raise LanguageModelError(f"the reply does not fit the schema: {error.message[:200]}") from None
    if not isinstance(reply, dict):
        raise LanguageModelError("the reply is no JSON object")
    return reply


def make_llm(spec: str, *, cache: bool = True, run: RunBudget | None = None) -> LanguageModel | None:
    """The model that a spec names.

    Parameters
    ----------
    spec : str
        ``builtin`` (None: no model), ``openai:<model>[@<base_url>]``, ``gguf:<path to .gguf>`` or ``gguf:smollm2``.
    cache : bool
        Whether replies of an endpoint are kept and used again (``llm_cache.py``; the environment may say no as well).
    run : RunBudget, optional
        What the whole run may spend (``llm_limits.py``); by default this process' purse, which the environment fills.

    Raises
    ------
    ValueError
        If the spec has another form, or the model cannot be had (DataError: says what to do).
    """
    from openmap_agents.grounding.llm_cache import CachedModel, cache_folder
    from openmap_agents.grounding.llm_limits import LimitedModel, process_budget

    if spec == "builtin":
        return None
    if spec.startswith("gguf:") and len(spec) > len("gguf:"):
        from openmap_agents.grounding.llm_gguf import GgufModel

        return LimitedModel(GgufModel(spec.removeprefix("gguf:")), run or process_budget())
    found = re.fullmatch(r"openai:(?P<model>.+?)(?:@(?P<url>https?://\S+))?", spec)
    if found is None:
        expected = "'builtin', 'openai:<model>@<base_url>', 'gguf:<path>' or 'gguf:smollm2'"
        raise ValueError(f"found language model spec {spec!r}, expected {expected}")
    model = LimitedModel(OpenAIModel(found["model"], found["url"]), run or process_budget())
    folder = cache_folder() if cache else None
    return model if folder is None else CachedModel(model, folder)
