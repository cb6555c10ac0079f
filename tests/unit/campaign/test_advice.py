"""What to do after a bad fit: a command that finds something."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest

from thermid.campaign._stages import in_words, next_command
from thermid.inference._explain.mistakes import Mistake, Mistakes


@pytest.mark.parametrize("kind", ["per cent", "unit", "exchanged", "clock"])
def test_a_mistake_that_the_first_lines_name_is_mended_and_the_fit_repeated(kind: str) -> None:
    """`thermid check` said nothing of such a mistake, and a reader who followed the advice was at a dead end."""
    fit: Any = SimpleNamespace(request=None, stage="box")
    mistake = Mistake(kind, "T", "T is in degF", 40.0, (3.0, 0.1), "Write unit = 'degF'.")
    command = next_command("campaign.toml", fit, Mistakes("box", (mistake,), True))
    assert command == "thermid calibrate campaign.toml"
    assert in_words(command).endswith(f" {command}")
