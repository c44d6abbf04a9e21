"""The one error type for data that cannot be used: it names the file, what was found, what was expected and what to do."""

from __future__ import annotations

from pathlib import Path


class DataError(ValueError):
    """A file or argument does not hold what it should.

    The message has one form everywhere: ``<source>: found <found>, expected <expected>. <remedy>``.
    """

    def __init__(self, source: str | Path, found: str, expected: str, remedy: str = "") -> None:
        self.source, self.found, self.expected, self.remedy = str(source), found, expected, remedy
        super().__init__(f"{source}: found {found}, expected {expected}.{' ' + remedy if remedy else ''}")

    def __reduce__(self) -> tuple[type[DataError], tuple[str, str, str, str]]:
        return type(self), (self.source, self.found, self.expected, self.remedy)
