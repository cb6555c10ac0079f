"""Readers of logs: what a file holds is told by its content and never by its name, and what cannot be told for certain is refused.

In: a file in a format of the table in `formats`, and what its columns are. Out: cells of text with their lines, then numbers in SI, then
a `Record` or the columns of a plain table.
"""
