"""Many runs without their memory, and who does them.

In: temperatures of groups of members; tasks that do not need each other. Out: counts on grids from which quantiles and moments are read,
the same whatever the order; results of tasks from this process, a pool or a cluster.
"""
