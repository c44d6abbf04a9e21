"""How people put things: what they take back, mention only, rule out, or say of a thing that they do not name.

Patterns over normalised text (``lexicon.normalised``) and over the words of one clause; the interpreter acts on them.
"""

from __future__ import annotations

import re

HAND = re.compile(
    r",? ?\b(?:(?:on|to|at) (?:your|the|my) (?:left|right)(?:[ -]hand)?(?: side)?(?! (?:hand )?(?:side )?of\b)"
    r"|straight (?:ahead|on))(?![ -]hand| side| of)\b"
)
"""From which hand something is passed: it depends on the way walked, which a map does not know."""
CORRECTION = re.compile(
    r"(?:^|[,;.!?] *| )(?:oh |ah |or |um |uh )?(?:no wait|wait no|i mean|i meant|sorry, i mean|scratch that|no sorry|sorry no"
    r"|correction|make that|or rather|oh sorry)[,:]? +|[,;.!?] *(?:no,? )?sorry,? +(?=(?:the|a|an|my|our) )"
)
"""What was said just before is taken back."""


NEED_STATE = re.compile(
    r"^(?:my|the|our|his|her|their|these|those|this|all|no) (?:(?!that |which |who |where ).)*"
    r"\b(?:is|isn't|are|aren't|was|were|has|have|had|will|won't|would|should|must|can't|cannot|could|do|does|don't|doesn't"
    r"|didn't|feels?|hurts?|smells?|stinks?|tastes?|looks?|needs?|wants?|keeps?|gets?|got|ran|went|came|broke|fell|stopped)\b"
)
SAYS = re.compile(
    r"^(?:i|we|he|she|they|it|there|somebody|someone|nobody|everybody|everyone|[a-z]+ of (?:us|you|them))(?:'[a-z]+)?\b."
)
"""A sentence with a subject, which no noun phrase is."""
MENTION = re.compile(
    r"^(?:there's|there is|there are|there was|i (?:see|saw|left|put|lost|dropped|had|have)|i've (?:got|left|put|lost)|we have"
    r"|you know) (?=an? |some |the |my |our )"
)
"""What only introduces a thing, of which the next clause says what to do with it."""
AVOID = re.compile(
    r"^(?:just )?(?:anything|everything|something|anywhere|any one) (?:but|except|except for|other than|apart from|besides) "
)
PUT = re.compile(
    r"^(?:throw|put|place|drop|toss|set|stick|pop|lay|hang|leave) (?:this|it|that|these|those|them)(?: (?:away|down|back|up))? "
    r"(?:in|into|on|onto|under|beside|by|next to|near) (?=the |my |our |your )"
)
"""Where something goes that is not named is the place meant."""
NO_VERBS = frozenset(
    {
        "not",
        "no",
        "but",
        "with",
        "without",
        "for",
        "except",
        "if",
        "because",
        "while",
        "as",
        "is",
        "are",
        "which",
        "what",
        "should",
        "would",
        "could",
        "can",
        "do",
        "does",
        "did",
        "will",
        "may",
        "must",
        "has",
        "have",
        "had",
        "am",
        "was",
        "were",
    }
)
DEFINITE = ("the", "my", "our", "your", "his", "her", "their", "that", "this", "those", "these")


def meant(text: str) -> str:
    """A normalised instruction without what its speaker took back, and without the hands on which things are passed."""
    told = CORRECTION.split(text)
    if len(told) > 1 and told[-1].strip():
        before, after = told[-2].strip(), told[-1]
        # "Go to the chair, I mean the stool": the verb stays with what is said after.
        starts = re.match(r"(?:a|an|the|my|our|your|one|some)\b", after)
        verb = re.match(r"^(.*?)\b(?:a|an|the|my|our|your|some)\b", before)
        text = f"{verb[1] if starts and verb else ''}{after}"
    return HAND.sub("", text)
