"""What is done to the hardware.

In: boundaries, loads, commands, schedules, a start and a duration as texts, numbers or signals; columns of logs. Out: a frozen `Scenario`
of signals, and how its run begins.
"""
