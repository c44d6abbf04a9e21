"""From what a person says to the one instance meant: ``Grounder(llm=..., encoder=...).ground(instruction,
instance_map)``.

``interpreter.py`` and ``noun_phrases.py`` read the instruction, ``needs.py`` knows what things are for and offers
different guesses, ``text_space.py`` holds the texts' vectors, ``spatial.py`` and ``scoring.py`` do the
geometry, ``llm.py`` and ``dialogue.py`` ask a language model instead, ``grounder.py`` puts them together.
"""

from openmap_agents.grounding.description import Description, Relation, RouteClause, Thing
from openmap_agents.grounding.grounder import Grounder, Grounding, GroundingSettings
from openmap_agents.grounding.interpreter import Interpreter
from openmap_agents.grounding.llm import Budget, LanguageModel, LanguageModelError, OpenAIModel, make_llm

__all__ = [
    "Budget",
    "Description",
    "Grounder",
    "Grounding",
    "GroundingSettings",
    "Interpreter",
    "LanguageModel",
    "LanguageModelError",
    "OpenAIModel",
    "Relation",
    "RouteClause",
    "Thing",
    "make_llm",
]
