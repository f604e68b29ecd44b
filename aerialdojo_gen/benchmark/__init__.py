"""The closed loop: a Gymnasium environment over the released tasks, agents, and their evaluation (paper: benchmark)."""
