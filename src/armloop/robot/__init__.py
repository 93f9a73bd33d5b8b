"""The arm as its URDF describes it: joints and limits, kinematics, recursive Newton-Euler inverse dynamics."""
