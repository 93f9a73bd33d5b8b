"""Simulated experiments: scenarios from YAML, data collection, closed-loop tracking, a grasped load, friction wear."""
