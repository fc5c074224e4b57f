"""The task executive: goals in, outcomes out. `armtree` exports its Python interface."""
