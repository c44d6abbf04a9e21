"""What turns a mapper's result into a map that can be asked: elected colours, a name for every instance, and who made it."""

from __future__ import annotations

from dataclasses import replace

from openmap_agents.colour_votes import ColourVotes
from openmap_agents.grounding.lexicon import Lexicon, load_lexicon
from openmap_agents.grounding.scoring import MapView
from openmap_agents.grounding.text_space import TextSpace
from openmap_agents.mapping import InstanceMap
from openmap_agents.perception import Encoder


class Naming:
    """Finishes maps of one encoder's features; the words are encoded when the first map is finished.

    Parameters
    ----------
    encoder : Encoder
        Which made the features.
    made_by : (str, str)
        Specs of the segmenter and of the encoder, which are kept with the map; "" = not known.
    """

    def __init__(self, encoder: Encoder, made_by: tuple[str, str] = ("", "")) -> None:
        self._encoder, self._made_by = encoder, made_by
        self._words: tuple[TextSpace, Lexicon] | None = None

    def finish(self, instance_map: InstanceMap, colours: ColourVotes) -> InstanceMap:
        """A copy of the map with the colours that its masks elect, a label for every instance, and the specs.

        Parameters
        ----------
        instance_map : InstanceMap
        colours : ColourVotes
            Of every call of ``OpenMapper.integrate`` that led to the map.
        """
        painted = colours.paint(instance_map)
        if self._words is None:
            self._words = TextSpace(self._encoder), load_lexicon()
        labels = MapView(painted, *self._words).labels
        names = {i.id: label for i, label in zip(painted, labels, strict=True)}
        segmenter, encoder = self._made_by
        return replace(painted.with_labels(names), segmenter=segmenter, encoder=encoder)
