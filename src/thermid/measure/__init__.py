"""Records of measured temperatures: a record and its channels, readers of logs, steadiness of readings. It knows nothing of models.

In: logs in the formats of laboratories, arrays. Out: a `Record`, a plain table; how steady readings are, with the error of that.
May import: `base`.
"""
