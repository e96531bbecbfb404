"""From recordings to a contact law: what is fitted to measured rebounds and tracks, and how sure one may be of it."""

from sledenv.machine.extras import needs

with needs("analysis", __name__):
    import joblib  # noqa: F401
    import pandas  # noqa: F401
    import pyarrow  # noqa: F401
    import scipy  # noqa: F401
