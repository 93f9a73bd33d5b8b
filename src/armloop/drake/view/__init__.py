"""Pictures of simulated arms in Meshcat: live, and as a recorded replay."""
