"""Language models behind one protocol: messages in, JSON that fits a schema out.

``make_llm("builtin")`` is no model (None): the interpreter does the work. ``make_llm("openai:<model>@<base_url>")``
is any endpoint that speaks OpenAI's chat completions. The key comes from the environment and goes nowhere else: what
is raised or recorded is redacted.
"""

from __future__ import annotations

import json
import os
import re
import time
from dataclasses import dataclass, field
from typing import Any, Protocol

import jsonschema

Message = dict[str, str]
KEY_VARIABLE = "OPENAI_API_KEY"
MAX_BYTES = 1 << 20
"""No reply that is worth reading is longer."""
MAX_RECORDED = 20_000


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
        For time-outs, refused connections, 408, 409, 429, 5xx and replies that do not fit.
    """

    def __init__(self, model: str, base_url: str | None = None, timeout: float = 20.0, retries: int = 2) -> None:
        self.model, self.base_url, self.timeout, self.retries = model, base_url, timeout, retries
        self.name = f"openai:{model}" + (f"@{re.sub(r'//[^/@]*@', '//', base_url)}" if base_url else "")

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
            entry: dict[str, Any] = {"attempt": attempt + 1, **({"messages": messages} if attempt == 0 else {})}
            record.append(entry)
            wait = min(0.25 * 2**attempt, 4.0)
            try:
                reply = self._request(messages, schema if structured else None, min(self.timeout, left))
                entry["reply"] = self._redacted(reply)[:MAX_RECORDED]
                return _fitting(reply, schema), record
            except _RefusedError as refused:
                entry["error"] = self._redacted(str(refused))
                if refused.status == 400 and structured:
                    structured, wait = False, 0.0
                elif not refused.again:
                    break
            except LanguageModelError as error:
                entry["error"] = self._redacted(str(error))
            finally:
                entry["milliseconds"] = round(1000 * (time.monotonic() - start), 1)
            if attempt < self.retries:
                time.sleep(max(0.0, min(wait, budget.left())))
        errors = (
            "; ".join(str(entry.get("error")) for entry in record) or "the budget was used up before the first request"
        )
        raise LanguageModelError(f"{self.name}: {errors}", record)

    def _request(self, messages: list[Message], schema: dict[str, Any] | None, seconds: float) -> str:
        """One request; the text of the reply. The whole answer has to be there within ``seconds``."""
        import openai

        deadline = time.monotonic() + seconds
        options: dict[str, Any] = {}
        if schema is not None:
            options["response_format"] = {"type": "json_schema", "json_schema": {"name": "reply", "schema": schema}}
        try:
            with openai.OpenAI(
                api_key=os.environ.get(KEY_VARIABLE) or "none", base_url=self.base_url, timeout=seconds, max_retries=0
            ) as client:
                requests = client.chat.completions.with_streaming_response
                with requests.create(model=self.model, messages=messages, temperature=0, **options) as response:  # type: ignore[arg-type]
                    body = b""
                    for chunk in response.iter_bytes():
                        body += chunk
                        if time.monotonic() > deadline:
                            raise _RefusedError(f"no whole answer within {seconds:.2f} s", None, True)
                        if len(body) > MAX_BYTES:
                            raise _RefusedError(f"the answer is longer than {MAX_BYTES} bytes", None, False)
        except openai.APIStatusError as error:
            status = error.status_code
            raise _RefusedError(f"HTTP {status}", status, status in (408, 409, 429) or status >= 500) from None
        except openai.APIConnectionError as error:
            reason = "no answer in time" if isinstance(error, openai.APITimeoutError) else "connection failed"
            raise _RefusedError(reason, None, True) from None
        except LanguageModelError:
            raise
        except Exception as error:
            # While a body is read the transport raises errors of its own, of another library in each client version.
            raise _RefusedError(f"{type(error).__name__}: {error}"[:300], None, isinstance(error, OSError)) from None
        return _content(body)

    @staticmethod
    def _redacted(text: str) -> str:
        key = os.environ.get(KEY_VARIABLE)
        text = text.replace(key, "[key]") if key else text
        return re.sub(r"sk-[A-Za-z0-9_\-]{6,}", "[key]", text)


class _RefusedError(LanguageModelError):
    def __init__(self, message: str, status: int | None, again: bool) -> None:
        super().__init__(message)
        self.status, self.again = status, again


def _content(body: bytes) -> str:
    """The reply's text in a chat completion's body."""
    try:
        choice = json.loads(body)["choices"][0]
        text = choice["message"]["content"]
    except (ValueError, KeyError, IndexError, TypeError):
        raise LanguageModelError(f"found {body[:80]!r}, expected a chat completion") from None
    if choice.get("finish_reason") == "length":
        raise LanguageModelError("the reply was cut off at the model's length limit")
    if not isinstance(text, str):
        raise LanguageModelError("the reply holds no text")
    return text


def _refuse_constant(name: str) -> None:
    raise ValueError(f"{name} is not JSON")


def _fitting(text: str, schema: dict[str, Any]) -> dict[str, Any]:
    """The JSON object in a reply (which may be fenced as code), valid under the schema."""
    fenced = re.search(r"```(?:json)?\s*(.*?)```", text, re.DOTALL)
    try:
        reply = json.loads(fenced.group(1) if fenced else text, parse_constant=_refuse_constant)
        jsonschema.validate(reply, schema)
    except (ValueError, RecursionError) as error:
        raise LanguageModelError(f"the reply is no JSON: {type(error).__name__}") from None
    except jsonschema.ValidationError as error:
        raise LanguageModelError(f"the reply does not fit the schema: {error.message[:200]}") from None
    if not isinstance(reply, dict):
        raise LanguageModelError("the reply is no JSON object")
    return reply


def make_llm(spec: str) -> LanguageModel | None:
    """The model that a spec names: ``builtin`` (None: no model) or ``openai:<model>[@<base_url>]``.

    Raises
    ------
    ValueError
        If the spec has another form.
    """
    if spec == "builtin":
        return None
    found = re.fullmatch(r"openai:(?P<model>.+?)(?:@(?P<url>https?://\S+))?", spec)
    if found is None:
        raise ValueError(f"found language model spec {spec!r}, expected 'builtin' or 'openai:<model>@<base_url>'")
    return OpenAIModel(found["model"], found["url"])
