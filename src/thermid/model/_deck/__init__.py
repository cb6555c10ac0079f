"""Decks: TOML files that say what a model is.

In: a file, or the same as a dictionary. Out: a `Model`, or one error that lists every fault with its line; a model written as a deck, into
one whose comments stay where there is one.
"""
