"""Problems and their best launches, agents trained and judged, scores and their report; imports envs/ and pages/."""

from sledenv.machine.extras import needs

with needs("benchmark", __name__):
    import joblib  # noqa: F401
    import pandas  # noqa: F401
    import pyarrow  # noqa: F401
    import scipy  # noqa: F401
    import tqdm  # noqa: F401
