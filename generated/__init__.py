"""The emitted headers of the core, as data of the package."""
