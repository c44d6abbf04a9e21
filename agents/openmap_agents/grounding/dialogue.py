"""The two questions that a language model is asked: what is wanted (parse), and which candidate is it (select).

The prompts are the files in ``prompts/``, or in a folder of one's own, each in three parts: task definition, description criteria,
output format. What comes from the person or from perception is data in the user message, between marks, and never part of the
prompt: it is JSON on one line, in which neither the marks nor the control tokens of a model's chat template can stand as they are.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, cast, get_args

from openmap_agents.grounding.description import Description, Kind, Relation, RelationName, Superlative, Thing
from openmap_agents.grounding.lexicon import Lexicon, normalised
from openmap_agents.grounding.llm import Message
from openmap_agents.grounding.noun_phrases import SYNONYM_COST, NounPhrases
from openmap_scenes import DataError

LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
BEGIN, END = "CANDIDATES", "END OF CANDIDATES"
SHORTENING = (("id", "score", "neighbours"), ("centre", "size"), ("geometry", "description"), ("colour", "similarity"))
"""What goes first when a question is too long for a model."""
_OPTIONAL_TEXT = {"type": ["string", "null"], "maxLength": 100}

PARSE_SCHEMA: dict[str, Any] = {
    "type": "object",
    "additionalProperties": False,
    "required": ["kind", "target", "alternatives", "colour", "size", "ordinal", "room", "relations"],
    "properties": {
        "kind": {"enum": list(get_args(Kind))},
        "target": {"type": "string", "minLength": 1, "maxLength": 100},
        "alternatives": {
            "type": "array",
            "maxItems": 16,
            "items": {"type": "string", "minLength": 1, "maxLength": 100},
        },
        "colour": _OPTIONAL_TEXT,
        "size": {"enum": [*get_args(Superlative), None]},
        "ordinal": {"type": ["integer", "null"], "minimum": 1, "maximum": 50},
        "room": _OPTIONAL_TEXT,
        "relations": {
            "type": "array",
            "maxItems": 8,
            "items": {
                "type": "object",
                "additionalProperties": False,
                "required": ["relation", "landmarks", "negated"],
                "properties": {
                    "relation": {"enum": list(get_args(RelationName))},
                    "landmarks": {
                        "type": "array",
                        "minItems": 1,
                        "maxItems": 4,
                        "items": {"type": "string", "minLength": 1, "maxLength": 100},
                    },
                    "negated": {"type": "boolean"},
                },
            },
        },
    },
}


def _prompt(name: str, folder: Path | None) -> str:
    if folder is None:
        return resources.files(__package__).joinpath("prompts", f"{name}.md").read_text(encoding="utf-8")
    path = Path(folder) / f"{name}.md"
    expected = "a prompt, text in UTF-8"
    remedy = "A folder of prompts holds parse.md and select.md; begin with copies of those in openmap_agents/grounding/prompts."
    try:
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise DataError(path, error.strerror or type(error).__name__, expected, remedy) from None
    except UnicodeDecodeError:
        raise DataError(path, "other bytes", expected, remedy) from None
    if not text.strip():
        raise DataError(path, "an empty file", expected, remedy)
    return text


def check_prompts(folder: Path | None) -> None:
    """DataError unless the folder (None: the one that belongs to this package) holds both prompts."""
    for name in ("parse", "select"):
        _prompt(name, folder)


def _data(value: dict[str, Any]) -> str:
    """One line of JSON that stays data, whatever its texts are.

    Besides what JSON escapes anyway, what is not printable (line separators that are no newlines, lone surrogates) is written as
    escapes, and so are the first letters of the marks around candidates and of control tokens such as <|im_end|> or [INST].
    """
    text = "".join(c if c.isprintable() else json.dumps(c)[1:-1] for c in json.dumps(value, ensure_ascii=False))
    return re.sub(r"<|\[(?=/?[A-Z_])|[cC](?=[aA][nN][dD][iI][dD][aA][tT][eE][sS])", _escaped, text)


def _escaped(found: re.Match[str]) -> str:
    return f"\\u{ord(found.group()):04x}"


def parse_messages(instruction: str, prompts: Path | None = None) -> list[Message]:
    """The question "what is wanted?"; ``prompts`` is a folder of one's own prompts."""
    asked = _data({"instruction": instruction})
    return [{"role": "system", "content": _prompt("parse", prompts)}, {"role": "user", "content": asked}]


def description_from_reply(reply: dict[str, Any], nouns: NounPhrases, lexicon: Lexicon) -> Description:
    """A reply that fits ``PARSE_SCHEMA`` -> description; the target's own words decide how it is looked for."""
    target = nouns.parse(normalised(reply["target"]))
    if not target.queries:
        target = Thing(phrase=reply["target"], queries=((reply["target"], 0.0),))
    costs = dict(target.queries)
    for rank, name in enumerate(reply["alternatives"], start=1):
        costs.setdefault(normalised(name), SYNONYM_COST * rank)
    colour = nouns.colour_of.get(normalised(reply["colour"])) if reply["colour"] else target.colour
    relations = tuple(
        Relation(
            cast(RelationName, entry["relation"]),
            tuple(nouns.parse(normalised(mark)) for mark in entry["landmarks"]),
            bool(entry["negated"]),
        )
        for entry in reply["relations"]
    )
    target = replace(
        target,
        queries=tuple(sorted(costs.items(), key=lambda item: (item[1], item[0]))),
        colour=colour,
        superlative=reply["size"] or target.superlative,
        strict=bool(reply["size"]) or target.strict,
        ordinal=reply["ordinal"] or target.ordinal,
        room=lexicon.room_of(normalised(reply["room"])) if reply["room"] else target.room,
        relations=relations or target.relations,
    )
    return Description(kind=cast(Kind, reply["kind"]), target=target)


def select_schema(count: int) -> dict[str, Any]:
    """What a reply to the multiple-choice question over ``count`` candidates has to look like."""
    return {
        "type": "object",
        "additionalProperties": False,
        "required": ["choice", "confidence", "reason"],
        "properties": {
            "choice": {"enum": [*LETTERS[:count], "none"]},
            "confidence": {"type": "number", "minimum": 0, "maximum": 1},
            "reason": {"type": "string", "maxLength": 1000},
        },
    }


def select_messages(
    instruction: str, description: Description, candidates: list[dict[str, Any]], prompts: Path | None = None
) -> list[Message]:
    """The question "which of these?"; candidates are plain JSON and stay data."""
    lines = [_data({"instruction": instruction, "description": description.to_json()}), BEGIN]
    lines += [_data({"letter": letter, **candidate}) for letter, candidate in zip(LETTERS, candidates, strict=False)]
    lines.append(END)
    return [{"role": "system", "content": _prompt("select", prompts)}, {"role": "user", "content": "\n".join(lines)}]


def shorter_messages(messages: list[Message]) -> Iterator[tuple[list[Message], list[str]]]:
    """A question as it is, and then, if it has candidates, with fewer and fewer details of each; what is asked stays.

    Yields
    ------
    messages : list of Message
    dropped : list of str
        The details that its candidates lack, and "description": what the instruction was parsed to.
    """
    yield messages, []
    lines = messages[-1]["content"].split("\n")
    if len(lines) < 3 or lines[1] != BEGIN or lines[-1] != END:
        return
    asked, candidates = json.loads(lines[0]), [json.loads(line) for line in lines[2:-1]]
    dropped: list[str] = []
    for step in SHORTENING:
        dropped = [*dropped, *step]
        first = {key: value for key, value in asked.items() if key not in dropped}
        rest = [{key: value for key, value in entry.items() if key not in dropped} for entry in candidates]
        content = "\n".join([_data(first), BEGIN, *map(_data, rest), END])
        yield [*messages[:-1], {**messages[-1], "content": content}], dropped
