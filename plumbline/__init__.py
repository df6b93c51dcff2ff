"""plumbline: from raw recordings of balance to an identified, criticised model."""

__version__ = "0.1.0"
