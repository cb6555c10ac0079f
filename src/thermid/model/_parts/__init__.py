"""What a model is made of: nodes, conductors, surfaces, joints, enclosures, loads, and the values in them.

In: values as a deck or a caller writes them. Out: frozen elements and a `Parameter` for each value with its bounds, source and standing;
of each kind of conductor, the rows of the law table that it means.
"""
