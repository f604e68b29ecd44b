"""Agents that ask a multimodal language model for every action (paper, Appendix A), and what they say to it."""
