"""Experiment design: exciting references, the ranges they keep to, and samples of states."""
