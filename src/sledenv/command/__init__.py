"""The command line: its groups of commands, how they are run, the doctor; may import all of sledenv but agents/."""
