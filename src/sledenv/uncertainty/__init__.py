"""Studies: what is not known of a descent, and what follows for it; imports pages/, plot/ and scenarios/."""

from sledenv.machine.extras import needs

with needs("analysis", __name__):
    from sledenv.uncertainty.model import Study, StudyError, load_study, study_names
    from sledenv.uncertainty.result import StudyResult
    from sledenv.uncertainty.run import study

__all__ = ["Study", "StudyError", "StudyResult", "load_study", "study", "study_names"]
