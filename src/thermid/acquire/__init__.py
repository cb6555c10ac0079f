"""The bench: line protocol, logger, sensor map, telemetry. Firmware lies in `firmware/`."""
