"""What people start: the command line and the studio.

In: words, options, files, requests of a page. Out: text, JSON, files, pages, an exit code. No room imports it.
May import: every room.
"""
