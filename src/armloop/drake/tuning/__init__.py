"""Loop analysis and gain design: margins of PID loops about a posture, gains for a wanted bandwidth, step checks."""
