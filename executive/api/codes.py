"""Codes of ends without an error. Each error class has its own code."""

OK = "ok"  # the code of success
INTERRUPTED_EXIT = 130  # Ctrl-C before the first goal, or pressed twice
READER_ENDED_EXIT = 141  # exit status of a program that SIGPIPE ends
