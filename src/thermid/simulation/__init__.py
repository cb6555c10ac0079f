"""Running a model in a scenario: transient and steady, with names put back on the results."""
