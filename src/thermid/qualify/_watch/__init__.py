"""A test that is still running: what it will come to, whether waiting changes a verdict, and what went wrong.

In: a log that grows, a rule of stability, limits, and if there is one a model of the unit. Out: a `WatchLook` at every moment asked: stop
advice that stays valid however often one looks, nodes that nobody measures with bands, alarms with their suspects.
"""
