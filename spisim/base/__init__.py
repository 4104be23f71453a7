"""Configuration files, LLVM for Dr.Jit, and progress bars."""
