"""``python -m thermid`` is ``thermid``."""

from thermid.cli.app import main

main()
