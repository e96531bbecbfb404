"""Files of configuration, and the contexts that scenarios draw from theirs; imports simulation/."""
