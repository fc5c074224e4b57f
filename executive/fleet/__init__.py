"""Many arms: jobs, presence and stop through a NATS server. Each worker is a client of its arm."""
