"""Fleets: one design, many units, each with its logs; see `inference.fleets`."""
