"""``python -m thermid`` is ``thermid``."""

from thermid.cli import main

main()
