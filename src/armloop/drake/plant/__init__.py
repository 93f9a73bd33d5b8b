"""Simulated arms: a discrete Drake plant whose joints stick, its loads, injected faults, reconstructed models as plants."""
