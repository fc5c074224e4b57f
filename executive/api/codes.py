"""Codes of ends without an error, or without an answer. Each error class has its own code."""

OK = "ok"  # the code of success
LOST = "server.unreachable"  # the code if nothing is known of an end
INTERRUPTED_EXIT = 130  # Ctrl-C before the first goal, or pressed twice
READER_ENDED_EXIT = 141  # exit status of a program that SIGPIPE ends
