"""Numbers of standards and rules, each with the clause that it comes from and the mark of how it is known.

In: texts of numbers with their sources. Out: a `Number` of a profile, a `Figure` of a rule, the policies for margins built of them; and
what may decide nothing because nobody has read its source.
May import: the rooms below a fit.
"""
