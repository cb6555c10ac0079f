"""What a person reads: tables, figures, diagrams, pages.

In: results of any room. Out: SVG text, HTML pages, paper, JSON objects. The packages inside, each of which knows only those before it:
`_blocks`, what a page is made of; `_pictures`, curves over time; `_diagrams`, a model as a picture; `_pages`, of a campaign, a study,
candidate structures; `_qualification`, of a plan worked through.
May import: `base`, `campaign`, `fit`, `inference`, `measure`, `model`, `prediction`, `qualify`, `simulation`, `values`.
"""
