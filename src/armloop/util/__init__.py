"""Utilities that no robot is needed for: errors, atomic writes, bounded reading, workers, checkpoints."""
