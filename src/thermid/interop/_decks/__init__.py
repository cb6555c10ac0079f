"""Decks of SINDA and ESATAN: read as a model, its scenarios and what was left out; fitted values written back into the same file.

In: a deck of SINDA/G, SINDA/FLUINT or ESATAN-TMS with the files that it includes. Out: a `NetworkFile`, which becomes a `Model`, and the
text of the deck with new numbers.
"""
