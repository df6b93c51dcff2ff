"""Constants of nature and of convention."""

G = 9.81  # [m/s2] gravity, as in the papers this project follows
