"""The ports of a UR controller, and the one that orders faults."""

DASHBOARD, PRIMARY, SECONDARY, REALTIME, RTDE = 29999, 30001, 30002, 30003, 30004
PRIMARY_READ_ONLY = 30011
FAULTS = 30099  # ours alone; no real controller listens there
