"""What the machine is asked for: files, processes, tables in text, packages that may be missing; imports none else."""
