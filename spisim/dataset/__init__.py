"""Data sets: many captures of a plan, made on one machine or a cluster, and read again."""
