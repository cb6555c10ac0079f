"""Maps of a network."""

from thermid.reporting._diagrams.map import network_map as network_map, parts_of as parts_of
from thermid.reporting._diagrams.places import card_places as card_places
