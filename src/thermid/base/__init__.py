"""What every room stands on: errors, units, expressions, files and their grammar, arrays, numbers with derivatives.

In: texts, files, numbers. Out: checked values in SI units, and errors that state the place and what to do.
May import: nothing of the other rooms.
"""
