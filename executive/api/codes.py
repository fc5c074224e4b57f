"""Codes and exit statuses that several files use. Each error class has its own code."""

OK = "ok"  # the code of success
LOST = "server.unreachable"  # the code of a goal with an unknown end
INTERRUPTED_EXIT = 130  # exit status after Ctrl-C before the first goal, or after two Ctrl-C
READER_ENDED_EXIT = 141  # exit status of a program that SIGPIPE ends
