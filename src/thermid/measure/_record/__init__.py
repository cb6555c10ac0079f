"""The record of a test: channels on one axis of times, what their sensors do, and its preparation.

In: arrays, and texts with units. Out: a `Record` of frozen channels, with what was done to it in words; a new one from each step of
preparation, never a changed one.
"""
