"""What the machine and the system provide: processes, streams, limits."""
