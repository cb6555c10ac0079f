"""The page of a campaign, of a study, of candidate structures.

In: a `Campaign`, a `Study`, or structures side by side. Out: one self-contained page each (`report`, `study_report`, `structures_report`),
with the tables, the glance at its top, the origins of all that is in it, and what speaks against it.
"""
