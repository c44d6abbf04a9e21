"""How wrong the oracle is told to be, and how that is written in a spec."""

from __future__ import annotations

from dataclasses import dataclass, fields

_RANGES: dict[str, tuple[float, float]] = {
    "split": (0, 1), "merge": (0, 1), "drop": (0, 1), "boundary": (0, 32), "features": (0, 10), "names": (0, 1),
    "seed": (0, 2**32 - 1),
}  # fmt: skip


@dataclass(frozen=True)
class OracleNoise:
    """What is wrong with what the oracle says; nothing by default.

    Ranges: 0..1 for probabilities, ``boundary`` 0..32, ``features`` 0..10, ``seed`` a whole number of 32 bits.
    """

    split: float = 0.0
    """Probability that a mask of at least 2,500 pixels (of 640 x 480) is cut in two: half by position, half by depth."""
    merge: float = 0.0
    """Probability that a mask joins a random one that it touches."""
    drop: float = 0.0
    """Probability that a mask is missing."""
    boundary: float = 0.0
    """Edges wander smoothly by up to so many pixels, and each mask is then eroded or dilated by up to as many."""
    features: float = 0.0
    """Length s of a random vector that is added to a unit feature before it is made a unit vector again: its cosine to what it
    was is about 1 / sqrt(1 + s^2)."""
    names: float = 0.0
    """Probability that a mask is called by the name of something else of the scene."""
    seed: int = 0

    def __post_init__(self) -> None:
        for name, (low, high) in _RANGES.items():
            if not low <= getattr(self, name) <= high:
                raise ValueError(_refusal(f"{name}={getattr(self, name)}"))

    @classmethod
    def parse(cls, text: str) -> OracleNoise:
        """The noise of "split=.1,merge=.05,seed=3"; "" is none.

        Raises
        ------
        ValueError
            An unknown or repeated key, or a value out of its range.
        """
        values: dict[str, float] = {}
        for part in filter(None, text.split(",")):
            key, _, value = (x.strip() for x in part.partition("="))
            try:
                number = int(value) if key == "seed" else float(value)
            except ValueError:
                raise ValueError(_refusal(part)) from None
            if key not in _RANGES or key in values:
                raise ValueError(_refusal(part))
            values[key] = number
        return cls(**values)  # type: ignore[arg-type]

    def __str__(self) -> str:
        """What ``parse`` reads; only what is not as by default."""
        return ",".join(
            f"{f.name}={getattr(self, f.name):g}" if f.name != "seed" else f"seed={self.seed}"
            for f in fields(self)
            if getattr(self, f.name) != f.default
        )


def _refusal(found: str) -> str:
    ranges = ", ".join(
        f"{key} {low:g}..{high if key == 'seed' else f'{high:g}'}" for key, (low, high) in _RANGES.items()
    )
    return f"oracle noise has {found!r}, expected key=value, each key once, separated by commas: {ranges}"


NO_NOISE = OracleNoise()
