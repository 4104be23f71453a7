"""What everything else stands on: configuration, LLVM for Dr.Jit, progress."""
