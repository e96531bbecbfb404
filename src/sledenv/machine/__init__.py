"""What the machine is asked for: files, processes, packages that may be missing; imports nothing of sledenv."""
