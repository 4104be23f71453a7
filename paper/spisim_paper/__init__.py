"""The paper's results, computed anew and compared with its numbers."""
