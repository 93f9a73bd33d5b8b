"""Numerics of watching an arm: sums instead of samples, scores, sequential tests, and what a window's sums name."""
