"""What the machine and the system provide: processes, streams, limits, the library of large pictures."""
