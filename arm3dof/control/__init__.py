"""Model predictive control: from a state and a target to a torque inside its limits."""
