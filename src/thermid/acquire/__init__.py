"""The bench: a board with sensors and heaters, the logger that listens to it, and the reader of its logs. Firmware lies in `firmware/`.

In: lines of a board over a serial port, a sensor map, a heater programme. Out: a log on disk, and its cells for `read_record`, which names
this package and imports it only when it meets such a log.
May import: `measure` and the foundation.
"""
