"""What the hardware is: parameters, elements, the tree, the area ledger, the deck."""
