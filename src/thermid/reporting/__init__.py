"""What a person reads: tables, figures, diagrams, pages.

In: results of any room. Out: SVG text, HTML pages, paper. Nothing stands here itself. The packages inside, each of which knows only
those before it: `blocks`, what a page is made of; `pictures`, curves over time; `diagrams`, a model as a picture; `pages`, of a campaign,
a study, candidate structures; `qualification`, of a plan worked through.
May import: each of its packages has its own line in tests/architecture/test_imports.py.
"""
