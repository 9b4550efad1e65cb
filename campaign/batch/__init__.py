"""Many tasks: who does them, what was done before, and what became of them; begin with ``run``."""
