"""The command line.

In: words, options and files. Out: text or one JSON object, files, and an exit code. `app` holds the table of commands; the module of a
command is imported when the command is called.
"""

from thermid.app.cli.app import main as main
