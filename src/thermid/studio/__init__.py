"""The studio: a local page with the model, its curves beside the measured ones, and sliders; loopback only."""
