"""Controllers and what they are made of: references, PID, feedforward, computed torque, rate limits, monitors."""
