"""Recordings of other programs, and exports of captures to them."""
