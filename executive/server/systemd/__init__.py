"""The server as a service of systemd: its files, and what systemd learns while it runs."""
