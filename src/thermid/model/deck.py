"""Deck files, read and written."""

from thermid.model._deck.document import DeckDocument as DeckDocument, Edit as Edit, Renamed as Renamed
from thermid.model._deck.modelfile import (
    STANDARD as STANDARD,
    load_model as load_model,
    model_beside as model_beside,
    model_from_dict as model_from_dict,
    model_text as model_text,
    save_model as save_model,
    standard_parts as standard_parts,
    toml_text as toml_text,
)
