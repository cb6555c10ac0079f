"""``python -m thermid`` is ``thermid``."""

from thermid.app.cli.app import main

main()
