"""Furniture made by rule: every call draws another size, style, material and texture.

``GENERATORS`` gives the generator of a kind; kinds are named as in ``kinds.tsv``. Kitchen units match each other where they
get random generators of one seed (``kitchen.kitchen_style``).
"""

from openmap_scenes.homes.parametric import (
    appliances,
    bathing,
    bathroom,
    beds,
    chairs,
    decor,
    desks,
    fixtures,
    food,
    kitchen,
    lighting,
    media,
    plants,
    seating,
    shelving,
    small,
    sofas,
    storage,
    tables,
    tableware,
    textiles,
)
from openmap_scenes.homes.parametric.base import Generator, Limits, Made

FURNITURE = (
    chairs, seating, sofas, tables, desks, storage, shelving, beds, kitchen, appliances, bathroom, bathing,
)  # fmt: skip
THINGS = (textiles, lighting, decor, plants, tableware, food, media, fixtures, small)

GENERATORS: dict[str, Generator] = {}
for _module in FURNITURE + THINGS:
    GENERATORS |= _module.GENERATORS

__all__ = ["FURNITURE", "GENERATORS", "THINGS", "Generator", "Limits", "Made"]
