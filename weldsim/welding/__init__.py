"""A path file welded by a robot, simulated or real: contract, dry run, execution through the safety gate, report."""
