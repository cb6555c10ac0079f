"""What a page is made of, and how it becomes a file.

In: tables of cells, words, figures as markup, gathered in sections as values. Out: one self-contained HTML page, or the same on paper;
numbers and names as a person reads them. The templates of all pages stand here.
"""
