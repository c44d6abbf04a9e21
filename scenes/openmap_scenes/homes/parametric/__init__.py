"""Furniture made by rule: every call draws another size, style, material and texture.

``GENERATORS`` gives the generator of a kind; kinds are named as in ``kinds.tsv``.
"""

from openmap_scenes.homes.parametric.base import Generator, Limits, Made

GENERATORS: dict[str, Generator] = {}

__all__ = ["GENERATORS", "Generator", "Limits", "Made"]
