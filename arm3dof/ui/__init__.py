"""What people see: plots, the 3-D page and its server, and replays as files."""
