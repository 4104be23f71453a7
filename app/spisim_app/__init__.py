"""The program `spisim`: its commands, and the pages and figures that people look at."""
