"""The page of a qualification: a plan worked through, or a correlation of two records.

In: a `Qualification` or a `Correlation` with its judgements, limits and margins. Out: one self-contained HTML page in the order in which a
correlation report is read (`qualification_report`, `correlation_report`).
"""
