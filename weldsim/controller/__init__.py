"""The virtual UR controller: a server that speaks the UR protocols in front of the simulated arm.

Verified with the real ur_rtde client over sockets; never compared with a real controller.
"""
