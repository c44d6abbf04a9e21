"""What a whole run may spend on language models, beside the budget of each grounding.

The limits come from the environment: ``OPENMAP_LLM_MAX_CALLS`` requests, ``OPENMAP_LLM_MAX_SECONDS`` seconds of waiting for
replies, ``OPENMAP_LLM_MAX_TOKENS`` tokens (read and written, where the endpoint counts them); what is not set has no limit.
They hold for a process: all models that ``make_llm`` gives spend from the same purse. Kept replies cost nothing.
"""

from __future__ import annotations

import math
import os
import threading
import time
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from openmap_agents.grounding.llm import Budget, LanguageModel, LanguageModelError, Message
from openmap_scenes import DataError

CALLS_VARIABLE, SECONDS_VARIABLE, TOKENS_VARIABLE = (
    "OPENMAP_LLM_MAX_CALLS",
    "OPENMAP_LLM_MAX_SECONDS",
    "OPENMAP_LLM_MAX_TOKENS",
)


@dataclass
class RunBudget:
    """What a run may spend, and what it has spent.

    Parameters
    ----------
    calls : float
        Requests, retries included.
    seconds : float
        Waiting for replies, all requests together.
    tokens : float
        Read and written, as the endpoint tells; the request that passes the limit is the last.
    """

    calls: float = math.inf
    seconds: float = math.inf
    tokens: float = math.inf
    used_calls: int = 0
    used_seconds: float = 0.0
    used_tokens: int = 0
    lock: threading.Lock = field(default_factory=threading.Lock, repr=False, compare=False)

    @classmethod
    def from_environment(cls) -> RunBudget:
        """DataError where a limit is no number of 0 or more."""
        return cls(_limit(CALLS_VARIABLE), _limit(SECONDS_VARIABLE), _limit(TOKENS_VARIABLE))

    def spent(self) -> str | None:
        """What is used up, in words; None while something is left of everything."""
        for what, used, limit in (
            ("requests", self.used_calls, self.calls),
            ("seconds", self.used_seconds, self.seconds),
            ("tokens", self.used_tokens, self.tokens),
        ):
            if used >= limit:
                return f"the run's budget of {limit:g} {what} for language models is used up"
        return None

    def add(self, calls: int, seconds: float, tokens: int) -> None:
        """Count what was spent."""
        with self.lock:
            self.used_calls += calls
            self.used_seconds += seconds
            self.used_tokens += tokens


@cache
def process_budget() -> RunBudget:
    """The purse of this process, as large as the environment said when it was first asked for."""
    return RunBudget.from_environment()


class LimitedModel:
    """A language model that stops when the run's budget is spent.

    Parameters
    ----------
    model : LanguageModel
    run : RunBudget
    """

    def __init__(self, model: LanguageModel, run: RunBudget) -> None:
        self.model, self.run, self.name = model, run, model.name
        self.sampling = getattr(model, "sampling", None)

    def complete(
        self, messages: list[Message], schema: dict[str, Any], budget: Budget
    ) -> tuple[dict[str, Any], list[dict[str, Any]]]:
        """As in ``LanguageModel``, within what the grounding and the run have left."""
        if reason := self.run.spent():
            raise LanguageModelError(f"{self.name}: {reason}", [{"error": reason, "milliseconds": 0.0}])
        inner = Budget(
            min(budget.left(), self.run.seconds - self.run.used_seconds),
            int(min(budget.calls - budget.used, self.run.calls - self.run.used_calls)),
        )
        start = time.monotonic()
        record: list[dict[str, Any]] = []
        try:
            reply, record = self.model.complete(messages, schema, inner)
            return reply, record
        except LanguageModelError as error:
            record = error.args[1] if len(error.args) > 1 else []
            raise
        finally:
            budget.used += inner.used
            self.run.add(inner.used, time.monotonic() - start, sum(int(entry.get("tokens", 0)) for entry in record))


def _limit(variable: str) -> float:
    text = os.environ.get(variable, "").strip()
    if not text:
        return math.inf
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not value >= 0:
        raise DataError(variable, repr(text), "a number of 0 or more", "Set it, or unset it for no limit.")
    return value
