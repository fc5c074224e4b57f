"""Goals: words, states, queue, executor thread, run loop and outcome."""
