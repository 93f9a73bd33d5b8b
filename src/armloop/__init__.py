"""armloop: measure a robot arm, reconstruct its dynamics, control it, and trace what the model misses.

The package's rooms, in the order a sample walks through them: `log`, `signals`, `conditions`, `library`,
`regression`, `reconstruction`, `model`, then `drake_systems` (closed loops) or `diagnosis` (what is left).
Importing the package is cheap; each room is imported by its own name.
"""

__version__ = "0.1.0"
