"""The arm at work: lifecycle, connection, write guard, schedules and the streamer."""
