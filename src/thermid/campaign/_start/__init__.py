"""The first afternoon: from a log, a template or a shipped example to a project that runs.

In: logs in any format and a few answers, or a name. Out: a structure that the log supports, with what it cannot tell; a commented deck,
scenario and campaign on disk; or a copy of an example with its data.
"""
