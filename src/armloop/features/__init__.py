"""Libraries of candidate functions of the joint torques, one kind a file."""
