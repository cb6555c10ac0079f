"""The studio, a local page on this machine's loopback address only.

In: a deck or campaign on disk and what a person moves on the page. Out: answers as JSON: the coloured network, curves beside the measured
ones, stages, test profiles; edits of values back into files.
"""
