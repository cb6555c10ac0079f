"""Whether readings or a run are steady by a rule, and where and when they will be.

In: a record, or the run of a profile, and a rule. Out: a `Stability`: when the rule holds, the slowest part, what is left unfinished; a
`Forecast` of a test that is still running, with its error, or why there is none.
"""
