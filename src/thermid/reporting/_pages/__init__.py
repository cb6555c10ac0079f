"""The page of a campaign, of a study.

In: a `Campaign` or a `Study`. Out: one self-contained page each (`report`, `study_report`), with the tables, the glance at its top, the
origins of all that is in it, and what speaks against it.
"""
