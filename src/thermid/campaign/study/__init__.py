"""A methodology on record: knowledge and use, box colours, set-ups, procedure.

In: a study file that names a campaign. Out: a `Study`: the four steps with what was found.
May import: `campaign`, `judge`, `fit` and the rooms below a fit.
"""
