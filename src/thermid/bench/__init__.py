"""The bench: a board with sensors and heaters, the logger that listens to it, and the reader of its logs. Optional.

In: lines of a board over a serial port, a sensor map, a heater programme. Out: a log on disk, and its cells for `read_record`, which loads
this room only when it meets such a log. Firmware lies in `firmware/`.
May import: `base`, `measure`.
"""
