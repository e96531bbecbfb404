"""Files, processes, tables in text, packages that may be missing; imports no other room."""
