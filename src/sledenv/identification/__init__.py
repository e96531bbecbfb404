"""From recordings to a contact law, and how sure one may be of it; imports pages/, plot/ and simulation/."""

from sledenv.machine.extras import needs

with needs("analysis", __name__):
    import joblib  # noqa: F401
    import pandas  # noqa: F401
    import pyarrow  # noqa: F401
    import scipy  # noqa: F401
