"""How well viewpoints show their objects: scorers behind one interface (paper: anchor shortlist)."""
