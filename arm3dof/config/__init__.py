"""Settings files: TOML in metres and pixels becomes frozen values."""
