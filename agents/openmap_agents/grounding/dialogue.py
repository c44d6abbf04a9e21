"""The two questions that a language model is asked: what is wanted (parse), and which candidate is it (select).

The prompts are the files in ``prompts/``, each in three parts: task definition, description criteria, output format.
What comes from the person or from perception is data in the user message, between marks, and never part of the
prompt.
"""

from __future__ import annotations

import json
from dataclasses import replace
from importlib import resources
from typing import Any, cast, get_args

from openmap_agents.grounding.description import Description, Kind, Relation, RelationName, Superlative, Thing
from openmap_agents.grounding.lexicon import Lexicon, normalised
from openmap_agents.grounding.llm import Message
from openmap_agents.grounding.noun_phrases import SYNONYM_COST, NounPhrases

LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
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


def _prompt(name: str) -> str:
    return resources.files(__package__).joinpath("prompts", f"{name}.md").read_text(encoding="utf-8")


def parse_messages(instruction: str) -> list[Message]:
    """The question "what is wanted?"."""
    asked = json.dumps({"instruction": instruction}, ensure_ascii=False)
    return [{"role": "system", "content": _prompt("parse")}, {"role": "user", "content": asked}]


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


def select_messages(instruction: str, description: Description, candidates: list[dict[str, Any]]) -> list[Message]:
    """The question "which of these?"; candidates are plain JSON and stay data."""
    lines = [
        json.dumps({"instruction": instruction, "description": description.to_json()}, ensure_ascii=False),
        "CANDIDATES",
    ]
    for letter, candidate in zip(LETTERS, candidates, strict=False):
        lines.append(json.dumps({"letter": letter, **candidate}, ensure_ascii=False))
    lines.append("END OF CANDIDATES")
    return [{"role": "system", "content": _prompt("select")}, {"role": "user", "content": "\n".join(lines)}]
