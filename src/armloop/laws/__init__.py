"""Laws of joint torques: friction, and the physical effects that a model can lack."""
