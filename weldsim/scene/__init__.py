"""What is there: the arm, its tool, the cell about it, and the workpiece with its true seams, compiled for MuJoCo."""
