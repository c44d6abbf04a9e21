"""Which colour an instance of the map has, by the vote of the masks that it was seen as.

A mean over all pixels of all views turns every thing grey: shade, highlights and what a mask took from its surroundings go into
it. Here each mask votes for its colour word with its pixels, and the instance takes the mean of the masks that voted for the
winner.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from openmap_agents.mapping import InstanceMap, MapInstance
from openmap_agents.perception import Masks
from openmap_agents.perception.colour import region_colour

_MOST_PIXELS = 500
_STRIDE = 3


class ColourVotes:
    """Colour word and median colour of every mask of every picture, in the order in which the mapper was given them."""

    def __init__(self) -> None:
        self._words: list[list[str]] = []
        self._medians: list[npt.NDArray[np.float64]] = []

    def add(self, rgb: npt.NDArray[np.uint8], masks: Masks) -> None:
        """Take in a picture (H, W, 3) uint8 with its masks; call it once for each call of ``OpenMapper.integrate``."""
        # A ninth of the pixels elects the same colours; thin masks may be left without a vote.
        rgb, masks = rgb[::_STRIDE, ::_STRIDE], Masks(masks.labels[::_STRIDE, ::_STRIDE], masks.scores)
        self._words.append(region_colour(rgb, masks))
        self._medians.append(_medians(rgb, masks))

    def colour(self, instance: MapInstance) -> npt.NDArray[np.uint8] | None:
        """The colour (3,) uint8 that an instance's masks elect; what the map says where none of them is known."""
        ballots: dict[str, list[tuple[int, npt.NDArray[np.float64]]]] = {}
        for call, label, pixels in instance.views.tolist():
            if call < len(self._words) and 1 <= label <= len(self._words[call]):
                median = self._medians[call][label - 1]
                if np.isfinite(median).all():
                    ballots.setdefault(self._words[call][label - 1], []).append((pixels, median))
        if not ballots:
            return instance.colour
        winner = max(sorted(ballots), key=lambda word: sum(pixels for pixels, _ in ballots[word]))
        weights = np.array([pixels for pixels, _ in ballots[winner]], np.float64)
        colours = np.stack([median for _, median in ballots[winner]])
        return np.asarray(np.rint(weights @ colours / weights.sum()), np.uint8)

    def paint(self, instance_map: InstanceMap) -> InstanceMap:
        """A copy of the map with elected colours."""
        return replace(instance_map, instances=[replace(i, colour=self.colour(i)) for i in instance_map])


def _medians(rgb: npt.NDArray[np.uint8], masks: Masks) -> npt.NDArray[np.float64]:
    """Median colour (n, 3) of each mask, from about ``_MOST_PIXELS`` of its pixels; nan where it has none."""
    order = np.argsort(masks.labels, axis=None, kind="stable")
    starts = np.searchsorted(masks.labels.ravel()[order], np.arange(1, len(masks) + 2))
    flat = rgb.reshape(-1, 3)
    medians = np.full((len(masks), 3), np.nan)
    for n in range(len(masks)):
        first, last = int(starts[n]), int(starts[n + 1])
        if last > first:
            medians[n] = np.median(flat[order[first : last : max(1, (last - first) // _MOST_PIXELS)]], axis=0)
    return medians
